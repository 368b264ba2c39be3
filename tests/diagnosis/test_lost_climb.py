"""Amplitudes that begin beside another fit: where a climb ends on a slope, it begins anew."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Marginal, Widths, amplitudes, uphill
from tissuejax.diagnosis.judgement.weigh import climb
from tissuejax.estimation.discrepancy import Part, Series, discrepancy, loading_states

N, NOISE = 50, 20.0


def far() -> tuple[Linear, tuple[Part, ...], Widths, Blocked]:
    """Two series that lie a kilopascal above a prediction of next to nothing, of which a gain is a share."""
    strain, time = np.linspace(0, 0.3, N), np.arange(float(N))
    series = [Series(name, "pull", time, strain[:, None], loading_states(strain), 1000.0) for name in ("a", "b")]
    parts = discrepancy(series, np.full(2 * N, NOISE)).about(np.tile(strain, 2))
    shares, settled = Criteria().shares, Criteria().settled
    chance = np.array([0.0 if p.family in settled else 0.02 for p in parts])
    widths = Widths(np.array([shares[p.family] for p in parts]), chance, np.array(10.0))
    residual = np.tile(1000 * strain / 0.3, 2) * np.repeat([1, 1.2], N)
    linear = Linear(residual, np.zeros((2 * N, 0)), np.zeros(0), np.zeros(0))
    return linear, parts, widths, Blocked((slice(0, N), slice(N, 2 * N)), np.full(2 * N, NOISE))


def worth(m: Marginal, v: np.ndarray, widths: Widths) -> float:
    return m.value + float(np.sum(widths.log_shape(v / widths.width**2)))


def test_a_climb_from_amplitudes_of_another_fit_ends_at_a_maximum():
    """Held against a simplex over the logarithms of what is not nothing, with dense covariances of scipy."""
    linear, parts, widths, blocked = far()
    begun = np.array([0.17**2 if p.name == "gain" else 0.0 for p in parts])
    lost, m = amplitudes(linear, parts, widths, blocked, begun)
    assert uphill(lost, m, widths) > 1e6
    v, m = climb(linear, parts, widths, blocked, begun, frozenset({"there"}), Course())
    assert uphill(v, m, widths) < Course().steep
    moved = np.flatnonzero(v > 1e-6 * widths.width**2)

    def dense(logs: np.ndarray) -> float:
        trial = np.zeros(len(parts))
        trial[moved] = np.exp(logs)
        covariance = NOISE**2 * np.eye(2 * N)
        for p, x in zip(parts, trial, strict=True):
            if p.factor is not None:
                covariance += x * p.factor @ p.factor.T
            else:
                for k, block in enumerate(p.within or ()):
                    covariance[k * N : (k + 1) * N, k * N : (k + 1) * N] += x * block
        value = multivariate_normal(np.zeros(2 * N), covariance).logpdf(linear.residual)
        return -float(value) - float(np.sum(widths.log_shape(trial / widths.width**2)))

    best = minimize(dense, np.log(v[moved]), method="Nelder-Mead", options={"maxiter": 400})
    assert worth(m, v, widths) == pytest.approx(-best.fun, abs=0.3)


@pytest.mark.parametrize(("u", "slope", "promised"), [(4.0, 3.0, 9 / 4), (4.0, -3.0, 9 / 4), (0.5, -3.0, 1.5)])
def test_what_a_slope_promises_is_the_parabolas_top_or_what_is_left_towards_nothing(u, slope, promised):
    """g^2 / 2f with f = 2, and g u where nothing is nearer than the top; of the flat prior of an infinite width."""
    width = np.array([3.0])
    widths = Widths(width, np.zeros(1))
    g = (slope - float(widths.slope(np.array([u]))[0])) / 9
    m = Marginal(0.0, np.zeros((0, 0)), np.zeros(0), lambda: (np.array([g]), np.array([[2.0 / 81]]), {}))
    assert uphill(9 * np.array([u]), m, widths) == pytest.approx(promised)
