"""What of a set's parameters lies between the ends of their ranges, held against integrals that stop there."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from straight_bench import DRIVE, MEANS, covariance, scales_of, straight

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.ranges import beside, between, within
from tissuejax.diagnosis.judgement.weigh import Start, weigh
from tissuejax.diagnosis.refit import Resting
from tissuejax.estimation.discrepancy import Part

AT = {"a": 10.0, "b": 20.0}
NOTHING = Part("nothing", "law", factor=np.zeros((2 * MEANS, 1)))


def density(ends: tuple[float, float]) -> float:
    return quad(lambda x: math.exp(-0.5 * x * x) / math.sqrt(2 * math.pi), *ends)[0]


@pytest.mark.parametrize("ends", [(-1.0, 2.0), (0.0, 5.0), (0.4, 0.5), (2.0, 7.0), (-7.0, -2.0), (-30.0, 30.0)])
def test_the_mass_between_two_ends_is_an_integral(ends):
    assert between(*ends) == pytest.approx(math.log(density(ends)), abs=1e-8)


def test_the_mass_far_out_is_a_number():
    assert between(40.0, 41.0) == pytest.approx(between(-41.0, -40.0))
    assert between(40.0, math.inf) == pytest.approx(-0.5 * 40.0**2 - math.log(40.0 * math.sqrt(2 * math.pi)), abs=1e-3)
    assert between(-math.inf, math.inf) == pytest.approx(0.0)


@pytest.mark.parametrize(("slope", "curvature"), [(0.0, 2.0), (3.0, 2.0), (0.3, 1e-9), (0.0, 0.0), (2e-7, 1e-7)])
@pytest.mark.parametrize("room", [0.01, 1.0, 4.0])
def test_beside_a_bound_lies_no_more_than_there_is_room_for(slope, curvature, room):
    whole, _ = quad(lambda x: math.exp(-slope * x - 0.5 * curvature * x**2), 0, room)
    assert beside(slope, curvature, room) == pytest.approx(math.log(whole), abs=1e-6)


def test_beside_a_bound_far_from_the_other_lies_what_would_without_it():
    assert beside(3.0, 2.0, 1e12) == pytest.approx(beside(3.0, 2.0), abs=1e-12)


def resting(below, above) -> Resting:
    p = len(below)
    return Resting(np.zeros(p, bool), np.ones(p), np.array(below), np.array(above))


@pytest.mark.parametrize("sizes", [(1.0, 1.0, 1.0), (1e6, 1.0, 1e-6)], ids=["alike", "twelve decades apart"])
def test_the_free_parameters_have_the_mass_of_the_box_of_their_ends(sizes):
    """Counted among a million draws; the third is held, the last knows no ends."""
    rng = np.random.default_rng(3)
    root = rng.standard_normal((3, 3)) * np.array(sizes)
    precision, free = root.T @ root, np.array([True, True, False, True])
    draws = rng.multivariate_normal(np.zeros(3), np.linalg.inv(precision), 1_000_000, method="cholesky")
    spread = np.std(draws, axis=0)
    below, above = np.full(4, np.inf), np.full(4, np.inf)
    below[0], above[0], below[1] = 0.3 * spread[0], 1.2 * spread[0], 0.1 * spread[1]
    inside = (draws[:, 0] > -below[0]) & (draws[:, 0] < above[0]) & (draws[:, 1] > -below[1])
    assert within(resting(below, above), free, precision) == pytest.approx(math.log(np.mean(inside)), abs=6e-3)


def test_one_that_is_cut_off_has_the_mass_of_its_own_spread():
    precision, free = np.array([[4.0, 1.0], [1.0, 2.0]]), np.array([True, True])
    spread = math.sqrt(np.linalg.inv(precision)[0, 0])
    found = within(resting([0.3 * spread, 50.0], [1.2 * spread, np.inf]), free, precision)
    assert found == pytest.approx(math.log(density((-0.3, 1.2))), abs=1e-9)


def test_where_nothing_is_free_nothing_is_cut_off():
    assert within(resting([0.1], [0.1]), np.array([False]), np.zeros((0, 0))) == 0.0


def test_of_a_precision_that_is_singular_to_rounding_the_mass_is_a_number():
    precision = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert math.isfinite(within(resting([0.1, 0.1], [0.2, np.inf]), np.array([True, True]), precision))


def bounded(truth: dict[str, float], columns: dict[str, np.ndarray], frees: dict[str, Free]) -> Any:
    """The straight bench with further amplitudes of one candidate, "more"; nothing else is open but a and b."""

    class More(type(straight({}))):
        def column(self, path, onset):
            return columns[path] if path in columns else super().column(path, onset)

    bench = straight({})
    bench.__class__ = More
    bench.free, bench.start = bench.free | frees, bench.start | dict.fromkeys(frees, 0.0)
    bench.candidates["more"] = Candidate("more", tuple(frees))
    bench.y = bench.predict({**AT, **truth}) + np.random.default_rng(5).normal(0, 0.05, len(bench.y))
    return bench


def gained(bench, scales) -> float:
    """Log evidence of "more" over the base, both by `weigh`."""
    at = dict.fromkeys(bench.candidates["more"].amplitudes, 0.2)
    ours = weigh(scales, ("more",), Start({**AT, **at}), Criteria()).evidence
    return ours.log_evidence - weigh(scales, (), Start(AT), Criteria()).evidence.log_evidence


def integrand(bench, scales, width):
    """By the amplitudes of "more": prior and density of the data, a and b integrated out, over the base's."""
    paths = bench.candidates["more"].amplitudes
    k = np.linalg.inv(covariance(scales, [], []))
    base = scales.cut.mean(bench.jacobian({}, ("a", "b")))
    taken = k - k @ base @ np.linalg.solve(base.T @ k @ base, base.T @ k)
    y, jac = scales.cut.mean(bench.y), scales.cut.mean(bench.jacobian({}, paths))
    wide, b, h = np.array(width), jac.T @ taken @ y, jac.T @ taken @ jac

    def value(*amplitudes) -> np.ndarray:
        x = np.stack(amplitudes, axis=-1)
        prior = np.sum(-0.5 * (x / wide) ** 2 - np.log(wide * math.sqrt(2 * math.pi)), axis=-1)
        return prior + x @ b - 0.5 * np.sum(x * (x @ h), axis=-1)

    return value


def usual(bench, scales) -> list[float]:
    """Widths of the priors: what changes the stress by 0.3 of it."""
    stress = scales.cut.mean(bench.predict(AT))
    jac = scales.cut.mean(bench.jacobian({}, bench.candidates["more"].amplitudes))
    return [0.3 * math.sqrt(np.sum(stress**2) / np.sum(c**2)) for c in jac.T]


@pytest.mark.parametrize("scale", [2e-3, 2e-2, 5e-2, 1e-1])
@pytest.mark.parametrize("truth", [0.0, 0.5])
def test_a_share_that_the_data_hardly_know_is_no_gain(scale, truth):
    """One amplitude between 0 and 1, its prior far wider: data that leave it open, and draw it to an end, or not."""
    bench = bounded({"more.g": truth}, {"more.g": scale * np.sin(9 * DRIVE)}, {"more.g": Free(0.0, 1.0, 0.2)})
    scales = scales_of(bench, NOTHING)
    width = usual(bench, scales)
    value = integrand(bench, scales, width)
    whole = quad(lambda x: math.exp(value(x)), 0.0, 1.0)[0]
    kept = quad(lambda x: math.exp(-0.5 * (x / width[0]) ** 2) / width[0] / math.sqrt(2 * math.pi), 0.0, 1.0)[0]
    assert gained(bench, scales) == pytest.approx(math.log(whole / kept), abs=2e-3)


def test_two_shares_that_do_the_same_cost_no_less_than_they_should():
    """Their sum is known and how it is split is not; Laplace's method without ends has half a nat and more for
    nothing. To a fiftieth: a fit stops short of the best split by what it no longer gains."""
    wave = 30.0 * np.sin(9 * DRIVE)
    frees = {"more.g": Free(0.0, 1.0, 0.2), "more.h": Free(0.0, 1.0, 0.2)}
    bench = bounded({"more.g": 0.15, "more.h": 0.05}, {"more.g": wave, "more.h": wave * (1 + 0.001 * DRIVE)}, frees)
    scales = scales_of(bench, NOTHING)
    width = usual(bench, scales)
    value = integrand(bench, scales, width)
    splits, sums = np.linspace(-3.0, 3.0, 6001), np.linspace(0.19, 0.21, 801)[:, None]
    logs = value(0.5 * (sums + splits), 0.5 * (sums - splits))
    top, cell = np.max(logs), 0.5 * (splits[1] - splits[0]) * float(sums[1, 0] - sums[0, 0])
    inside = np.abs(splits) <= sums
    whole, unbounded = (top + math.log(cell * np.sum(np.exp(logs - top) * w)) for w in (inside, 1.0))
    kept = sum(math.log(density((0.0, 1.0 / w))) for w in width)
    assert gained(bench, scales) == pytest.approx(whole - kept, abs=0.02)
    assert unbounded - whole > 0.5
