"""Effects that remember: what their times may be, where to begin, and recordings that begin in the middle."""

from collections.abc import Mapping, Sequence

import numpy as np

from tissuejax.estimation.series import finest
from tissuejax.estimation.weights import Weights
from tissuejax.experiments.predictor import Predictor
from tissuejax.recordings.recording import Recording

LENGTHS = 3.0  # of the longest recording: a slower time is a straight line in it
LOADED = 4.0  # standard errors of the first samples' mean from which a recording begins under load
FIRST = 5  # samples
REST = 0.02  # of the largest drive: nothing is done yet


def time_bounds(predictor: Predictor) -> dict[str, tuple[float, float]]:
    """(lower, upper) of the relaxation times of a model, from the sampling and the length of its recordings, s."""
    recordings = [predictor.sample.recordings[name] for name in predictor.names]
    series = [np.asarray(c.time, float) for r in recordings for c in r.channels.values()]
    shortest, longest = finest(series), max((float(t[-1] - t[0]) for t in series if len(t)), default=0.0)
    if not shortest:
        return {}
    found = {}
    for path in times(predictor):
        declared = predictor.model.parameters[path]
        lower, upper = max(shortest, declared.lower), min(LENGTHS * longest, declared.upper)
        if lower < upper:
            found[path] = lower, upper
    return found


def times(predictor: Predictor) -> list[str]:
    """Paths of relaxation times."""
    return [f"effects.{effect.name}.{name}" for effect in predictor.model.effects for name in effect.times]


def spread(bounds: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Times to begin with: those of one effect in equal steps of their logarithm, inside the bounds."""
    found: dict[str, float] = {}
    effects: dict[str, list[str]] = {}
    for path in bounds:
        effects.setdefault(path.rpartition(".")[0], []).append(path)
    for paths in effects.values():
        lower, upper = bounds[paths[0]]
        inner = np.geomspace(lower, upper / LENGTHS, len(paths) + 2)[1:-1]
        found |= {path: float(t) for path, t in zip(paths, np.clip(inner, lower, upper), strict=True)}
    return found


def begun_loaded(recordings: Mapping[str, Recording], names: Sequence[str], noise: Weights) -> list[str]:
    """Sentences on recordings whose first samples are under load: what was done before is not in them."""
    said = []
    for name in names:
        recording = recordings[name]
        channel = recording.channels.get("nominal_stress")
        if channel is None or not {"stretch", "shear"}.intersection(recording.inputs):
            continue
        stress = np.asarray(channel.values, float).reshape(len(channel.time), -1)
        kind = "shear" if "shear" in recording.inputs else "stretch"
        drive = np.asarray(recording.inputs[kind], float).reshape(len(channel.time), -1)
        rest = 0.0 if kind == "shear" else 1.0
        away = np.max(np.abs(drive[:FIRST] - rest), axis=1) > REST * np.max(np.abs(drive - rest))
        still = int(np.argmax(away)) if away.any() else FIRST  # samples before anything is done
        if still == 0:
            axis = int(np.argmax(np.abs(drive[0] - rest)))
            said.append(f"{name} ({kind} {drive[0, axis]:.4g})")
            continue
        first = float(np.max(np.abs(np.mean(stress[:still], axis=0))))
        level = noise.std.get(f"{name}/nominal_stress", 0.0)
        if first > max(LOADED * level / still**0.5, 1.5 * REST * float(np.nanmax(np.abs(stress)))):
            said.append(f"{name} (a stress of {first:.3g} {channel.unit} at rest)")
    if not said:
        return []
    return [
        f"{', '.join(said)} begins under load, so it was cut out of something longer: relaxation is computed from rest "
        "at its first sample, and what was done before is missing. Include the earlier part, or rest the specimen."
    ]
