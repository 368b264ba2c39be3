"""What a fit must know of a kind of recordings: what its model lacks, how it begins, how the best is found."""

import abc
import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import ClassVar

from tissuejax.errors import InputError
from tissuejax.estimation.problem import Problem
from tissuejax.fitting.first import First
from tissuejax.fitting.least_squares import fit
from tissuejax.fitting.options import Search
from tissuejax.fitting.result import Fit
from tissuejax.fitting.stress_curve import METHOD as STRESS_CURVE
from tissuejax.fitting.stress_curve import fit_stress_curve
from tissuejax.model import Model
from tissuejax.progress import Progress, Silent, Stage


class Fitted(abc.ABC):
    """One kind of recordings; class data `name` is what experiments call it ("homogeneous", "probing", "cutting")."""

    name: ClassVar[str]

    @classmethod
    def completed(cls, model: Model) -> Model:
        """The model with what this kind can't do without, where the user left it out."""
        return model

    @classmethod
    def begin(cls, posed: Problem, file: str | os.PathLike, given: Mapping[str, float]) -> First:
        """Fit a cheaper model first, from its file; `given` values stay.

        Raises:
            InputError: this kind has none.
        """
        raise InputError(f"first model {file}: surrogates are of probings, {', '.join(posed.predictor.names)} are not")

    @classmethod
    @abc.abstractmethod
    def fit(
        cls, posed: Problem, held: tuple[str, ...], search: Search, named: frozenset[str], progress: Progress | None
    ) -> Fit:
        """The fit.

        Args:
            posed: predictor, free parameters, start.
            held: recordings that are only predicted.
            search: method, starts, steps.
            named: parameters of which the user said where to begin.
            progress: advanced after every accepted step or run.
        """


def begun(posed: Problem, progress: Progress | None) -> AbstractContextManager[Stage]:
    """The stage of a fit, called by the energy and the sample."""
    label = f"fitting {posed.predictor.model.energy.name} to {posed.predictor.sample.name}"
    return (progress or Silent()).stage(label, None)


class Quick(Fitted):
    """Kinds whose predictions are cheap beside a step: several starts, many steps."""

    @classmethod
    def fit(
        cls, posed: Problem, held: tuple[str, ...], search: Search, named: frozenset[str], progress: Progress | None
    ) -> Fit:
        """See `Fitted.fit`."""
        if search.method == STRESS_CURVE:
            return fit_stress_curve(posed, holdout=held)  # says what it takes
        with begun(posed, progress) as stage:
            return fit(
                posed,
                start={path: posed.start[path] for path in named} or None,
                search=search,
                holdout=held,
                on_accept=lambda n, chi2, values: stage.advance(note=f"chi-square {chi2:.4g}"),
            )
