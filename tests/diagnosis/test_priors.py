"""Priors of what a set frees: densities between the bounds of a parameter."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from tissuejax.diagnosis.bench import Free
from tissuejax.diagnosis.judgement.scales import log_prior


@pytest.mark.parametrize(
    ("low", "high", "prior"),
    [
        (-math.inf, math.inf, (0.3, 2.0)),
        (0.0, math.inf, (0.0, 0.5)),  # one-sided: twice the height of a normal one
        (0.0, 1.0, (0.0, 0.5)),
        (-1.0, 2.0, (5.0, 0.7)),  # the mean lies outside: a tail alone
        (6.0, 7.0, (0.0, 1.0)),  # and far outside, to either side
        (-9.0, -8.0, (0.0, 1.0)),
        (9.0, 9.5, (0.0, 1.0)),  # where the distribution is one to rounding
    ],
)
def test_a_prior_between_bounds_is_a_density(low, high, prior):
    free = Free(low, high, 1.0)
    ends = np.clip([low, high], prior[0] - 12 * prior[1], prior[0] + 12 * prior[1])
    whole, _ = quad(lambda x: math.exp(log_prior(free, x, prior)), *ends, limit=200)
    assert whole == pytest.approx(1.0, rel=1e-6)


def test_of_a_positive_shape_it_is_the_density_of_the_logarithm():
    free, prior = Free(1.0, 100.0, 1.0, log=True), (math.log(10.0), 1.2)
    whole, _ = quad(lambda x: math.exp(log_prior(free, x, prior)), 0.0, math.log(100.0))
    assert whole == pytest.approx(1.0, rel=1e-8)


@pytest.mark.parametrize("at", [0.0, 3.0, 40.0])
def test_bounds_that_are_one_to_rounding_leave_a_number(at):
    """A range of nothing has no density, but a set with such a parameter is compared with others."""
    free = Free(at, at, 1.0)
    assert math.isfinite(log_prior(free, at, (0.0, 1.0)))
