"""What happens at once: a grip that slips, an amplifier that is switched, a recorder that skips.

A part of low rank for `Discrepancy`, where everything else that it holds is smooth: from a time in one recording on a
step of the stress, a change of gain and a clock that jumps. When it begins is scanned, each time as likely as another.
(A sensor at its limit is no such part: it makes the stress a function of the strain, which another law is too.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

CLOCK = 0.3  # of a recording's duration: by what a clock jumps where the stress would by its peak
EDGE, MOST = 3, 40  # blocks at either end of a recording that show no step; times in a recording at most


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
        late = CLOCK * series.rate(prediction)
        return np.stack([*steps, self.rows * prediction, self.rows * late], axis=1)


@dataclass(frozen=True)
class Timed:
    """When and in which series and recording each row was measured.

    Attributes:
        time: s; owner: index of the series; recording: of the recording.
    """

    time: Float[np.ndarray, " N"]
    owner: np.ndarray
    recording: np.ndarray

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
            times = np.unique(self.time[own])[EDGE:-EDGE]
            for t in times[:: max(len(times) // MOST, 1)]:
                found.append(Moment(f"at once in {name} at {t:.4g} s", own & (self.time >= t)))
        return found
