"""Probings: each run is a simulation, so one start, few runs, and errors that include the numerical one."""

import os
from collections.abc import Mapping
from typing import ClassVar

from tissuejax.energies import catalogue
from tissuejax.estimation.problem import Problem
from tissuejax.fitting.first import First, first
from tissuejax.fitting.kinds.fitted import Fitted, begun
from tissuejax.fitting.options import Search
from tissuejax.fitting.probed import fit_probed
from tissuejax.fitting.result import Fit
from tissuejax.fitting.stress_curve import METHOD as STRESS_CURVE
from tissuejax.fitting.stress_curve import fit_stress_curve
from tissuejax.model import Model
from tissuejax.progress import Progress
from tissuejax.surrogate import store

JACOBIANS = 12  # at most, whatever the search allows: each costs several simulations


class Probings(Fitted):
    """See `Fitted`."""

    name: ClassVar[str] = "probing"

    @classmethod
    def completed(cls, model: Model) -> Model:
        """See `Fitted.completed`: with a volumetric energy, K/2 (J-1)^2."""
        if model.volumetric is not None:
            return model
        return Model(model.energy, catalogue.volumetric("quadratic"), model.effects)

    @classmethod
    def begin(cls, posed: Problem, file: str | os.PathLike, given: Mapping[str, float]) -> First:
        """See `Fitted.begin`: a surrogate (`tissuejax precompute`) is fitted to the forces."""
        return first(posed, store.read(file), given)

    @classmethod
    def fit(
        cls, posed: Problem, held: tuple[str, ...], search: Search, named: frozenset[str], progress: Progress | None
    ) -> Fit:
        """See `Fitted.fit`."""
        with begun(posed, progress):
            if search.method == STRESS_CURVE:
                return fit_stress_curve(posed, holdout=held)
            steps = min(search.max_steps, JACOBIANS)
            return fit_probed(posed, holdout=held, max_steps=steps, progress=progress, checkpoint=search.checkpoint).fit
