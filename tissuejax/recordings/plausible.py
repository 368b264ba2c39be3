"""Plausibility at the door: what looks like a slip of unit, sign or sensor, with the likely slip named.

`slips` are sentences: nothing is refused for being unusual. `refuse_unusable` stops a fit or a diagnosis where a
channel holds nothing that could be fitted, `refuse_gaps` a diagnosis where samples are lost; reading and looking stay
possible.
"""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.recordings.recording import Recording, Sample

STRETCH = (0.2, 4.0)  # what soft tissue bears
STRESSES = (1.0, 1e8)  # Pa: below, no cell measures it; above, it is steel's
FEW = 10  # samples
ABSURD = 1e20  # SI: squares and their sums stay far from overflow, and nothing measured is near
RUN = 5  # equal samples in a row at the largest value: a sensor at its end
MOST_OF = 0.5  # of a recording: a stress that stays that long was set, no sensor is at its end so long
END = "the sensor was at its end"
GAP = 20.0  # times the usual step
FILTERED = 2.0  # noise seen eight samples apart over noise seen between neighbours
LONG = 100  # samples from which the noise can be looked at


def slips(sample: Sample, names: Iterable[str] | None = None) -> list[str]:
    """Sentences on what looks like a slip, recording by recording.

    Args:
        sample: the sample.
        names: recordings to look at; all by default.
    """
    said = []
    for name in sample.recordings if names is None else names:
        recording = sample.recordings[name]
        for check in (_stretch, _stress, _sense, _dead, _saturated, _few, _uneven, _filtered, _history):
            said += [f"{name}: {sentence}" for sentence in check(recording)]
    return said


def refuse_unusable(sample: Sample, names: Iterable[str]) -> None:
    """Refuse recordings that a fit can learn nothing from.

    Raises:
        InputError: fewer than three samples, values beyond 1e20, a channel that reads zero throughout, one that never
            changes while nothing is done either, or a noise level of zero beside recordings with noise.
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
            drive = _drive(recording)
            if drive is not None and len(seen) and np.ptp(seen) == 0 and np.ptp(drive) == 0:
                raise InputError(
                    f"recording {name}: neither the deformation nor {key} ever changes: there is nothing to fit; "
                    "check the columns that were read"
                )
    stds = {n: c.noise_std for n in names for k, c in sample.recordings[n].channels.items() if k != "markers"}
    zero = [n for n, s in stds.items() if s == 0]
    if zero and any(s for s in stds.values()):
        raise InputError(
            f"recording {zero[0]}: noise_std is 0 while other recordings have noise: it would weigh infinitely; give "
            "its noise level, leave it out of the file, or fit with --weights uniform"
        )


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


def _drive(recording: Recording) -> Float[np.ndarray, " n"] | None:
    """Stretch minus one, or shear, of a material test (the first axis of two); None for others."""
    for key, rest in (("stretch", 1.0), ("shear", 0.0)):
        if key in recording.inputs:
            values = np.asarray(recording.inputs[key], float)
            return values.reshape(len(values), -1)[:, 0] - rest
    return None


def _load(recording: Recording) -> Float[np.ndarray, " n"] | None:
    channel = recording.channels.get("nominal_stress")
    if channel is None:
        return None
    values = np.asarray(channel.values, float)
    return values.reshape(len(values), -1)[:, 0]


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
    load = _load(recording)
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
    drive, load = _drive(recording), _load(recording)
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


def _dead(recording: Recording) -> list[str]:
    said = []
    for key, channel in recording.channels.items():
        values = np.asarray(channel.values, float)
        seen = values[np.isfinite(values)]
        if key == "markers" or len(seen) < 2:
            continue
        if not seen.any():
            said.append(f"{key} is zero throughout: a dead sensor or the wrong column")
        elif np.ptp(seen) == 0:
            said.append(
                f"{key} reads {seen[0]:.4g} throughout: a stuck sensor, or a set value instead of a measured one"
            )
    every = np.asarray(recording.inputs.get("stretch", recording.inputs.get("shear", np.zeros(0))), float)
    if len(every) > 1 and not np.ptp(every, axis=0).any():
        said.append("the deformation never changes: a hold whose beginning is missing, or a dead column")
    return said


def _saturated(recording: Recording) -> list[str]:
    drive, load = _drive(recording), _load(recording)
    if drive is None or load is None:
        return []
    seen = np.isfinite(load)
    drive, load = drive[seen], load[seen]
    if len(load) < 4 * RUN or not np.ptp(load) or not np.ptp(drive):
        return []
    for value, word in ((load.max(), "largest"), (load.min(), "smallest")):
        at = np.concatenate([[0], (load == value).astype(int), [0]])
        edges = np.diff(at)
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
        longest = int(np.argmax(ends - begins))
        a, b = begins[longest], ends[longest]
        if value != 0 and b - a >= RUN and np.ptp(drive[a:b]) > 0.01 * np.ptp(drive):
            return [
                f"stress stays at exactly {value:.4g} Pa, its {word} value, over {b - a} samples while the specimen "
                f"moves: {'a creep test, whose stress is what was set' if b - a > MOST_OF * len(load) else END}"
            ]
    return []


def _few(recording: Recording) -> list[str]:
    least = min((len(np.asarray(c.values)) for c in recording.channels.values()), default=0)
    return [f"{least} samples only: too few to tell a model from noise"] if least < FEW else []


def _uneven(recording: Recording) -> list[str]:
    for key, channel in recording.channels.items():
        steps = np.diff(np.asarray(channel.time, float))
        if len(steps) < FEW:
            continue
        usual, most = float(np.median(steps)), float(steps.max())
        if most > GAP * usual:
            at = float(np.asarray(channel.time)[int(np.argmax(steps))])
            return [
                f"{key} has a gap of {most:.4g} s after {at:.4g} s, where the usual step is {usual:.3g} s: whatever "
                "the tissue remembers of it is not in the recording"
            ]
    return []


def _filtered(recording: Recording) -> list[str]:
    load = _load(recording)
    if load is None or len(load) < LONG or not np.ptp(load):
        return []
    near, middle, far = (_noise(load, stride) for stride in (1, 3, 8))
    # Curvature makes it grow with the fourth power of the stride, filtered noise only until the filter's length.
    noise_like = middle > 1.3 * near and far < 5 * middle
    if near > 0 and noise_like and far > FILTERED * near and far > 1e-5 * np.ptp(load):
        return [
            f"neighbouring samples differ {far / near:.1f} times less than samples eight apart: the signal was "
            "smoothed or filtered, so a noise level estimated from neighbours is too small; give [noise]"
        ]
    return []


def _noise(values: Float[np.ndarray, " n"], stride: int) -> float:
    """Noise from fourth differences `stride` samples apart: blind to any cubic, robust against kinks by the median.

    Fourth differences of white noise have the variance 70 s^2 (1 + 16 + 36 + 16 + 1); 1.4826 turns a median absolute
    value into a standard deviation.
    """
    v = values
    differences = (
        v[: -4 * stride]
        - 4 * v[stride : -3 * stride]
        + 6 * v[2 * stride : -2 * stride]
        - 4 * v[3 * stride : -stride]
        + v[4 * stride :]
    )
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(70.0))


def _history(recording: Recording) -> list[str]:
    load = _load(recording)
    drive = _drive(recording)
    if load is None or len(load) < FEW or not np.ptp(load):
        return []
    if drive is None or abs(drive[0]) > 0.05 * np.abs(drive).max():  # said already: not at rest
        return []
    noise = recording.channels["nominal_stress"].noise_std or 0.0
    share = abs(load[0]) / np.abs(load).max()
    if share > 0.05 and abs(load[0]) > 5 * noise:
        return [
            f"starts at {share:.0%} of its largest stress, not at zero: a preload, an offset of the cell, or loading "
            "before the recording that the model doesn't know of"
        ]
    return []
