"""Laws without a stress in part of the range: what isn't a number is as good as impossible."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tissuejax.fitting.evidence import evidence
from tissuejax.fitting.posterior import laplace


@pytest.mark.parametrize("gap", [np.nan, -np.inf])
def test_a_draw_where_the_density_is_no_number_has_no_weight(gap):
    pytest.importorskip("arviz")
    problem = SimpleNamespace(free=("a",))

    def many(y, data):
        return np.where(y[:, 0] < 1.5, -0.5 * y[:, 0] ** 2, gap)

    target: Any = SimpleNamespace(
        problem=problem,
        data=None,
        start=np.asarray,
        parameters=lambda y: y,
        covariance=lambda x: np.eye(1),
        many=many,
    )
    found = laplace(target, np.zeros(1))
    assert np.all(np.asarray(found.draws) < 1.5)


def test_an_evidence_leaves_out_where_the_likelihood_is_no_number():
    """The same number as with nothing there: ln of the integral of exp(-x) to 0.9, of a prior even from 0 to 1."""
    problem = SimpleNamespace(free=("a",), bound=lambda path: (0.0, 1.0), priors={})

    def found(gap: float):
        def likelihoods(x, data):
            return np.where(x[:, 0] < 0.9, -x[:, 0], gap)

        target: Any = SimpleNamespace(problem=problem, _sigma=np.ones(3), data=None, likelihoods=likelihoods)
        return evidence(target, 200, 1)

    gone, none = found(np.nan), found(-np.inf)
    assert gone.log_evidence == none.log_evidence
    assert np.max(gone.draws) < 0.9
    rest = -1.5 * np.log(2 * np.pi)  # of three samples of unit noise
    assert gone.log_evidence == pytest.approx(np.log(-np.expm1(-0.9)) + rest, abs=0.15)
