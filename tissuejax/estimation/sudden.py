"""What happens at once: a grip that slips, an amplifier that is switched, a recorder that skips.

A part of low rank for `Discrepancy`, where everything else that it holds is smooth: from a time in one recording on a
step of the stress, a change of gain and a clock that jumps. When it begins is scanned, each time as likely as another.
(A sensor at its limit is no such part: it makes the stress a function of the strain, which another law is too.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.estimation.smoothness import USUAL, Smoothness


@dataclass(frozen=True)
class Moment:
    """A time from which on a recording may be another one.

    Attributes:
        name: for the reader.
        rows: on which it acts.
    """

    name: str
    rows: Bool[np.ndarray, " N"]

    def factor(self, prediction: Float[np.ndarray, " N"], series: "Timed") -> Float[np.ndarray, "N r"]:
        """What it adds beside this prediction, Pa, for an amplitude of one; a column for each thing it may do."""
        peak = float(np.max(np.abs(prediction[series.same(self.rows)])))
        steps = [peak * (self.rows & (series.owner == k)) for k in np.unique(series.owner[self.rows])]
        late = series.smooth.clock * series.rate(prediction)
        return np.stack([*steps, self.rows * prediction, self.rows * late], axis=1)


@dataclass(frozen=True)
class Timed:
    """When and in which series and recording each row was measured.

    Attributes:
        time: s; owner: index of the series; recording: of the recording.
        smooth: by how much a clock jumps, and which moments are scanned.
    """

    time: Float[np.ndarray, " N"]
    owner: np.ndarray
    recording: np.ndarray
    smooth: Smoothness = USUAL

    def same(self, rows: Bool[np.ndarray, " N"]) -> Bool[np.ndarray, " N"]:
        """All rows of the recordings that `rows` belong to."""
        return np.isin(self.recording, np.unique(self.recording[rows]))

    def rate(self, y: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Change of y in the time of a recording, at its present pace; nothing where time stands still."""
        out = np.zeros(len(y))
        for k in np.unique(self.owner):
            own = self.owner == k
            time = self.time[own]
            if len(time) > 2 and np.all(np.diff(time) > 0):
                out[own] = np.gradient(y[own], time) * np.ptp(time)
        return out

    def moments(self, names: Sequence[str]) -> list[Moment]:
        """All that are scanned.

        Args:
            names: of the recordings, in order.
        """
        found = []
        for r, name in enumerate(names):
            own = self.recording == r
            times = np.unique(self.time[own])[self.smooth.edge : -self.smooth.edge]
            for t in times[:: max(len(times) // self.smooth.moments, 1)]:
                found.append(Moment(f"at once in {name} at {t:.4g} s", own & (self.time >= t)))
        return found
