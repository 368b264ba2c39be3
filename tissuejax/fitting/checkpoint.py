"""Where a fit that simulates stood when it was stopped."""

import json
from collections.abc import Mapping
from pathlib import Path

from tissuejax import storage
from tissuejax.cache import key
from tissuejax.estimation.problem import Problem


def mark_of(problem: Problem, *about) -> str | None:
    """A mark of a problem and what else it depends on; None for a law from elsewhere, or code that has moved since it
    was loaded."""
    p = problem.predictor
    fixed = {path: float(value) for path, value in problem.start.items() if path not in problem.free}
    aims = (problem.free, fixed, problem.noise, problem.bounds, problem.priors, problem.loss, problem.stiffness)
    return key.key(p.model, p.names, *about, aims, problem.series.y)


class Checkpoint:
    """The last accepted values of a fit on disk, with a mark of the problem they belong to."""

    def __init__(self, path: Path | None, mark: str | None, start: Mapping[str, float]):
        """`mark`: of the problem (`mark_of`); None where it can't be told from another: nothing is kept then."""
        self.path = None if path is None or mark is None else Path(path)
        self.mark, self.start = mark, {p: float(v) for p, v in start.items()}
        self.before: dict[str, dict[str, float]] = {}  # errors at the very start
        self.closing = False  # the swift descent had ended already

    def values(self) -> dict[str, float]:
        """Where to begin: the kept values if they are of this problem, else its start."""
        if self.path is None or not self.path.exists():
            return dict(self.start)
        kept = json.loads(self.path.read_text())
        if kept.get("mark") != self.mark:
            return dict(self.start)
        self.before, self.closing = kept["before"], kept["closing"]
        return self.start | kept["values"]

    def keep(self, values: Mapping[str, float], closing: bool = False) -> None:
        """Note accepted values, and whether the chord steps of the end have begun."""
        if self.path is not None:
            kept = {"mark": self.mark, "values": dict(values), "before": self.before, "closing": closing}
            storage.write_json(self.path, kept)

    def done(self) -> None:
        """The fit has ended: nothing to resume."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
