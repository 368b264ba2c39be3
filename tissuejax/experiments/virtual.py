"""Recordings that nobody made: a rig or probe path written down, to be filled with a prediction."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.experiments.homogeneous import material_test_kind
from tissuejax.recordings.recording import Channel, Recording

MOST = 10**7  # samples: beyond, one recording fills a memory


def corners(text: str, rate: float) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n ..."]]:
    """Time and drive through the corners "0:1 10:1.3 40:1.3", s and stretch (or shear), sampled at `rate` Hz.

    Several driven directions are written with a comma: "0:1,1 10:1.2,1.1".

    Raises:
        InputError: not of that form, times that don't increase, fewer than two corners.
    """
    try:
        pairs = [part.split(":") for part in text.split()]
        time = np.array([float(t) for t, _ in pairs])
        drive = np.array([[float(v) for v in values.split(",")] for _, values in pairs])
    except ValueError:
        raise InputError(f'path "{text}": wanted are corners TIME:VALUE, such as "0:1 10:1.3 40:1.3"') from None
    if len(time) < 2 or not (np.diff(time) > 0).all():
        raise InputError(f'path "{text}": wanted are two corners or more, at increasing times')
    if np.ptp(time) * rate > MOST:
        raise InputError(
            f'path "{text}" at {rate:g} Hz: {np.ptp(time) * rate:.3g} samples, at most {MOST:.0e}; lower --rate'
        )
    fine = np.linspace(time[0], time[-1], max(2, int(round(np.ptp(time) * rate)) + 1))
    each = np.stack([np.interp(fine, time, column) for column in drive.T], axis=-1)
    return fine, each[:, 0] if each.shape[1] == 1 else each


def material_test(name: str, kind: str, time: np.ndarray, drive: np.ndarray, **attributes) -> Recording:
    """A material test without a measurement.

    Raises:
        InputError: an unknown kind, or a drive that is none of it.
    """
    test = material_test_kind(kind)
    empty = {"nominal_stress": Channel(time, np.zeros(np.shape(drive)), "Pa")}
    made = Recording(name, kind, {"time": time, test.driven: drive}, empty, attributes)
    test.test(made)
    return made


def probing(
    name: str, time: np.ndarray, path: Float[np.ndarray, "n 3"], radius: float, markers: np.ndarray | None = None
) -> Recording:
    """A probing along `path` (centre of the tip, m), not measured; `markers` (k, 3) are places on the surface."""
    channels = {"force": Channel(time, np.zeros((len(time), 3)), "N")}
    if markers is not None:
        channels["markers"] = Channel(time, np.tile(markers, (len(time), 1, 1)), "m")
    return Recording(
        name, "probing", {"probe/time": time, "probe/position": path}, channels, {"probe/radius": float(radius)}
    )


def as_measured(predicted: Mapping[str, Recording], noise: float | None = None, seed: int = 0) -> dict[str, Recording]:
    """Predictions as recordings: with noise added and its level stated, or exact and without a level.

    Args:
        predicted: by name.
        noise: standard deviation to add, SI; None or 0 adds nothing.
        seed: of the noise.
    """
    rng, found = np.random.default_rng(seed), {}
    for name, recording in predicted.items():
        channels = {}
        for key, channel in recording.channels.items():
            values = np.asarray(channel.values, float)
            if noise:
                values = values + rng.normal(0.0, noise, values.shape)
            channels[key] = Channel(channel.time, values, channel.unit, noise or None)
        found[name] = Recording(name, recording.experiment, recording.inputs, channels, recording.attributes)
    return found
