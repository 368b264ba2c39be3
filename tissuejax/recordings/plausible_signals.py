"""What a sensor can do wrong, seen in its samples: dead, stuck, at its end, too coarse, filtered, unevenly sampled."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from tissuejax.recordings.recording import Recording

RUN = 5  # equal samples in a row at the largest value: a sensor at its end
STUCK, MOVED = 20, 0.1  # equal samples in a row anywhere, and the share of the deformation passed meanwhile
SLOWER = 0.5  # of a creep: what its second half moves over what its first does
GAP = 20.0  # times the usual step
UNEVEN = 3.0  # steps that only a twentieth exceed, over steps that only a twentieth undercut
FILTERED = 2.0  # noise seen where it no longer grows over noise seen between neighbours
PLATEAU = 2.0  # growth of noise from a stride to twice it; any smooth curve's is 16
STRIDES = (1, 2, 4, 8, 16, 32)
SEEN = (1e-5, 0.02)  # of the range of the stress: what may be noise
LONG, MANY = 100, 50  # samples from which noise, and single samples, can be looked at
COARSE = 0.01  # of the range: a step of the sensor that matters
SPIKE, BESIDE = 0.2, 0.05  # of the range: a sample beyond both its neighbours, which are that near each other


def deformation_of(recording: Recording) -> tuple[str, float, Float[np.ndarray, "n axes"]] | None:
    """What a material test was driven by, its value at rest, and its values by axis; None for others."""
    for key, rest in (("stretch", 1.0), ("shear", 0.0)):
        if key in recording.inputs:
            values = np.asarray(recording.inputs[key], float)
            return key, rest, values.reshape(len(values), -1)
    return None


def drive_of(recording: Recording) -> Float[np.ndarray, " n"] | None:
    """Stretch minus one, or shear, of a material test (the first axis of two); None for others."""
    if (driven := deformation_of(recording)) is None:
        return None
    _, rest, values = driven
    return values[:, 0] - rest


def load_of(recording: Recording) -> Float[np.ndarray, " n"] | None:
    """Stress of a material test (the first axis of two), Pa; None for others."""
    channel = recording.channels.get("nominal_stress")
    if channel is None:
        return None
    values = np.asarray(channel.values, float)
    return values.reshape(len(values), -1)[:, 0]


def pair_of(recording: Recording) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]] | None:
    """Deformation and stress where both are known and the deformation changes; None otherwise."""
    drive, load = drive_of(recording), load_of(recording)
    if drive is None or load is None:
        return None
    seen = np.isfinite(load)
    drive, load = drive[seen], load[seen]
    return (drive, load) if len(load) and np.ptp(drive) else None


def unanswered(recording: Recording) -> str:
    """Why a stress does not answer the deformation at all: constant or noise, and no creep; "" where it does."""
    pair = pair_of(recording)
    if pair is None or len(pair[1]) < STUCK or np.ptp(pair[0]) < 5e-3:
        return ""
    drive, load = pair
    if not np.ptp(load):
        return "" if _creeps(drive) else f"reads {load[0]:.4g} Pa throughout while the specimen moves"
    noise, std = noise_seen(load, 1), float(np.std(load))
    apart = load - load.mean()
    alike = abs(float(apart[1:] @ apart[:-1]) / float(apart @ apart)) * np.sqrt(len(load)) < 3
    if len(load) >= MANY and alike and 0.7 < noise / std < 1.4 and abs(np.corrcoef(drive, load)[0, 1]) < 0.3:
        return f"is noise of {std:.3g} Pa about {load.mean():.3g} Pa and does not follow the deformation"
    return ""


def dead(recording: Recording) -> list[str]:
    """Channels that read one value, a stress that is noise alone, a deformation that never changes."""
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
    why = unanswered(recording)
    if why and not said:
        said.append(f"nominal_stress {why}: a dead sensor or the wrong column")
    every = np.asarray(recording.inputs.get("stretch", recording.inputs.get("shear", np.zeros(0))), float)
    if len(every) > 1 and not np.ptp(every, axis=0).any():
        said.append("the deformation never changes: a hold whose beginning is missing, or a dead column")
    return said


def saturated(recording: Recording) -> list[str]:
    """A stress that stays at its largest or smallest value, or at any other, while the specimen moves."""
    pair = pair_of(recording)
    if pair is None or len(pair[1]) < 4 * RUN or not np.ptp(pair[1]):
        return []
    drive, load = pair
    for value, word in ((load.max(), "largest"), (load.min(), "smallest")):
        a, b = max(_runs(load == value), key=lambda r: r[1] - r[0])
        if value != 0 and b - a >= RUN and np.ptp(drive[a:b]) > 0.01 * np.ptp(drive):
            why = "a creep test, whose stress is what was set" if _creeps(drive[a:b]) else "the sensor was at its end"
            return [
                f"stress stays at exactly {value:.4g} Pa, its {word} value, over {b - a} samples while the specimen "
                f"moves: {why}"
            ]
    if _step(load) > COARSE * np.ptp(load):
        return []  # a coarse sensor stays where it is for long
    same = np.concatenate([[False], np.diff(load) == 0])
    for a, b in _runs(same):
        a = max(a - 1, 0)
        if b - a < STUCK or np.ptp(drive[a:b]) < MOVED * np.ptp(drive) or (load[a] == 0 and not load[:a].any()):
            continue
        why = "a cable off, or a specimen that had broken" if load[a] == 0 else "the sensor was stuck"
        return [
            f"stress stays at exactly {load[a]:.4g} Pa over {b - a} samples, from sample {a + 1} on, while the "
            f"specimen moves: {why}; leave that part out (upto, where)"
        ]
    return []


def coarse(recording: Recording) -> list[str]:
    """A stress that comes in steps."""
    load = load_of(recording)
    if load is None or len(load) < MANY or not np.ptp(load):
        return []
    step = _step(load)
    if step < COARSE * np.ptp(load) or np.mean(np.diff(load[np.isfinite(load)]) == 0) < 0.3:
        return []
    return [
        f"stress comes in steps of {step:.3g} Pa, {step / np.ptp(load):.0%} of its range: the resolution of the "
        f"sensor is part of the noise (at least {step / np.sqrt(12):.2g} Pa)"
    ]


def spiked(recording: Recording) -> list[str]:
    """Single samples far beyond both their neighbours."""
    load = load_of(recording)
    if load is None or len(load) < MANY or not np.ptp(load[np.isfinite(load)]):
        return []
    reach = np.ptp(load[np.isfinite(load)])
    up, down = load[1:-1] - load[:-2], load[1:-1] - load[2:]
    lone = (up * down > 0) & (np.minimum(np.abs(up), np.abs(down)) > SPIKE * reach)
    at = np.flatnonzero(lone & (np.abs(load[2:] - load[:-2]) < BESIDE * reach)) + 1
    if not 0 < len(at) <= 5:
        return []
    who = "one sample stands" if len(at) == 1 else f"{len(at)} single samples stand"
    return [
        f"{who} far beyond both neighbours (sample {at[0] + 1}, {load[at[0]]:.4g} Pa): a spike pulls a fit; leave it "
        "out (where), or fit with --loss soft-l1"
    ]


def uneven(recording: Recording) -> list[str]:
    """Gaps in time, and steps of very different length."""
    for key, channel in recording.channels.items():
        steps = np.diff(np.asarray(channel.time, float))
        if len(steps) < RUN * 2:
            continue
        usual, most = float(np.median(steps)), float(steps.max())
        if most > GAP * usual:
            at = float(np.asarray(channel.time)[int(np.argmax(steps))])
            return [
                f"{key} has a gap of {most:.4g} s after {at:.4g} s, where the usual step is {usual:.3g} s: whatever "
                "the tissue remembers of it is not in the recording"
            ]
        if not evenly(recording, key):
            short, long = np.quantile(steps, (0.05, 0.95))
            return [
                f"{key} is sampled unevenly, {short:.3g} to {long:.3g} s apart: densely sampled parts weigh more in a "
                "fit, and noise can't be told from neighbours"
            ]
    return []


def evenly(recording: Recording, key: str = "nominal_stress") -> bool:
    """Whether the steps of a channel are of like length."""
    steps = np.diff(np.asarray(recording.channels[key].time, float))
    short, long = np.quantile(steps, (0.05, 0.95)) if len(steps) else (1.0, 1.0)
    return bool(long < UNEVEN * short)


def filtered(recording: Recording) -> list[str]:
    """Noise that neighbouring samples share, where it was not recorded."""
    load = load_of(recording)
    if load is not None and recording.channels["nominal_stress"].noise_std:
        return []
    if load is None or len(load) < LONG or not np.ptp(load) or not evenly(recording):
        return []
    strides = [k for k in STRIDES if 8 * k < len(load)]
    seen = [noise_seen(load, k) for k in strides]
    near, reach = seen[0], float(np.ptp(load))
    if near < 1e-12 * reach:  # a sensor in steps, or no noise at all
        return []
    # Curvature makes it grow with the fourth power of the stride, filtered noise only until the filter's length.
    for k, here, after in zip(strides, seen, seen[1:]):
        if here > FILTERED * near and after < PLATEAU * here and SEEN[0] * reach < here < SEEN[1] * reach:
            return [
                f"neighbouring samples differ {here / near:.3g} times less than samples {k} apart: the signal was "
                "smoothed or filtered, so its noise can't be read off neighbours; give [noise] if it is known"
            ]
    return []


def noise_seen(values: Float[np.ndarray, " n"], stride: int) -> float:
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


def _creeps(drive: Float[np.ndarray, " n"]) -> bool:
    """Whether a deformation goes one way and ever slower, as under a load that was set."""
    half = len(drive) // 2
    first, second = drive[half] - drive[0], drive[-1] - drive[half]
    back = np.diff(drive) * np.sign(drive[-1] - drive[0])
    one_way = -back[back < 0].sum() < 0.1 * abs(drive[-1] - drive[0])
    return bool(one_way and abs(second) < SLOWER * abs(first))


def _runs(same: np.ndarray) -> Iterator[tuple[int, int]]:
    """First and one past the last place of each run of true."""
    edges = np.diff(np.concatenate([[0], same.astype(int), [0]]))
    yield from zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True)


def _step(load: Float[np.ndarray, " n"]) -> float:
    """The least difference between two values that occur."""
    values = np.unique(load[np.isfinite(load)])
    return float(np.min(np.diff(values))) if len(values) > 1 else 0.0
