"""What is in a sample: every channel of every recording, over what was done."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from tissuejax.recordings.marker_motion import along, ways
from tissuejax.recordings.recording import Recording, Sample
from tissuejax.report.fit_overlay import draw_curve
from tissuejax.report.plot import Plot, grid
from tissuejax.report.series import MARKERS, Curve, curves_of, over_seen

MOST_SHOWN = 18


class Overview(Plot):
    """Measured channels of a sample."""

    name: ClassVar[str] = "overview"
    subject: ClassVar[type] = Sample
    order: ClassVar[int] = 10

    def prepare(self, subject: Sample) -> tuple[list[Curve], int]:
        """The first series, and how many there are in all."""
        every = subject.recordings.values()
        drawn = ((c, r) for r in every for curve in curves_of(r, timed=subject.timed) for c in _plain(curve, r))
        found = [curve for curve, r in drawn if not _nothing(curve, r)]
        return found[:MOST_SHOWN], len(found)

    def caption(self, data: tuple[list[Curve], int]) -> str:
        """How many are shown."""
        shown, total = len(data[0]), data[1]
        return f"{shown} of {total} series." if shown < total else f"All {total} series."

    def draw(self, data: tuple[list[Curve], int]) -> Figure:
        """A panel a series over time, and one over stretch or shear where it rests or turns, so that both are seen."""
        panels = [(c, by_time) for c in data[0] for by_time in _ways(c)]
        figure, axes = grid(len(panels), columns=2 if len(panels) == 2 * len(data[0]) else 3)
        for ax, (curve, by_time) in zip(axes, panels, strict=True):
            draw_curve(ax, curve, by_time)
        return figure


def _plain(curve: Curve, recording: Recording) -> list[Curve]:
    """A series; of a cloud of markers two: how far they go in the median, and the one that goes farthest."""
    if curve.channel != MARKERS:
        return [curve]
    places = next(v for v in (np.asarray(c.values, float) for c in recording.channels.values()) if v.ndim == 3)
    moved = along(places, ways(places))
    farthest = int(np.argmax(np.max(np.nan_to_num(moved), axis=0)))
    return [
        replace(curve, channel="marker displacement,\nmedian", measured=over_seen(moved, np.nanmedian)),
        replace(curve, channel=f"marker displacement,\nlargest (marker {farthest + 1})", measured=moved[:, farthest]),
    ]


def _ways(curve: Curve) -> tuple[bool, ...]:
    """Over what a series is drawn: stretch or travel (False), time (True), or both where neither tells all."""
    if curve.drive is None:
        return (True,)
    return (False, True) if curve.held_still or (curve.timed and not curve.monotone) else (False,)


def _nothing(curve: Curve, recording: Recording) -> bool:
    """Whether a series is a component that was not measured: zero throughout, where another one is not."""
    whole = [c for name, c in recording.channels.items() if curve.channel.startswith(f"{name} ")]
    return bool(whole) and not np.any(curve.measured) and bool(np.any(np.asarray(whole[0].values)))
