"""What happens at once: a grip that slips, a recorder that skips, a sensor at its limit.

Two kinds of parts for `Discrepancy`, of low rank, where everything else that it holds is smooth:

| part | from when or where on | what it adds |
|---|---|---|
| moment | a time in one recording | a step of the stress, a change of gain, a clock that jumps |
| limit | a level of the stress in one recording, in its range | what the model predicts beyond it, taken away again |

Where they begin is scanned: each place is as likely as any other.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

CLOCK = 0.3  # of a recording's duration: by what a clock jumps where the stress would by its peak
CLIPPED = 10.0  # of what is beyond a limit, at an amplitude of one: at a tenth of that all of it
EDGE, MOST = 3, 40  # blocks at either end of a recording that show no step; places in a recording at most
LEVELS = (0.7, 1.0, 16)  # of the largest stress of a recording: limits from, to, how many


@dataclass(frozen=True)
class Sudden:
    """One thing that may have happened.

    Attributes:
        name: for the reader.
        rows: on which it acts.
        level: of a limit, Pa; None of a moment.
    """

    name: str
    rows: Bool[np.ndarray, " N"]
    level: float | None = None

    def factor(self, prediction: Float[np.ndarray, " N"], series: "Timed") -> Float[np.ndarray, "N r"]:
        """What it adds beside this prediction, Pa, for an amplitude of one; a column for each thing it may do."""
        if self.level is not None:
            beyond = np.maximum(np.abs(prediction) - self.level, 0.0)
            return -CLIPPED * (self.rows * np.sign(prediction) * beyond)[:, None]
        peak = float(np.max(np.abs(prediction[series.same(self.rows)])))
        own = [peak * (self.rows & (series.owner == k)) for k in np.unique(series.owner[self.rows])]
        late = CLOCK * series.rate(prediction)
        return np.stack([*own, self.rows * prediction, self.rows * late], axis=1)


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
        """Change of y in the time of a recording, at its present pace."""
        out = np.zeros(len(y))
        for k in np.unique(self.owner):
            own = self.owner == k
            time = self.time[own]
            if len(time) > 2 and np.all(np.diff(time) > 0):
                out[own] = np.gradient(y[own], time) * np.ptp(time)
        return out

    def places(self, names: list[str], measured: Float[np.ndarray, " N"]) -> list[Sudden]:
        """Everything that may have happened in each recording: moments, and limits of the sensor.

        Args:
            names: of the recordings, in order.
        """
        found = []
        for r, name in enumerate(names):
            own = self.recording == r
            times = np.unique(self.time[own])[EDGE:-EDGE]
            for t in times[:: max(len(times) // MOST, 1)]:
                found.append(Sudden(f"at once in {name} at {t:.4g} s", own & (self.time >= t)))
            largest = float(np.max(np.abs(measured[own])))
            for level in largest * np.linspace(*LEVELS):
                found.append(Sudden(f"limit in {name} at {level:.4g} Pa", own, float(level)))
        return found
