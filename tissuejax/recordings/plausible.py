"""Plausibility at the door: what looks like a slip of unit, sign or sensor, with the likely slip named.

`slips` are sentences: nothing is refused for being unusual. `refuse_unusable` stops a fit or a diagnosis where a
channel holds nothing that could be fitted, `refuse_gaps` a diagnosis where samples are lost; reading and looking stay
possible.
"""

from collections.abc import Iterable

import numpy as np

from tissuejax.errors import InputError
from tissuejax.recordings import checks
from tissuejax.recordings import plausible_signals as signals
from tissuejax.recordings.plausible_signals import deformation_of, drive_of, load_of, unanswered
from tissuejax.recordings.recording import Recording, Sample

STRETCH = (0.2, 4.0)  # what soft tissue bears
STRESSES = (1.0, 1e8)  # Pa: below, no cell measures it; above, it is steel's
FEW = 10  # samples
ABSURD = 1e20  # SI: squares and their sums stay far from overflow, and nothing measured is near


def slips(sample: Sample, names: Iterable[str] | None = None) -> list[str]:
    """Sentences on what looks like a slip, recording by recording.

    Args:
        sample: the sample.
        names: recordings to look at; all by default.
    """
    said = []
    for name in sample.recordings if names is None else names:
        recording = sample.recordings[name]
        for check in (*CHECKS, *(TIMED if sample.timed else ())):
            said += [f"{name}: {sentence}" for sentence in check(recording)]
    return said


def refuse_unusable(sample: Sample, names: Iterable[str]) -> None:
    """Refuse recordings that a fit can learn nothing from.

    Raises:
        InputError: fewer than three samples, values beyond 1e20, a channel that reads zero throughout, one that never
            changes while nothing is done either, a stress that does not answer the deformation, or a noise level that
            is not above zero.
    """
    names = tuple(names)
    for name in names:
        recording = sample.recordings[name]
        for key, channel in recording.channels.items():
            values = np.asarray(channel.values, float)
            if len(values) < 3:
                raise InputError(
                    f"recording {name}: {len(values)} samples of {key}; expected at least 3, and many more to tell a "
                    "model from noise: leave it out, or record more"
                )
            seen = values[np.isfinite(values)]
            if len(seen) and np.max(np.abs(seen)) > ABSURD:
                raise InputError(
                    f"recording {name}: {key} reaches {np.max(np.abs(seen)):.3g} {channel.unit}; nothing that is "
                    f"measured exceeds {ABSURD:.0e}: check the unit and the column"
                )
            if key != "markers" and len(seen) and not seen.any():
                raise InputError(
                    f"recording {name}: {key} is zero throughout: the sensor was dead or the wrong column was read; "
                    "mend the side file or leave the recording out"
                )
            if key == "nominal_stress" and (why := unanswered(recording)):
                raise InputError(
                    f"recording {name}: {key} {why}: the sensor was dead or the wrong column was read; mend the side "
                    "file or leave the recording out"
                )
            drive = drive_of(recording)
            if drive is not None and len(seen) and np.ptp(seen) == 0 and np.ptp(drive) == 0:
                raise InputError(
                    f"recording {name}: neither the deformation nor {key} ever changes: there is nothing to fit; "
                    "check the columns that were read"
                )
    checks.noise_levels({name: sample.recordings[name] for name in names}, sample.name)


def refuse_gaps(sample: Sample, names: Iterable[str]) -> None:
    """Refuse values that are not finite, where nothing can be asked of the rest; markers may be lost.

    Raises:
        InputError: which channel of which recording, and how many samples.
    """
    for name in names:
        for key, channel in sample.recordings[name].channels.items():
            values = np.asarray(channel.values, float).reshape(len(channel.values), -1)
            if key != "markers" and (lost := int(np.sum(~np.all(np.isfinite(values), axis=1)))):
                raise InputError(
                    f"recording {name}: {lost} of {len(values)} samples of {key} are not finite; leave these samples "
                    "out, or the recording"
                )


def _stretch(recording: Recording) -> list[str]:
    if "stretch" not in recording.inputs:
        return []
    stretch = np.asarray(recording.inputs["stretch"], float)
    low, high = float(stretch.min()), float(stretch.max())
    if high > STRETCH[1] or low < STRETCH[0]:
        worst = high if high > STRETCH[1] else low
        thousand = (
            "; a thousandth of the strain would be usual, so millimetres may have been read as metres"
            if 1e-3 * (high - 1) > 1e-3 and high > 20
            else "; were percent read as a ratio, or is the height wrong?"
        )
        return [f"stretch {worst:.4g} is outside {STRETCH[0]:g} to {STRETCH[1]:g}{thousand}"]
    if np.ptp(stretch) < 1e-3 and np.abs(stretch - 1).max() < 1e-3:
        return [
            f"stretch stays within {np.abs(stretch - 1).max():.2g} of 1; were micrometres read for millimetres, or is "
            "the height in another unit?"
        ]
    return []


def _stress(recording: Recording) -> list[str]:
    load = load_of(recording)
    if load is None:
        return []
    most = float(np.abs(load).max())
    if most > STRESSES[1]:
        return [
            f"stress reaches {most:.3g} Pa, above {STRESSES[1]:.0e} Pa; kPa read as MPa, kN for N, or an area of the "
            "wrong unit?"
        ]
    if 0 < most < STRESSES[0]:
        return [
            f"stress stays below {most:.3g} Pa, which no cell resolves; kPa or MPa read as Pa, mN for N, or an area in "
            "cm^2 read as m^2?"
        ]
    return []


def _sense(recording: Recording) -> list[str]:
    drive, load = drive_of(recording), load_of(recording)
    if drive is None or load is None or np.ptp(drive) < 0.02 or not np.ptp(load):
        return []
    start = int(np.argmin(np.abs(drive)))
    # Up to the largest load: what comes after may be a specimen that broke.
    end = int(np.argmax(np.abs(load - load[start]))) + 1
    drive, load = drive[:end], load[:end]
    if end < FEW or not np.ptp(drive) or not np.ptp(load):
        return []
    most = int(np.argmax(np.abs(drive - drive[0])))
    opposite = (drive[most] - drive[0]) * (load[most] - load[0]) < 0
    if opposite and np.corrcoef(drive, load)[0, 1] < -0.5:
        what = "shear" if "shear" in recording.inputs else "stretch"
        return [
            f"stress falls where {what} rises: a sign is turned round, e.g. compression read as tension in one column "
            '(positive = "compression", or sign = -1)'
        ]
    return []


def _few(recording: Recording) -> list[str]:
    least = min((len(np.asarray(c.values)) for c in recording.channels.values()), default=0)
    return [f"{least} samples only: too few to tell a model from noise"] if least < FEW else []


def _history(recording: Recording) -> list[str]:
    load = load_of(recording)
    drive = drive_of(recording)
    if load is None or len(load) < FEW or not np.ptp(load):
        return []
    if drive is None or abs(drive[0]) > 0.05 * np.abs(drive).max():  # `_strained` says so
        return []
    noise = recording.channels["nominal_stress"].noise_std or 0.0
    share = abs(load[0]) / np.abs(load).max()
    if share > 0.05 and abs(load[0]) > 5 * noise:
        return [
            f"starts at {share:.0%} of its largest stress, not at zero: a preload, an offset of the cell, or loading "
            "before the recording that the model doesn't know of"
        ]
    return []


def _strained(recording: Recording) -> list[str]:
    if (driven := deformation_of(recording)) is None:
        return []
    key, rest, values = driven
    strain = np.abs(values - rest)
    beyond = strain[0] - np.maximum(0.05 * strain.max(axis=0), 1e-3)
    if np.max(beyond) <= 0:
        return []
    first = values[0, int(np.argmax(beyond))]
    return [
        f"starts at {key} {first:.3g}, not at rest ({rest:g}): what was done before the recording no model knows of; "
        "relaxation begins at the first sample, as if that were done then"
    ]


CHECKS = (
    _stretch,
    _stress,
    _sense,
    signals.dead,
    signals.saturated,
    signals.coarse,
    signals.spiked,
    _few,
    signals.uneven,
    signals.filtered,
    _history,
)
TIMED = (_strained,)  # what means nothing where no times were recorded
