"""What a fit of probings has simulated so far."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.finished import Finished
from tissuejax.estimation.problem import Problem
from tissuejax.experiments.probing_predictor import ProbingPredictor, predict_all
from tissuejax.recordings.recording import Recording


class Simulated:
    """Predictions made so far, so that nothing is simulated twice."""

    def __init__(self):
        self.made: Finished[Mapping[str, Recording]] = Finished()

    def all(self, predictors: Sequence[ProbingPredictor], values: Mapping[str, float]) -> list[Mapping[str, Recording]]:
        """What each predictor says at the same values; those not known yet are simulated side by side."""
        keys = [(p.settings, p.names, *sorted(values.items())) for p in predictors]
        asked = dict(zip(keys, predictors, strict=True))
        new = self.made.missing(asked)
        for key, predicted in zip(new, predict_all([asked[k] for k in new], dict(values)), strict=True):
            self.made.keep(key, predicted)
        return [self.made[k] for k in keys]

    def residuals(self, problem: Problem, values: Mapping[str, float]) -> Float[np.ndarray, " n"]:
        """Residuals of the fitted recordings."""
        return problem.misfit(self.all([problem.predictor], values)[0], values)

    @property
    def runs(self) -> int:
        """How many were simulated."""
        return len(self.made)
