"""Measured and predicted channels cut into plain curves, the common food of the plots of a fit."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.fitting.result import Fit
from tissuejax.recordings.recording import Channel, Recording

AXES_OF = {"force": "xyz", "nominal_stress": "12"}
DRIVES = ("stretch", "shear")


@dataclass(frozen=True)
class Curve:
    """One scalar series over time, measured and (if there is a fit) predicted.

    Attributes:
        recording, channel: where it belongs, with the component in the channel's label.
        time: s.
        drive: stretch or shear at these times, or None.
        drive_name: its name.
        measured, predicted: in `unit`.
        std: noise in `unit`, or None.
        held: True if the recording took no part in the fit.
        timed: whether time was recorded; else `time` counts samples.
    """

    recording: str
    channel: str
    time: Float[np.ndarray, " n"]
    drive: Float[np.ndarray, " n"] | None
    drive_name: str
    measured: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, " n"] | None
    unit: str
    std: float | None
    held: bool = False
    timed: bool = True

    @property
    def monotone(self) -> bool:
        """Whether the drive only goes one way (up to jitter), so that it can stand for time on an axis."""
        if self.drive is None:
            return False
        steps = np.diff(self.drive)
        back = min(np.abs(steps[steps > 0]).sum(), np.abs(steps[steps < 0]).sum())
        return back < 0.05 * np.abs(steps).sum() and np.abs(steps).sum() > 0

    @property
    def held_still(self) -> bool:
        """Whether the drive rests for a good part of the time, as in a relaxation test."""
        if self.drive is None or len(self.time) < 3:
            return False
        span = np.ptp(self.drive) or 1.0
        still = np.abs(np.diff(self.drive)) < 1e-4 * span
        return float(np.diff(self.time)[still].sum()) > 0.3 * float(np.ptp(self.time))


def curves_of(
    recording: Recording, prediction: Recording | None = None, std=None, held: bool = False, timed: bool = True
) -> list[Curve]:
    """All scalar series of a recording; clouds of markers as their mean displacement, each along its own way."""
    found = []
    for name, channel in recording.channels.items():
        other = prediction.channels.get(name) if prediction is not None else None
        measured = np.asarray(channel.values, float)
        predicted = None if other is None else np.asarray(other.values, float)
        level = (std or {}).get(f"{recording.name}/{name}", channel.noise_std)
        drive_name, drive = _drive(recording, channel)
        if measured.ndim == 3:
            shown, modelled = displacements(measured, predicted)
            level = None if level is None else level / np.sqrt(measured.shape[1])
            time = np.asarray(channel.time, float)
            label = components(name, measured)[0][1]
            found.append(Curve(recording.name, label, time, None, "", shown, modelled, channel.unit, level, held))
            continue
        for k, label in components(name, measured):
            own = drive[:, k] if drive is not None and drive.ndim == 2 and measured.ndim == 2 else drive
            own = None if own is None or own.ndim != 1 else own
            found.append(
                Curve(
                    recording.name,
                    label,
                    np.asarray(channel.time, float),
                    own,
                    drive_name,
                    measured if measured.ndim == 1 else measured[:, k],
                    predicted if predicted is None or predicted.ndim == 1 else predicted[:, k],
                    channel.unit,
                    level,
                    held,
                    timed,
                )
            )
    return found


def curves(found: Fit) -> list[Curve]:
    """All series of a fit: fitted recordings first, held-out ones after."""
    sample, std = found.problem.predictor.sample, found.problem.noise.std
    measured = sample.recordings
    inside = found.problem.predictor.names
    held = [name for name in found.predictions if name not in inside]
    return [
        curve
        for name in (*inside, *held)
        for curve in curves_of(measured[name], found.predictions[name], std, name in held, sample.timed)
    ]


def _drive(recording: Recording, channel: Channel) -> tuple[str, np.ndarray | None]:
    for name in DRIVES:
        drive = recording.inputs.get(name)
        if drive is not None and len(drive) == len(channel.time):
            return name, np.asarray(drive, float)
    return "", None


def components(name: str, values: np.ndarray) -> list[tuple[int, str]]:
    """(column, label) of each scalar series of a channel; a cloud of markers is one."""
    if values.ndim == 2:
        axes = AXES_OF.get(name, "0123456789")
        return [(k, f"{name} {axes[k] if k < len(axes) else k}") for k in range(values.shape[1])]
    return [(0, "marker displacement" if values.ndim == 3 else name)]


def displacements(
    measured: Float[np.ndarray, "n m 3"], predicted: Float[np.ndarray, "n m 3"] | None
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"] | None]:
    """Mean over the markers of how far each has gone along its own way: the direction in which it is farthest out.

    Unlike a mean of distances this is zero, but for noise, while nothing moves. The way is the prediction's where there
    is one; each series starts from its own rest (the measured one from the median of its first frames).
    """
    guide = measured if predicted is None else predicted
    out = guide - _rest(guide)
    far = int(np.argmax(np.nansum(np.linalg.norm(out, axis=-1), axis=1)))
    near = out[max(0, far - 2) : far + 3]
    way = np.nanmean(near, axis=0)
    way = way / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-300)
    modelled = None if predicted is None else np.nanmean(np.einsum("nmi,mi->nm", out, way), axis=1)
    shown = np.einsum("nmi,mi->nm", measured - _rest(measured), way)
    lost = ~np.isfinite(shown).any(1)
    return np.where(lost, np.nan, np.nanmean(np.where(lost[:, None], 0.0, shown), axis=1)), modelled


def _rest(places: np.ndarray) -> np.ndarray:
    """Where each marker was first seen: the median of its first five frames."""
    seen = np.full(places.shape[1:], 0.0)
    for j in range(places.shape[1]):
        known = places[np.isfinite(places[:, j]).all(1), j]
        seen[j] = np.median(known[:5], axis=0) if len(known) else np.nan
    return seen
