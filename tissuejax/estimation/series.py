"""Recordings as one long vector: every component of every channel is a segment of it.

A fit's residuals and a diagnosis' bench are cut in the same way, so that a sample has one place in both and chi-square
is one number.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import ArrayLike, Bool, Float, Int

from tissuejax.recordings.recording import Recording, Sample

FINEST = 0.1  # share of the samples, those closest together, that tell of the shortest times


@dataclass(frozen=True)
class Segment:
    """One scalar series: a component of a channel of a recording.

    Attributes:
        recording, channel, component: where it belongs; component is "" for a scalar channel.
        rows: its place in the long vector.
        time: s.
        unit: SI unit of the values.
        drive: what was done at these times (stretch, shear, or depth in m), to locate by.
        drive_name, drive_unit: what the drive is called.
        timed: whether time was recorded; else it counts samples.
    """

    recording: str
    channel: str
    component: str
    rows: slice
    time: Float[np.ndarray, " n"]
    unit: str
    drive: Float[np.ndarray, " n"]
    drive_name: str = "stretch"
    drive_unit: str = "1"
    timed: bool = True

    @property
    def label(self) -> str:
        """Channel and component in words."""
        return f"{self.channel} {self.component}".strip()


Driven = tuple[Float[np.ndarray, " n"], str, str]  # drive, its name and unit


def stretched(recording: Recording, channel: str, component: int) -> Driven:
    """The drive of a material test: its stretch along the component's own axis, or its shear; else the time."""
    for kind in ("shear", "stretch"):
        if kind in recording.inputs:
            drive = np.asarray(recording.inputs[kind], float).reshape(len(recording.inputs[kind]), -1)
            return drive[:, min(component, drive.shape[1] - 1)], kind, "1"
    return np.asarray(recording.channels[channel].time, float), "time", "s"


def by_axis(channel: str, width: int, component: int) -> str:
    """A component's name: nothing for a scalar channel, else "axis 1", "axis 2", ..."""
    return f"axis {component + 1}" if width > 1 else ""


def finest(times: Iterable[Float[np.ndarray, " _"]]) -> float:
    """The steps, in s, between the samples of the most finely sampled series: nothing quicker is seen.

    Where sampling is uneven that of its finest tenth counts: a ramp may be sampled a hundred times as often as a hold.
    """
    steps = [float(np.quantile(np.diff(t), FINEST)) for t in times if len(t) > 1 and t[-1] > t[0]]
    return min(steps, default=0.0)


@dataclass(frozen=True, eq=False)
class Series:
    """The long vector of some channels of a sample, component after component.

    Attributes:
        segments: in order.
        y: measured values.
        places: of each segment, where its samples lie in the channel's array, flat.
    """

    segments: tuple[Segment, ...]
    y: Float[np.ndarray, " N"]
    places: tuple[Int[np.ndarray, " _"], ...]

    @classmethod
    def of(
        cls,
        sample: Sample,
        channels: Mapping[str, Sequence[str]],
        driven: Callable[[str, str, int], Driven] | None = None,
        named: Callable[[str, int, int], str] = by_axis,
        taking: Callable[[str, str], Bool[np.ndarray, " n"]] | None = None,
        fewest: int = 1,
        lost: bool = False,
    ) -> "Series":
        """The series of `channels`, by recording.

        Args:
            driven: what was done at all times of a recording's channel, for one of its components; `stretched` by
                default.
            named: the name of a channel's component, of how many.
            taking: which samples of a recording's channel take part; all by default.
            fewest: samples of a segment worth having.
            lost: keep lost samples (NaN); they are left out by default.
        """
        segments, y, places, at = [], [], [], 0
        for name, wanted in channels.items():
            recording = sample.recordings[name]
            for channel in wanted:
                seen = recording.channels[channel]
                time = np.asarray(seen.time, float)
                flat = np.asarray(seen.values, float).reshape(len(time), -1)
                width = flat.shape[1]
                some = np.ones(len(time), bool) if taking is None else taking(name, channel)
                for j in range(width):
                    kept = np.flatnonzero(some & (lost | np.isfinite(flat[:, j])))
                    if len(kept) < fewest:
                        continue
                    done = stretched(recording, channel, j) if driven is None else driven(name, channel, j)
                    drive, what, unit = done
                    rows, at = slice(at, at + len(kept)), at + len(kept)
                    called = named(channel, width, j)
                    told = drive[kept], what, unit, sample.timed
                    segments.append(Segment(name, channel, called, rows, time[kept], seen.unit, *told))
                    y.append(flat[kept, j])
                    places.append(kept * width + j)
        return cls(tuple(segments), np.concatenate(y) if y else np.zeros(0), tuple(places))

    def stacked(self, values: Callable[[str, str], ArrayLike]) -> Float[np.ndarray, " N"]:
        """The long vector of what `values` gives as a whole array for a recording's channel."""
        out, whole = np.empty(len(self.y)), {}
        for s, place in zip(self.segments, self.places, strict=True):
            key = s.recording, s.channel
            if key not in whole:
                whole[key] = np.asarray(values(*key), float).ravel()
            out[s.rows] = whole[key][place]
        return out

    def predicted(self, recordings: Mapping[str, Recording]) -> Float[np.ndarray, " N"]:
        """The long vector of predicted recordings."""
        return self.stacked(lambda recording, channel: recordings[recording].channels[channel].values)

    def rows(self) -> dict[tuple[str, str], slice]:
        """Where each (recording, channel) lies."""
        found: dict[tuple[str, str], slice] = {}
        for s in self.segments:
            key = s.recording, s.channel
            found[key] = slice(found[key].start if key in found else s.rows.start, s.rows.stop)
        return found
