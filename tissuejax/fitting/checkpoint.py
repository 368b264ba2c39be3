"""Where a fit of probings stood when it was stopped."""

import json
from collections.abc import Mapping
from pathlib import Path

from tissuejax import storage
from tissuejax.cache import key
from tissuejax.estimation.problem import Problem


class Checkpoint:
    """The last accepted values of a fit on disk, with a mark of the problem they belong to."""

    def __init__(self, path: Path | None, problem: Problem):
        self.path, self.problem = (None if path is None else Path(path)), problem
        self.before: dict[str, dict[str, float]] = {}  # errors at the very start
        self.closing = False  # the swift descent had ended already
        p = problem.predictor
        fixed = {path: float(value) for path, value in problem.start.items() if path not in problem.free}
        aims = (problem.free, fixed, problem.noise, problem.bounds, problem.priors, problem.loss, problem.stiffness)
        self.mark = key.key(p.model, p.names, p.settings, p.setups, aims, problem.series.y)
        if self.mark is None:  # a law from elsewhere, or code that has moved since it was loaded
            self.path = None

    def values(self) -> dict[str, float]:
        """Where to begin: the kept values if they are of this problem, else its start."""
        start = {path: float(v) for path, v in self.problem.start.items()}
        if self.path is None or not self.path.exists():
            return start
        kept = json.loads(self.path.read_text())
        if kept.get("mark") != self.mark:
            return start
        self.before, self.closing = kept["before"], kept["closing"]
        return start | kept["values"]

    def keep(self, values: Mapping[str, float], closing: bool = False) -> None:
        """Note accepted values, and whether the chord steps of the end have begun."""
        if self.path is not None:
            kept = {"mark": self.mark, "values": dict(values), "before": self.before, "closing": closing}
            storage.write_json(self.path, kept)

    def done(self) -> None:
        """The fit has ended: nothing to resume."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)
