"""The descents of a cut's fit: from several starts, the slice made anew between them, kept on disk as they go."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from tissuejax.errors import UnstableSimulation
from tissuejax.estimation.descent import Ended
from tissuejax.estimation.ending import Ending
from tissuejax.estimation.problem import Problem
from tissuejax.experiments.cutting_predictor import CuttingPredictor
from tissuejax.fitting.checkpoint import Checkpoint
from tissuejax.fitting.cut_result import ENERGY, STRENGTH, described
from tissuejax.fitting.least_squares import descend
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.progress import Stage

SLICES = 12
SETTLED, FAR = 1e-3, 1e-2  # relative decrease of the misfit at which a descent ends: the last, the others
SAME = 1.3  # a slice made for a strength serves up to this ratio
# How far strength and energy may go from where a slice was made, in its first round and in later ones: toughness and
# friction first, which mean and slope of the force tell from anywhere, and strength about them. All at once from half
# the values, a descent went to a brittle tissue (strength at its bound, a twentieth of the toughness) and stayed there
FIRST_STARTS, LATER = {STRENGTH: 1.25, ENERGY: 3.0}, {STRENGTH: 2.0, ENERGY: 2.0}


@dataclass(frozen=True)
class End:
    """Where descents from one start ended, with the slice they settled on (or not)."""

    posed: Problem
    ended: Ended
    settled: bool

    @property
    def status(self) -> str:
        """ "converged", or why not."""
        if self.settled:
            return Ending.CONVERGED
        return self.ended.reason if not self.ended.converged else "slice and estimate do not settle"


class Search:
    """Descents from several starts, each reported and kept on disk as it goes."""

    def __init__(self, free: tuple[str, ...], max_steps: int, kept: Checkpoint, stage: Stage):
        self.free, self.max_steps, self.kept, self.stage = free, max_steps, kept, stage
        self.runs, self.note = 0, ""

    def best(self, made: CuttingPredictor, starts: list[dict[str, float]]) -> End:
        """The best end; the next start only where the better one to begin with led to no description of the record.

        Raises:
            UnstableSimulation: no run of any of them comes to its end.
        """
        best, resumed = None, self.kept.values()
        self.kept.keep(resumed)
        if resumed != self.kept.start:
            starts = [resumed]
        elif len(starts) > 1:
            starts = sorted(starts, key=partial(self._misfit, made))
        for n, values in enumerate(starts, start=1):
            self.note = f"from start {n} of {len(starts)}"
            found = self._rounds(made.prepared(values), values)
            if best is None or found.ended.cost < best.ended.cost:
                best = found
            if described(2 * best.ended.cost / found.posed.n_samples, found.posed):
                break
        if best is None or not np.isfinite(best.ended.cost):
            strength = best.posed.values(best.ended.y)[STRENGTH] if best else np.nan
            raise UnstableSimulation(
                f"no simulated cut of strength {strength:.3g} Pa or more ran through: an element inverts at the entry. "
                "Take larger elements (--h), start from a lower strength (--start cohesion.strength=...), or leave the "
                "simulation (--by balance)"
            )
        return best

    def _rounds(self, made: CuttingPredictor, values: dict[str, float]) -> End:
        """Descents from one start, the slice made anew between them: the last, and whether they settled.

        Settled is what a slice made for it leaves in place, by a descent that converges or finds less than `FAR` to
        gain (facets that come over an edge put kinks into the misfit, on which a descent may shrink its steps for
        ever; a slice made anew gets it off them, so few evaluations are spent on each).
        """
        for n in range(SLICES):
            posed = posed_at(made, self.free, values, LATER if n else FIRST_STARTS)
            ended = descend(
                posed, values, max_steps=self.max_steps, tolerance=SETTLED if n else FAR,
                on_accept=self._accepted, on_run=partial(self.stage.advance, note=self.note),
            )  # fmt: skip
            self.runs += ended.runs
            if not np.isfinite(ended.cost):  # the entry folds: weaker tissue does not
                values = values | {STRENGTH: values[STRENGTH] / 2}
            else:
                before, values = values, posed.values(ended.y)
                near = max(abs(np.log(values[p] / before[p])) for p in LATER) < np.log(SAME)
                if n and near and (ended.converged or ended.cost > (1 - FAR) * ended.trace[0][0]):
                    return End(posed, ended, True)
            made = made.prepared(values)
        return End(posed, ended, False)

    def _accepted(self, n: int, chi2: float, values: dict[str, float]) -> None:
        told = ", ".join(f"{p.split('.')[-1]} {values[p]:.4g}" for p in self.free)
        self.note = f"{self.note.split(';')[0]}; best so far {told}"
        self.kept.keep(values)

    def _misfit(self, made: CuttingPredictor, values: dict[str, float]) -> float:
        """Sum of squares at a start; infinite where the run breaks down."""
        r, _ = posed_at(made.prepared(values), self.free, values, {}).linearised(values)
        self.stage.advance(note="where to begin")
        return float(r @ r) if np.isfinite(r).all() else np.inf


def posed_at(
    made: CuttingPredictor, free: tuple[str, ...], values: Mapping[str, float], reach: Mapping[str, float]
) -> Problem:
    """The problem of a slice; `reach`: how far parameters may go from `values`, as a factor."""
    bounds = {p: (values[p] / k, values[p] * k) for p, k in reach.items() if p in free}
    return problem(made, unknowns=Unknowns(free=free, start=values, bounds=bounds))
