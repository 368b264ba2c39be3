"""A recording beside what is played: force and markers by the surrogate, and by the full model for comparison."""

from collections.abc import Mapping

import numpy as np

from tissuejax.experiments.predictor import predictor
from tissuejax.mesh.columns import Lobe
from tissuejax.model import Model
from tissuejax.play.blob import coded
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.surrogate.predict import predicted
from tissuejax.surrogate.surrogate import Surrogate


def errors(measured: Recording, simulated: Recording) -> dict[str, dict]:
    """Root mean square of the residuals by channel, and over the noise where that is recorded; peak of the force."""
    found = {}
    for name, channel in simulated.channels.items():
        truth = measured.channels[name]
        apart = np.asarray(channel.values, float) - np.asarray(truth.values, float)
        rms = float(np.sqrt(np.nanmean(apart**2)))
        found[name] = {"rms": rms, "unit": truth.unit}
        if truth.noise_std:
            found[name]["over_noise"] = rms / truth.noise_std
    if "force" in found:
        found["force"]["peak"] = float(np.nanmax(np.linalg.norm(np.asarray(measured.channels["force"].values), axis=1)))
    return found


def compared(
    surrogate: Surrogate, sample: Sample, name: str, lobe: Lobe, model: Model | None, values: Mapping | None
) -> dict:
    """The errors of the surrogate and, where the model is known, of the full simulation of the same recording."""
    measured = sample.recordings[name]
    ours = predicted(surrogate, measured, lobe)
    found = {"recording": name, "surrogate": errors(measured, ours)}
    if model is not None:
        full = predictor(model, sample, [name], processes=1).predict(values)[name]
        found["direct"] = errors(measured, full)
        found["surrogate_over_direct"] = {
            c: found["surrogate"][c]["rms"] / found["direct"][c]["rms"]
            for c in found["surrogate"]
            if c in found["direct"]
        }
    return found


def for_page(surrogate: Surrogate, measured: Recording, lobe: Lobe | None, most: int = 600) -> dict:
    """What the page needs to play a recording beside the prediction."""
    ours = predicted(surrogate, measured, lobe)
    force = measured.channels["force"]
    begin, end = float(force.time[0]), float(force.time[-1])
    clock = np.linspace(begin, end, most)

    def along(time, values):
        flat = np.asarray(values, float).reshape(len(time), -1)
        return np.stack([np.interp(clock, time, column) for column in flat.T], 1)

    offset = np.asarray(surrogate.rig.offset)
    words = {
        "name": measured.name, "duration": end - begin, "frames": most, "time": coded(clock),
        "path": coded(along(measured.inputs["probe/time"], measured.inputs["probe/position"]) + offset),
        "measured": coded(along(force.time, force.values)),
        "predicted": coded(along(force.time, ours.channels["force"].values)),
        "text": "black: recorded, blue: predicted; "
        + ", ".join(f"{c} rms {_shown(e)}" for c, e in errors(measured, ours).items()),
    }  # fmt: skip
    if "markers" in ours.channels:
        a, b = measured.channels["markers"], ours.channels["markers"]
        words |= {
            "points": a.values.shape[1],
            "markers": coded(along(a.time, a.values)),
            "simulated": coded(along(b.time, b.values)),
        }
    return words


def _shown(error: dict) -> str:
    return f"{1e3 * error['rms']:.3g} m{error['unit']}"
