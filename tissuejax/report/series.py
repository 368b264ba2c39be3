"""Measured and predicted channels cut into plain curves, the common food of the plots of a fit."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.fitting.result import Fit
from tissuejax.recordings.marker_motion import along, ways
from tissuejax.recordings.recording import Channel, Recording
from tissuejax.report.scales import display, label

AXES_OF = {"force": "xyz", "nominal_stress": "12"}
DRIVES = ("stretch", "shear")
MARKERS = "marker displacement, mean"  # the series that a cloud of markers is shown as


@dataclass(frozen=True)
class Curve:
    """One scalar series over time, measured and (if there is a fit) predicted.

    Attributes:
        recording, channel: where it belongs, with the component in the channel's label.
        time: s.
        drive: stretch or shear at these times, of a probing the depth (or the travel down) in m, or None.
        drive_name, drive_unit: its name and SI unit.
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
    drive_unit: str = "1"

    def axis(self, by_time: bool) -> tuple[Float[np.ndarray, " n"], str]:
        """What it is drawn over, in readable units, and the words for that axis."""
        if by_time:
            return self.time, "time (s)" if self.timed else "sample"
        factor, unit = display(self.drive_unit, float(np.nanmax(np.abs(self.drive), initial=0.0)))
        return self.drive / factor, f"{self.drive_name}{label(unit)}"

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
    recording: Recording,
    prediction: Recording | None = None,
    std=None,
    held: bool = False,
    timed: bool = True,
    touch: float | None = None,
) -> list[Curve]:
    """All scalar series of a recording; clouds of markers as their mean displacement, each along its own way.

    Args:
        recording, prediction: what was measured and, of a fit, predicted.
        std: noise by "recording/channel", before what the recording says.
        held, timed: see `Curve`.
        touch: of a probing, when the undeformed surface is met, s: depth counts from there.
    """
    found = []
    for name, channel in recording.channels.items():
        other = prediction.channels.get(name) if prediction is not None else None
        measured = np.asarray(channel.values, float)
        predicted = None if other is None else np.asarray(other.values, float)
        level = (std or {}).get(f"{recording.name}/{name}", channel.noise_std)
        drive_name, drive, drive_unit = _drive(recording, channel, touch)
        if measured.ndim == 3:
            level = None if level is None else level / np.sqrt(measured.shape[1])
            measured, predicted = displacements(measured, predicted)
        for k, shown in components(name, np.asarray(channel.values)):
            own = drive[:, k] if drive is not None and drive.ndim == 2 and measured.ndim == 2 else drive
            own = None if own is None or own.ndim != 1 else own
            found.append(
                Curve(
                    recording.name,
                    shown,
                    np.asarray(channel.time, float),
                    own,
                    drive_name,
                    measured if measured.ndim == 1 else measured[:, k],
                    predicted if predicted is None or predicted.ndim == 1 else predicted[:, k],
                    channel.unit,
                    level,
                    held,
                    timed,
                    drive_unit,
                )
            )
    return found


def curves(found: Fit) -> list[Curve]:
    """All series of a fit: fitted recordings first, held-out ones after."""
    sample, std = found.problem.predictor.sample, found.problem.noise.std
    measured = sample.recordings
    inside = found.problem.predictor.names
    held = [name for name in found.predictions if name not in inside]
    setups = getattr(found.problem.predictor, "setups", {})
    touch = {name: float(setup.test.first_touch) for name, setup in setups.items()}
    return [
        curve
        for name in (*inside, *held)
        for curve in curves_of(
            measured[name], found.predictions[name], std, name in held, sample.timed, touch.get(name)
        )
    ]


def _drive(recording: Recording, channel: Channel, touch: float | None) -> tuple[str, np.ndarray | None, str]:
    """What was done at a channel's times: name, values, SI unit."""
    for name in DRIVES:
        drive = recording.inputs.get(name)
        if drive is not None and len(drive) == len(channel.time):
            return name, np.asarray(drive, float), "1"
    if "probe/position" not in recording.inputs:
        return "", None, "1"
    time, height = (np.asarray(recording.inputs[f"probe/{k}"], float) for k in ("time", "position"))
    down = -np.interp(np.asarray(channel.time, float), time, height[:, 2])
    if touch is None or not np.isfinite(touch):
        return "travel of the probe downwards", down + height[0, 2], "m"
    return "depth", down + np.interp(touch, time, height[:, 2]), "m"


def components(name: str, values: np.ndarray) -> list[tuple[int, str]]:
    """(column, label) of each scalar series of a channel; a cloud of markers is one."""
    if values.ndim == 2:
        axes = AXES_OF.get(name, "0123456789")
        return [(k, f"{name} {axes[k] if k < len(axes) else k}") for k in range(values.shape[1])]
    return [(0, MARKERS if values.ndim == 3 else name)]


def displacements(
    measured: Float[np.ndarray, "n m 3"], predicted: Float[np.ndarray, "n m 3"] | None
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"] | None]:
    """Mean over the markers of how far each has gone along its own way (`recordings.marker_motion`).

    The way is the prediction's where there is one; each series starts from its own rest.
    """
    way = ways(measured if predicted is None else predicted)
    modelled = None if predicted is None else np.nanmean(along(predicted, way), axis=1)
    return over_seen(along(measured, way), np.nanmean), modelled


def over_seen(moved: Float[np.ndarray, "n m"], reduce: Callable) -> Float[np.ndarray, " n"]:
    """A reduction over the markers seen in each frame (`np.nanmean`, ...); NaN where none was."""
    lost = ~np.isfinite(moved).any(1)
    return np.where(lost, np.nan, reduce(np.where(lost[:, None], 0.0, moved), axis=1))
