"""What happens at once: a grip that slips, an amplifier that is switched, a recorder that skips.

A part of low rank for `Discrepancy`, where everything else that it holds is smooth: from a time in one recording on a
step of the stress, a change of gain, a grip that lets go and a clock that jumps; what has become of a specimen (a tear)
or of a load cell's gain lasts into the recordings that began later. When it begins is scanned, each time as likely as
another.
(A sensor at its limit is no such part: it makes the stress a function of the strain, which another law is too.)
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from tissuejax.estimation.smoothness import USUAL, Smoothness


@dataclass(frozen=True)
class Timed:
    """When and in which series and recording each row was measured.

    Attributes:
        time: s; owner: index of the series; recording: of the recording, in `names`.
        strain: ln stretch or shear, along its own direction.
        start: when the recording of each row began, s on the session's clock; alike where that is not known.
        smooth: by how much a clock jumps, and which moments are scanned.
    """

    time: Float[np.ndarray, " N"]
    owner: np.ndarray
    recording: np.ndarray
    names: tuple[str, ...]
    strain: Float[np.ndarray, " N"]
    start: Float[np.ndarray, " N"]
    smooth: Smoothness = USUAL

    def times(self, recording: int) -> Float[np.ndarray, " n"]:
        """At which something may have happened in a recording, s."""
        return np.unique(self.time[self.recording == recording])[self.smooth.edge : -self.smooth.edge]

    def moments(self, every: int | None = None) -> "list[Moment]":
        """Those that are scanned first, or one in so many times."""
        times = [self.times(r) for r in range(len(self.names))]
        chance = 0.5 / max(sum(map(len, times)), 1)
        return [self._moment(r, t, chance) for r, own in enumerate(times) for t in own[:: every or self._step(own)]]

    def near(self, moment: "Moment") -> "list[Moment]":
        """The times between this one and those that were scanned beside it."""
        times = self.times(moment.recording)
        step, at = self._step(times), int(np.searchsorted(times, moment.time))
        around = times[max(at - step + 1, 0) : at + step]
        return [self._moment(moment.recording, t, moment.chance) for t in around if t != moment.time]

    def _step(self, times: Float[np.ndarray, " n"]) -> int:
        return max(len(times) // self.smooth.moments, 1)

    def _moment(self, recording: int, t: float, chance: float) -> "Moment":
        own = self.recording == recording
        name, later = f"at once in {self.names[recording]} at {t:.4g} s", self.start > np.min(self.start[own])
        return Moment(name, recording, float(t), own & (self.time >= t), later, chance)

    def running(self) -> Iterator[tuple[Bool[np.ndarray, " N"], Float[np.ndarray, " n"]]]:
        """Rows and times of every series in which time goes on."""
        for k in np.unique(self.owner):
            own = self.owner == k
            time = self.time[own]
            if len(time) > 2 and np.all(np.diff(time) > 0):
                yield own, time


@dataclass(frozen=True)
class Disturbed:
    """What may become of a prediction, by row; worked out once for all moments.

    Attributes:
        prediction: Pa.
        timed: when each row was measured.
    """

    prediction: Float[np.ndarray, " N"]
    timed: Timed
    _shifted: dict[float, Float[np.ndarray, " N"]] = field(default_factory=dict, repr=False)

    @cached_property
    def peak(self) -> Float[np.ndarray, " N"]:
        """Largest stress of the row's recording."""
        out = np.zeros(len(self.prediction))
        for r in np.unique(self.timed.recording):
            own = self.timed.recording == r
            out[own] = np.max(np.abs(self.prediction[own]))
        return out

    @cached_property
    def rate(self) -> Float[np.ndarray, " N"]:
        """Change in the time of a recording, at the pace of the moment; nothing where time stands still."""
        out = np.zeros(len(self.prediction))
        for own, time in self.timed.running():
            out[own] = np.gradient(self.prediction[own], time) * np.ptp(time)
        return out

    @cached_property
    def stiffness(self) -> Float[np.ndarray, " N"]:
        """Change over the range of the strain, at the slope of a cubic through its series: what a specimen that is
        stretched less by that range would lack; nothing where the strain stands still."""
        out = np.zeros(len(self.prediction))
        for k in np.unique(self.timed.owner):
            own = self.timed.owner == k
            strain = self.timed.strain[own]
            if (span := float(np.ptp(strain))) > 0:
                x = (strain - np.min(strain)) / span
                degree = min(3, len(np.unique(np.round(x, 2))) - 1)
                out[own] = np.polynomial.Polynomial.fit(x, self.prediction[own], degree).deriv()(x)
        return out

    def shifted(self, by: float) -> Float[np.ndarray, " N"]:
        """The prediction where the clock has jumped by this share of a recording's duration: what follows is shown too
        early and the end lasts, or too late; as it is where time stands still."""
        if by not in self._shifted:
            self._shifted[by] = self._late(self.prediction, by)
        return self._shifted[by]

    def rate_there(self, by: float) -> Float[np.ndarray, " N"]:
        """`rate` where the clock has jumped so."""
        return self._late(self.rate, by) if by else self.rate

    def _late(self, y: Float[np.ndarray, " N"], by: float) -> Float[np.ndarray, " N"]:
        out = np.array(y, float)
        for own, time in self.timed.running():
            out[own] = np.interp(time + by * np.ptp(time), time, y[own])
        return out


@dataclass(frozen=True)
class Moment:
    """A time from which on a recording may be another one.

    Attributes:
        name: for the reader.
        recording: its index; time: s.
        rows: on which it acts.
        later: rows of recordings that began after it.
        chance: probability of this one, if one of all that may be.
        jump: how far its clock jumps, a share of the recording's duration; 0 where it hardly does.
    """

    name: str
    recording: int
    time: float
    rows: Bool[np.ndarray, " N"]
    later: Bool[np.ndarray, " N"]
    chance: float
    jump: float = 0.0

    def factor(self, of: Disturbed) -> Float[np.ndarray, "N r"]:
        """What it adds beside a prediction, Pa, for an amplitude of one; a column for each thing it may do.

        The mean of samples in which it happens may come to lie anywhere.
        """
        clock, columns = of.timed.smooth.clock, []
        for k in np.unique(of.timed.owner[self.rows]):
            own = self.rows & (of.timed.owner == k)
            columns.append(of.peak * own)
            first = int(np.argmax(own))
            if first > 0 and of.timed.owner[first - 1] == k:
                columns.append(of.peak * (np.arange(len(own)) == first - 1))
        columns += [self.rows * of.prediction, self.rows * of.stiffness, clock * self.rows * of.rate_there(self.jump)]
        if self.jump:
            columns.append(clock / self.jump * self.rows * (of.shifted(self.jump) - of.prediction))
        if np.any(self.later):
            columns.append((self.rows | self.later) * of.prediction)
        return np.stack(columns, axis=1)

    def jumping(self, timed: Timed) -> "list[Moment]":
        """The same with a clock that jumps, by every share that is asked; all have as much of a chance as without."""
        jumps, own = timed.smooth.jumps, timed.time[timed.recording == self.recording]
        length, left = float(np.ptp(own)), float(np.max(own)) - self.time
        return [
            replace(self, name=f"{self.name}, clock by {j * length:+.3g} s", jump=j, chance=self.chance / len(jumps))
            for j in jumps
            if j * length < left
        ]
