"""What weighing comes to where all is a straight line: integrals over all that is open, in dense matrices."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp
from straight_bench import DRIVE, GAIN, MEANS, SIGMA, averaged, covariance, flat, half_normal, scales_of, straight

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, amplitudes, marginal
from tissuejax.diagnosis.judgement.mass import amplitude_mass
from tissuejax.diagnosis.judgement.ranges import beside
from tissuejax.diagnosis.judgement.weigh import Start, _idle, _resting, kurtosis, weigh
from tissuejax.estimation.discrepancy import Part

USUAL = Criteria()
AT = {"a": 10.0, "b": 20.0}


def columns(scales, *paths: str) -> np.ndarray:
    return scales.cut.mean(scales.bench.jacobian({}, paths))


def usual_size(scales, path: str, share: float) -> float:
    """The amplitude that changes the stress by a share of it, where it does something."""
    c, stress = columns(scales, path)[:, 0], scales.cut.mean(scales.bench.predict(AT))
    return share * math.sqrt(np.sum(stress[c != 0] ** 2) / np.sum(c**2))


def over_gain(scales, y, jac, k0) -> float:
    """log evidence over the amplitude of the gain: as usual, or ten times that with the chance of what is unknown."""
    w = USUAL.shares["gain"]

    def prior(a):
        return (1 - USUAL.unknown) * half_normal(a, w) + USUAL.unknown * half_normal(a, USUAL.strange * w)

    part = covariance(scales, [GAIN], [1.0]) - covariance(scales, [GAIN], [0.0])
    return averaged(lambda a: flat(y, jac, k0 + a**2 * part), prior, [0, w / 3, w, 3 * w, 10 * w, 60 * w])


@pytest.mark.parametrize("gain", [0.0, 0.02])
def test_the_evidence_of_the_base_is_the_integral_over_all_that_is_open(gain):
    bench = straight({})
    bench.y[:30] *= 1 + gain * 20
    scales = scales_of(bench)
    found = weigh(scales, (), Start(AT), USUAL).evidence
    y, jac = scales.cut.mean(bench.y), columns(scales, "a", "b")
    assert found.log_evidence == pytest.approx(over_gain(scales, y, jac, covariance(scales, [], [])), abs=0.05)
    assert found.fit + found.parameters + found.discrepancy == pytest.approx(found.log_evidence, abs=1e-9)


@pytest.mark.parametrize(("size", "counts"), [(1e3, True), (1e2, False)])
def test_a_constant_counts_where_it_does_more_than_rounding_moved_by_its_scale(size, counts):
    """1e-13 N per unit: a thousand units of it are more than 1e-12 of the peak of 45 N, a hundred are less."""
    bench = straight({}, seed=1)
    bench.base = ("a", "b", "hardly.k")
    bench.free = bench.free | {"hardly.k": replace(bench.free["a"], scale=size)}
    bench.start = bench.start | {"hardly.k": 0.0}
    usual = bench.column
    bench.column = lambda path, onset: 1e-13 * DRIVE**2 if path == "hardly.k" else usual(path, onset)
    scales = scales_of(bench)
    found = weigh(scales, (), Start({**AT, "hardly.k": 0.0}), USUAL)
    y, k = scales.cut.mean(bench.y), covariance(scales, [], [])
    jac = columns(scales, "a", "b", "hardly.k") / [1.0, 1.0, 1e-13]
    expected = over_gain(scales, y, jac, k) - math.log(1e-13) if counts else over_gain(scales, y, jac[:, :2], k)
    assert found.evidence.log_evidence == pytest.approx(expected, abs=0.05)


CASES = [  # what acts, its size, what is freed, its share of the stress (None: what was noted)
    ({"own.x": 0.3}, "own", ("own.x",), USUAL.change),
    ({"own.x": 0.0}, "own", ("own.x",), USUAL.change),
    ({"shift.x": 0.2, "shift.y": -0.1}, "shift", ("shift.x", "shift.y"), USUAL.rig),
    ({"noted.x": 0.15}, "noted", ("noted.x",), None),
    ({"push.k": 3.0}, "push", ("push.k",), USUAL.change),
]


def normal_prior(scales, paths, share) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of each."""
    if share is None:
        mean, std = scales.bench.free[paths[0]].prior
        return np.array([mean]), np.array([std])
    return np.zeros(len(paths)), np.array([usual_size(scales, p, share) for p in paths])


@pytest.mark.parametrize(("truth", "key", "paths", "share"), CASES)
def test_an_effect_is_integrated_over_a_prior_of_what_is_usual(truth, key, paths, share):
    """A normal prior is so much more covariance; one of one side has twice its height where the data lie inside."""
    bench = straight(truth)
    scales = scales_of(bench)
    found = weigh(scales, (key,), Start({**AT, **truth}), USUAL)
    mean, std = normal_prior(scales, paths, share)
    c = columns(scales, *paths)
    y = scales.cut.mean(bench.y) - c @ mean
    prior = covariance(scales, [], []) + (c * std**2) @ c.T
    expected = over_gain(scales, y, columns(scales, "a", "b"), prior) + (math.log(2) if key == "push" else 0.0)
    assert found.evidence.log_evidence == pytest.approx(expected, abs=0.05)
    assert not found.evidence.void
    assert found.evidence.at_bound == ()


@pytest.mark.parametrize("truth", [-1.5, -0.1])
def test_an_effect_that_the_data_would_have_negative_is_integrated_on_its_side(truth):
    bench = straight({"push.k": truth}, seed=3, sigma=0.2)
    scales = scales_of(bench)
    found = weigh(scales, ("push",), Start({**AT, "push.k": 0.5}), USUAL).evidence
    assert found.at_bound == ("push.k",)
    assert found.void  # all that it may do is at nothing
    size, c = usual_size(scales, "push.k", USUAL.change), columns(scales, "push.k")[:, 0]
    y, jac, k = scales.cut.mean(bench.y), columns(scales, "a", "b"), covariance(scales, [GAIN], [0.0])
    ends = [size * x for x in (0.0, 0.02, 0.1, 0.5, 2.0, 8.0)]
    expected = averaged(lambda x: over_gain(scales, y - x * c, jac, k), lambda x: half_normal(x, size), ends)
    assert found.log_evidence == pytest.approx(expected, abs=0.05)


def test_a_positive_shape_is_integrated_in_its_logarithm():
    """How soon a bend is over, 0.3 and 0.7 scanned: normal in its logarithm about their middle, as wide as a factor of
    five and what they differ by."""
    bench = straight({"bend.k": 30.0, "bend.onset": 0.4}, sigma=0.02)
    scales = scales_of(bench)
    at = {**AT, "bend.k": 30.0, "bend.onset": 0.4}
    found = weigh(scales, ("bend",), Start(at), USUAL)
    logs = np.log([0.3, 0.7])
    mean, std = logs.mean(), math.hypot(math.log(5.0), logs.std())
    y, jac = scales.cut.mean(bench.y), columns(scales, "a", "b")
    rested = found.refit.values["bend.onset"]

    def column(onset):
        return scales.cut.mean(bench.column("bend.k", onset))

    stress = scales.cut.mean(bench.predict(AT))

    def log_density(s):
        # the prior of its amplitude goes by the shape where the fit rests
        felt = column(rested)
        size = USUAL.change * math.sqrt(np.sum(stress[felt != 0] ** 2) / np.sum(felt**2))
        c = column(math.exp(s))
        k = covariance(scales, [], []) + size**2 * np.outer(c, c)
        return over_gain(scales, y, jac, k)

    grid = math.log(rested) + np.linspace(-0.2, 0.2, 81)
    values = np.array([log_density(s) - 0.5 * ((s - mean) / std) ** 2 for s in grid])
    inside = (math.log(10) - mean) / std, (math.log(0.01) - mean) / std
    whole = 0.5 * (math.erf(inside[0] / math.sqrt(2)) - math.erf(inside[1] / math.sqrt(2)))
    expected = values.max() + math.log(
        np.trapezoid(np.exp(values - values.max()), grid) / (std * math.sqrt(2 * math.pi))
    )
    assert found.evidence.log_evidence == pytest.approx(expected - math.log(whole), abs=0.03)
    assert found.evidence.k == 4
    assert set(found.evidence.free) == {"a", "b", "bend.k", "bend.onset"}


@pytest.mark.parametrize(("slope", "curvature"), [(0.0, 2.0), (3.0, 2.0), (40.0, 2.0), (0.7, 300.0)])
def test_what_lies_beside_a_bound_is_an_integral(slope, curvature):
    x = np.linspace(0, 60 / max(slope, math.sqrt(curvature)), 400_001)
    whole = np.trapezoid(np.exp(-slope * x - 0.5 * curvature * x**2), x)
    assert beside(slope, curvature) == pytest.approx(math.log(whole), abs=1e-6)


def test_a_slope_that_leads_inside_is_taken_for_none():
    assert beside(-3.0, 2.0) == beside(0.0, 2.0)


def test_the_fourth_moment_of_known_distributions(rng):
    assert kurtosis(rng.normal(3.0, 2.0, 400_000)) == pytest.approx(0.0, abs=0.05)
    assert kurtosis(rng.laplace(-1.0, 0.3, 400_000)) == pytest.approx(3.0, abs=0.2)
    assert kurtosis(np.tile([1.0, -1.0], 50)) == pytest.approx(-2.0)
    assert kurtosis(np.full(8, 0.25)) == 0.0  # without noise a residual may be the same everywhere


def test_what_a_set_leaves_is_counted_in_its_noise():
    """Chi-square of means, the share of the base's that went, and the parts of the rest, about the fit described."""
    bench = straight({"own.x": 0.3})
    within = tuple(np.diag(np.linspace(0.5, 1.5, MEANS)) for _ in range(2))
    parts = (GAIN, Part("white", "white", within=within), Part("mesh", "numerical", factor=np.ones((2 * MEANS, 1))))
    scales = scales_of(bench, *parts)
    found = weigh(scales, ("own",), Start({**AT, "own.x": 0.3}), USUAL)
    e, sigma = found.evidence, SIGMA / np.sqrt(scales.cut.counts)
    left = scales.cut.mean(bench.y - found.refit.prediction)
    before = scales.cut.mean(bench.y - bench.predict(AT))
    assert e.n == 2 * MEANS
    assert e.chi2 == pytest.approx(np.sum((left / sigma) ** 2))
    excess = np.sum((before / sigma) ** 2) - e.n
    assert e.explained == pytest.approx(1 - max(e.chi2 - e.n, 0) / excess)
    assert e.amplitudes == pytest.approx({p.name: math.sqrt(x) for p, x in zip(parts, found.v, strict=True)})
    assert e.numerical == pytest.approx(math.sqrt(found.v[2]) / scales.peak)
    each = (np.quantile(np.abs(bench.y[s.rows]), USUAL.means.peak) for s in bench.segments)
    assert scales.peak == pytest.approx(max(each))


def test_the_rest_is_what_the_discrepancy_is_expected_to_be():
    """Of the smooth part alone, less what the fit could take up; noise and a mesh are none."""
    bench = straight({})
    bench.y[:30] += 0.4 * np.sin(6 * bench.segments[0].drive)
    wave = np.concatenate([np.sin(6 * bench.segments[0].drive[::2]), np.zeros(MEANS)])[:, None]
    within = tuple(0.01 * np.eye(MEANS) for _ in range(2))
    mesh = Part("mesh", "numerical", factor=0.05 * np.linspace(0, 1, 2 * MEANS)[:, None])
    parts = (Part("wave", "gain", factor=wave), Part("white", "white", within=within), mesh)
    scales = scales_of(bench, *parts)
    found = weigh(scales, (), Start(AT), replace(USUAL, shares={**USUAL.shares, "gain": 0.3}))
    assert found.v[0] > 0.01
    y = scales.cut.mean(bench.y - found.refit.prediction)
    own, noise = found.v[0] * wave @ wave.T, covariance(scales, parts, [0.0, found.v[1], 0.0])
    whole = covariance(scales, parts, found.v)
    mean = own @ np.linalg.solve(whole, y)
    smooth = whole - noise
    spread = np.diag(smooth - smooth @ np.linalg.solve(whole, smooth)) / scales.peak**2
    slopes = columns(scales, "a", "b")
    mean = (mean - slopes @ np.linalg.lstsq(slopes, mean, rcond=None)[0]) / scales.peak
    np.testing.assert_allclose(found.rest, mean * scales.peak, atol=1e-9)
    assert found.evidence.rest[0] == pytest.approx(np.mean(mean**2 + spread), rel=1e-9)
    each = 2 * spread**2 + 4 * spread * mean**2
    assert found.evidence.rest[1] == pytest.approx(math.sqrt(USUAL.alike * each.sum()) / len(mean), rel=1e-9)


def fitted(**values):
    """A fit of the straight bench at `values`."""
    bench = straight({})
    return bench, SimpleNamespace(values=values, prediction=bench.predict(values))


@pytest.mark.parametrize(("v", "rests"), [([0.0, 0.3], True), ([1e-12, 0.0], False), ([0.0, 0.0], True)])
def test_what_only_widens_rests_where_its_families_are_at_nothing(v, rests):
    bench, fit = fitted(**AT)
    scatter = Candidate("scatter", (), widens={"gain": 0.15})
    assert _resting(scatter, fit, bench, (), np.array(v), ("gain", "slow")) == rests


@pytest.mark.parametrize(
    ("x", "y", "bound", "rests"),
    [
        (0.0, 0.0, ("shift.x", "shift.y"), True),
        (0.0, 0.0, ("shift.x",), False),  # one of its amplitudes may still move
        (0.0, 1.1e-7, ("shift.x", "shift.y"), False),  # on a bound that is not neutral: more than 1e-6 of its scale
        (0.0, 0.9e-7, ("shift.x", "shift.y"), True),
    ],
)
def test_an_effect_rests_where_all_its_amplitudes_are_neutral_and_on_their_bounds(x, y, bound, rests):
    bench, fit = fitted(**AT, **{"shift.x": x, "shift.y": y})
    assert _resting(bench.candidates["shift"], fit, bench, bound, np.zeros(1), ("gain",)) == rests


def test_an_effect_is_idle_where_the_fit_predicts_the_same_without_it():
    bench, fit = fitted(**AT, **{"own.x": 0.0, "push.k": 2.0})
    own, push, scatter = bench.candidates["own"], bench.candidates["push"], Candidate("scatter", (), widens={"gain": 1})
    told = {"own.x": 1.0, "push.k": 1.0}
    assert _idle(own, fit, bench, 40.0, told)
    assert not _idle(push, fit, bench, 40.0, told)
    assert not _idle(scatter, fit, bench, 40.0, told)
    least = 2.0 * np.max(np.abs(bench.column("push.k", 0.3))) / 1e-12  # of a peak beyond which all of it is rounding
    assert _idle(push, fit, bench, 1.01 * least, told)
    assert not _idle(push, fit, bench, 0.99 * least, told)


@pytest.mark.parametrize(("slope", "simulated"), [(1.1e-5, False), (0.9e-5, True)])
def test_where_predictions_are_costly_a_slope_tells_that_an_effect_does_something(slope, simulated):
    """Moved by 4 it changes 1e-6 of a peak of 40 Pa and more: no simulation is spent on it."""
    bench, fit = fitted(**AT, **{"push.k": 4.0})
    asked = []
    bench.__class__ = type("Costly", (type(bench),), {"costly": True})
    bench.predict = lambda values: asked.append(values) or fit.prediction
    assert _idle(bench.candidates["push"], fit, bench, 40.0, {"push.k": slope}) == simulated
    assert [a["push.k"] for a in asked] == [0.0] * simulated


def test_amplitudes_that_the_data_hardly_tell_apart_are_not_taken_one_by_one():
    """Two parts that are nearly one: more of the one is less of the other. Against a sum over both amplitudes, their
    mass errs by less than half of what it would by with their correlation left out."""
    widths, n, q, sigma = Widths(np.full(2, 0.5), np.full(2, 0.1)), 40, 12, 0.1
    a, blocked = (np.arange(48) + 0.5) / 16, Blocked((slice(0, n),), np.full(n, sigma))
    with_it, without = [], []
    for seed in range(4, 8):
        rng = np.random.default_rng(seed)
        one, other = (np.linalg.qr(rng.standard_normal((n, q)))[0] for _ in range(2))
        other = 0.998 * one + math.sqrt(1 - 0.998**2) * other
        residual = one @ rng.normal(0, 1, q) + other @ rng.normal(0, 1, q) + sigma * rng.standard_normal(n)
        parts = [Part("one", "law", one), Part("other", "gain", other)]
        linear = Linear(residual, np.ones((n, 1)), np.zeros(1), np.zeros(1))
        v, m = amplitudes(linear, parts, widths, blocked, np.ones(2))
        squares = [np.array([x, y]) ** 2 for x in a for y in a]
        whole = [marginal(linear, parts, u, blocked).value + np.sum(widths.log_density(u)) for u in squares]
        expected = float(logsumexp(whole)) - 2 * math.log(16) - m.value
        found = amplitude_mass(linear, parts, widths, blocked, v, m)
        apart = m.fisher / np.sqrt(np.outer(np.diag(m.fisher), np.diag(m.fisher)))
        with_it.append(abs(found - expected))
        without.append(abs(found + 0.5 * np.linalg.slogdet(apart)[1] - expected))
    assert np.mean(with_it) < 0.5 * np.mean(without)
