"""Measured and predicted channels cut into plain curves, the common food of the plots of a fit."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.fitting.result import Fit
from tissuejax.recordings.recording import Channel, Recording

AXES = {"force": "xyz", "nominal_stress": "12"}
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


def curves_of(recording: Recording, prediction: Recording | None = None, std=None, held: bool = False) -> list[Curve]:
    """All scalar series of a recording; marker clouds (three axes) as the mean distance from their first position."""
    found = []
    for name, channel in recording.channels.items():
        other = prediction.channels.get(name) if prediction is not None else None
        measured = np.asarray(channel.values, float)
        predicted = None if other is None else np.asarray(other.values, float)
        level = (std or {}).get(f"{recording.name}/{name}", channel.noise_std)
        drive_name, drive = _drive(recording, channel)
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
                    _pick(measured, k, measured),
                    None if predicted is None else _pick(predicted, k, measured),
                    channel.unit,
                    level,
                    held,
                )
            )
    return found


def curves(found: Fit) -> list[Curve]:
    """All series of a fit: fitted recordings first, held-out ones after."""
    measured, std = found.problem.predictor.sample.recordings, found.problem.noise.std
    inside = found.problem.predictor.names
    held = [name for name in found.predictions if name not in inside]
    return [
        curve
        for name in (*inside, *held)
        for curve in curves_of(measured[name], found.predictions[name], std, name in held)
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
        axes = AXES.get(name, "0123456789")
        return [(k, f"{name} {axes[k] if k < len(axes) else k}") for k in range(values.shape[1])]
    return [(0, f"{name} (mean displacement)" if values.ndim == 3 else name)]


def _pick(values: np.ndarray, k: int, reference: np.ndarray) -> np.ndarray:
    if values.ndim == 2:
        return values[:, k]
    if values.ndim == 3:
        start = np.array(
            [
                column[np.isfinite(column)][0] if np.isfinite(column).any() else 0.0
                for column in reference.reshape(len(reference), -1).T
            ]
        ).reshape(reference.shape[1:])
        lost = ~np.isfinite(reference).all(-1)
        moved = np.where(lost, np.nan, np.linalg.norm(values - start, axis=-1))
        counts = np.maximum((~lost).sum(1), 1)
        return np.where(lost.all(1), np.nan, np.nansum(moved, 1) / counts)
    return values
