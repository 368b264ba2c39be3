"""Pieces of fits and posteriors by themselves, against algebra."""

from types import SimpleNamespace

import numpy as np
import pytest

from tissuejax.estimation.rules import sizes
from tissuejax.fitting.evidence import _next, _systematic
from tissuejax.fitting.least_squares import _scatter
from tissuejax.fitting.profile import crossing
from tissuejax.fitting.separable import Projection
from tissuejax.fitting.serial import Serial


@pytest.mark.parametrize("at", [[2.0, 1.5, 3.5, -1.0, 0.5, 5.0, 2.5, -2.0, 4.5], list(np.linspace(-3.0, 7.0, 21))])
def test_a_parabola_crosses_a_threshold_at_its_root_on_either_side(at):
    """(x - 2)^2 = 4 at 0 and 4: straight in the root, so that a coarse walk finds them too."""
    x = np.sort(at)
    assert crossing(x, (x - 2) ** 2, 2.0, 4.0) == pytest.approx((0.0, 4.0))
    beyond = np.where(np.abs(x - 2) > 3.1, 50 + np.abs(x), (x - 2) ** 2)
    assert crossing(x, beyond, 2.0, 4.0) == pytest.approx((0.0, 4.0))  # the first time, whatever comes after
    assert crossing(x, (x - 2) ** 2 / 100, 2.0, 4.0) == (-np.inf, np.inf)


def test_particles_are_drawn_in_proportion_and_none_beyond_the_last():
    weights = np.array([0.5, 0.25, 0.125, 0.125])
    drawn = _systematic(np.random.default_rng(3), weights)
    assert np.bincount(drawn, minlength=4).tolist()[:2] == [2, 1]
    late = SimpleNamespace(uniform=lambda: 1 - 1e-16)
    assert _systematic(late, weights * (1 - 1e-12))[-1] == 3  # weights that rounding leaves a little below one


def test_the_next_power_leaves_half_of_the_particles_effective_and_always_moves():
    """Of n particles k stand d higher: w = e^(p d) there, effective share (k w + n - k)^2 / n (k w^2 + n - k)."""
    n, k, d = 100, 10, 6.0
    ll = np.where(np.arange(n) < k, d, 0.0)
    w = np.exp(_next(ll, 0.0) * d)
    assert (k * w + n - k) ** 2 / (n * (k * w**2 + n - k)) == pytest.approx(0.5, abs=1e-6)
    assert _next(0.01 * ll, 0.3) == 1.0
    assert _next(1e40 * ll, 0.25) > 0.25


def test_a_column_that_vanishes_has_a_little_length_by_its_scale():
    assert sizes(np.zeros((3, 2)), np.array([2.0, 4.0])).tolist() == pytest.approx([5e-7, 2.5e-7])
    assert sizes(np.array([[3.0, 0.0], [4.0, 0.0]]), np.array([1.0, 1e6])).tolist() == pytest.approx([5.0, 5.001e-9])


def test_what_moduli_can_do_is_projected_out_and_nothing_else():
    """A third modulus that does what the first two do together takes nothing more away."""
    rng = np.random.default_rng(0)
    two, other = rng.standard_normal((8, 2)), rng.standard_normal((8, 2))
    three = np.column_stack([two, two @ [0.3, 0.7]])
    basis = np.linalg.qr(two)[0]
    of = object.__new__(Projection)
    of.linear, of.low, of.high = np.array([True] * 3 + [False] * 2), np.zeros(3), np.full(3, np.inf)
    found = of._projected(np.column_stack([three, other]), np.ones(5))
    np.testing.assert_allclose(found, other - basis @ (basis.T @ other), atol=1e-12)
    held = of._projected(np.column_stack([three, other]), np.array([1.0, 0.0, 0.0, 1.0, 1.0]))  # two on their bounds
    one = two[:, :1] / np.linalg.norm(two[:, 0])
    np.testing.assert_allclose(held, other - one @ (one.T @ other), atol=1e-12)


@pytest.mark.parametrize(("small", "dependent", "left"), [(1.0, False, 37), (1e-12, False, 37), (1e-12, True, 38)])
def test_degrees_of_freedom_are_less_by_what_columns_of_any_size_can_do(rng, small, dependent, left):
    """Of 40 independent residuals three columns take up three; one that does what another does takes up none."""
    jacobian = rng.standard_normal((40, 3))
    jacobian[:, 2] = small * (jacobian[:, 1] if dependent else jacobian[:, 2])
    r = rng.standard_normal(40)
    estimated, known = (SimpleNamespace(noise=SimpleNamespace(estimated=e)) for e in (True, False))
    assert _scatter(estimated, r, jacobian, Serial()) == pytest.approx((np.sqrt(r @ r / left), left))
    level = np.sqrt(left / (r @ r))  # chi-square as expected: the recorded noise is believed
    assert _scatter(known, level * r, jacobian, Serial()) == (1.0, np.inf)
    for beyond, widened in ((3.4, False), (3.6, True)):  # standard deviations of chi-square
        size = level * np.sqrt(1 + beyond * np.sqrt(2 / left))
        assert (_scatter(known, size * r, jacobian, Serial())[0] > 1) == widened
