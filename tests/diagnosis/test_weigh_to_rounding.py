"""All factors of a set's evidence at the place where it came to rest, in dense matrices and scipy's densities."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import sqrtm
from scipy.stats import kurtosis as fourth
from scipy.stats import multivariate_normal, norm, truncnorm
from straight_bench import DRIVE, GAIN, MEANS, N, Straight, covariance, half_normal, scales_of, straight

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.marginal import Linear
from tissuejax.diagnosis.judgement.ranges import on_bounds
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, Weighed, weigh
from tissuejax.diagnosis.refit import Resting

USUAL = Criteria()
AT = {"a": 10.0, "b": 20.0}


def size_of(scales: Scales, path: str, share: float, values: dict[str, float]) -> float:
    c = scales.cut.mean(scales.bench.jacobian(values, (path,)))[:, 0]
    stress = scales.cut.mean(scales.bench.predict(AT))
    return share * math.sqrt(np.sum(stress[c != 0] ** 2) / np.sum(c**2))


def priors_of(scales: Scales, keys, values: dict[str, float]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation by path: of a positive shape in its logarithm."""
    out = {}
    for key in keys:
        c = scales.bench.candidates[key]
        for p in c.amplitudes:
            out[p] = scales.bench.free[p].prior or (0.0, size_of(scales, p, 0.1 if c.rig else 0.3, values))
        for p in c.shapes:
            logs = np.log([g[p] for g in c.grid])
            out[p] = (float(np.mean(logs)), math.hypot(math.log(5), float(np.std(logs))))
    return out


normal: Any = multivariate_normal
cut_off: Any = truncnorm


class Dense:
    """A weighed set's problem at its fit: slopes, precisions and covariance."""

    def __init__(self, scales: Scales, found: Weighed, keys=()):
        self.scales, self.found, values = scales, found, found.refit.values
        self.paths, free = list(values), scales.bench.free
        self.log = np.array([free[p].log for p in self.paths])
        self.priors = priors_of(scales, keys, values)
        natural = np.array([values[p] for p in self.paths])
        self.x = np.where(self.log, np.log(np.where(self.log, natural, 1.0)), natural)
        slopes = scales.cut.mean(scales.bench.jacobian(values, tuple(self.paths)))
        self.jac = slopes * np.where(self.log, natural, 1.0)
        self.weak = np.array([self.priors[p][1] ** -2 if p in self.priors else 0.0 for p in self.paths])
        mean = np.array([self.priors[p][0] if p in self.priors else x for p, x in zip(self.paths, self.x, strict=True)])
        self.offset = self.x - mean
        self.left = scales.cut.mean(scales.bench.y - scales.bench.predict(values))
        self.bound = np.array([p in found.evidence.at_bound for p in self.paths])

    def covariance(self, v) -> np.ndarray:
        return covariance(self.scales, self.found.parts, v)

    def precision(self, v) -> np.ndarray:
        j = self.jac[:, ~self.bound]
        return j.T @ np.linalg.solve(self.covariance(v), j) + np.diag(self.weak[~self.bound])

    def inside(self, precision: np.ndarray) -> float:
        """log of what of a normal density of this precision lies between the ends, each parameter by itself."""
        spread, total = np.sqrt(np.diag(np.linalg.inv(precision))), 0.0
        for i, s in zip(np.flatnonzero(~self.bound), spread, strict=True):
            f = self.scales.bench.free[self.paths[i]]
            low, high = (math.log(f.lower), math.log(f.upper)) if f.log else (f.lower, f.upper)
            total += math.log(norm.cdf(high, self.x[i], s) - norm.cdf(low, self.x[i], s))
        return total

    def density(self) -> float:
        return float(normal(np.zeros(len(self.left)), self.covariance(self.found.v)).logpdf(self.left))

    def log_priors(self) -> float:
        total = 0.0
        for p, x in zip(self.paths, self.x, strict=True):
            if p in self.priors:
                (mean, std), f = self.priors[p], self.scales.bench.free[p]
                ends = (math.log(f.lower), math.log(f.upper)) if f.log else (f.lower, f.upper)
                total += float(cut_off((ends[0] - mean) / std, (ends[1] - mean) / std, mean, std).logpdf(x))
        return total

    def mass(self) -> float:
        """Of the one amplitude, parameters integrated out: quadrature over the logarithm."""
        width = USUAL.shares["gain"]

        def along(a: float) -> float:
            k, free = self.covariance([a**2]), ~self.bound
            h, j = self.precision([a**2]), self.jac[:, free]
            b = j.T @ np.linalg.solve(k, self.left) - self.weak[free] * self.offset[free]
            square = self.left @ np.linalg.solve(k, self.left) - b @ np.linalg.solve(h, b)
            return -0.5 * float(square + np.linalg.slogdet(k)[1] + np.linalg.slogdet(h)[1])

        here = along(math.sqrt(self.found.v[0]))

        def weight(s: float) -> float:
            a = math.exp(s)
            prior = (1 - USUAL.unknown) * half_normal(a, width) + USUAL.unknown * half_normal(a, 10 * width)
            return a * prior * math.exp(along(a) - here)

        ends = np.log(width * np.array([1e-4, 1e-2, 0.1, 1, 5, 30, 100]))
        return math.log(sum(quad(weight, p, q, epsabs=0, epsrel=1e-8)[0] for p, q in zip(ends, ends[1:], strict=False)))

    def beside(self) -> float:
        """log of the integral beside each bound, the free parameters integrated out."""
        k, free, total = np.linalg.inv(self.covariance(self.found.v)), ~self.bound, 0.0
        for i in np.flatnonzero(self.bound):
            c = self.jac[:, i]
            shared = self.jac[:, free].T @ k @ c
            curvature = c @ k @ c + self.weak[i] - shared @ np.linalg.solve(self.precision(self.found.v), shared)
            slope = max(float(self.weak[i] * self.offset[i] - c @ k @ self.left), 0.0)
            end = 60 / max(slope, math.sqrt(curvature))
            total += math.log(quad(lambda x, s=slope, h=curvature: math.exp(-s * x - 0.5 * h * x**2), 0, end)[0])
        return total


CASES = [
    ({}, (), {}),
    ({"own.x": 0.3}, ("own",), {"own.x": 0.3}),
    ({"shift.x": 0.2, "shift.y": -0.1}, ("shift",), {}),
    ({"noted.x": 0.15}, ("noted",), {}),
    ({"push.k": 3.0}, ("push",), {"push.k": 3.0}),
    ({"push.k": 0.03}, ("push",), {"push.k": 0.03}),
    ({"push.k": -1.5}, ("push",), {"push.k": 0.5}),
    ({"push.k": -0.5, "shift.x": 0.2, "own.x": 0.1}, ("shift", "push", "own"), {}),
    ({"bend.k": 30.0, "bend.onset": 0.4}, ("bend",), {"bend.k": 30.0, "bend.onset": 0.4}),
    ({"bend.k": 30.0, "own.x": 0.2}, ("own", "bend"), {"bend.k": 20.0}),
]


@pytest.mark.parametrize(("truth", "keys", "at"), CASES)
def test_the_evidence_is_density_prior_width_and_mass_at_the_fit(truth, keys, at):
    bench = straight(truth, seed=2)
    bench.y[:N] *= 1.03
    scales = scales_of(bench)
    found: Any = weigh(scales, keys, Start({**AT, **at}), USUAL)
    e, d = found.evidence, Dense(scales, found, keys)
    free = ~d.bound
    width = 0.5 * np.sum(free) * math.log(2 * math.pi) - 0.5 * np.linalg.slogdet(d.precision(found.v))[1]
    told = 0.5 * float(np.sum((d.weak * d.offset**2)[free]))
    assert e.fit == pytest.approx(d.density() - told, abs=1e-6)
    width += d.inside(d.precision(found.v))
    assert e.parameters == pytest.approx(d.log_priors() + told + width + d.beside(), abs=1e-6)
    assert e.discrepancy == pytest.approx(d.mass(), abs=1e-4)
    assert e.log_evidence == pytest.approx(e.fit + e.parameters + e.discrepancy, abs=1e-9)
    assert (e.keys, e.k, e.free) == (keys, len(d.paths), tuple(d.paths))
    assert e.at_bound == (("push.k",) if truth.get("push.k", 0) < 0 else ())
    np.testing.assert_allclose(found.linear.jacobian, d.jac[:, free], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.linear.offset, d.offset[free], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.linear.weak, d.weak[free], rtol=1e-9)
    np.testing.assert_allclose(found.linear.residual, d.left, rtol=1e-9)
    half = np.real(sqrtm(np.linalg.inv(np.eye(2 * MEANS) + scaled_gain(scales, found))))
    assert e.kurtosis == pytest.approx(fourth(half @ (d.left / scales.blocked.sigma)), rel=1e-6)


def scaled_gain(scales: Scales, found: Weighed) -> np.ndarray:
    light = GAIN.factor / scales.blocked.sigma[:, None]
    return found.v[0] * light @ light.T


class Mixed(Straight):
    """Two shares of one whole beside the base."""

    def column(self, path, onset):
        extra = {"one.g": 4 * np.sin(3 * DRIVE), "two.g": 4 * np.cos(4 * DRIVE)}
        return extra[path] if path in extra else super().column(path, onset)


def test_of_shares_that_take_up_their_whole_the_sum_rests_on_its_end():
    """Of 1.8 and 0.1 no more than one together: the larger stands for the sum, the smaller moves at its cost."""
    bench = straight({}, sigma=0.01)
    bench.__class__ = Mixed
    share = Free(0.0, 1.0, 0.2, whole="mix")
    bench.free = bench.free | {"one.g": share, "two.g": share}
    bench.start = bench.start | {"one.g": 0.0, "two.g": 0.0}
    bench.candidates["mix"] = Candidate("mix", ("one.g", "two.g"))
    rng = np.random.default_rng(0)
    bench.y = bench.predict({**AT, "one.g": 1.8, "two.g": 0.1}) + rng.normal(0, 0.01, 2 * N)
    scales = scales_of(bench)
    found: Any = weigh(scales, ("mix",), Start({**AT, "one.g": 0.5, "two.g": 0.3}), USUAL)
    values, e = found.refit.values, found.evidence
    assert values["one.g"] + values["two.g"] == pytest.approx(1.0, abs=1e-6)
    assert 0.05 < values["two.g"] < values["one.g"] < 0.95
    assert e.at_bound == ("one.g",)
    d = Dense(scales, found, ("mix",))
    largest, other = d.paths.index("one.g"), d.paths.index("two.g")
    d.jac[:, other] -= d.jac[:, largest]
    d.offset[other] -= (d.weak * d.offset)[largest] / d.weak[other]
    k = np.linalg.inv(d.covariance(found.v))
    c, free = d.jac[:, largest], ~d.bound
    shared = d.jac[:, free].T @ k @ c
    curvature = c @ k @ c + d.weak[largest] - shared @ np.linalg.solve(d.precision(found.v), shared)
    slope = -float(d.weak[largest] * d.offset[largest] - c @ k @ d.left)  # from its end downward
    assert slope > 10 * math.sqrt(curvature)
    width = 1.5 * math.log(2 * math.pi) - 0.5 * np.linalg.slogdet(d.precision(found.v))[1]
    width += d.inside(d.precision(found.v))
    beside = math.log(quad(lambda x: math.exp(-slope * x - 0.5 * curvature * x**2), 0, 60 / slope)[0])
    own = 0.5 * float(np.sum((d.weak * d.offset**2)[free]))
    assert e.fit == pytest.approx(d.density() - own, rel=1e-8)
    assert e.fit + e.parameters == pytest.approx(d.density() + d.log_priors() + width + beside, rel=1e-8)
    np.testing.assert_allclose(found.linear.offset, d.offset[free], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("free", [[True, False, False, True], [False] * 4], ids=["some free", "none free"])
@pytest.mark.parametrize("on", [[False, True, True, False], [False] * 4], ids=["two on bounds", "none"])
@pytest.mark.parametrize("gain", [0.0, 0.02])
def test_mass_beside_bounds_is_an_integral_each_the_free_ones_integrated_out(free, on, gain):
    """The one on its lower end, the other on its upper one; of two on their bounds the other is held."""
    rng, scales = np.random.default_rng(4), scales_of(straight({}))
    jac, residual = rng.standard_normal((2 * MEANS, 4)), rng.normal(0, 0.3, 2 * MEANS)
    offset, weak = np.array([0.0, 0.8, -0.6, 0.0]), np.array([0.0, 3.0, 5.0, 0.0])
    every, use = Linear(residual, jac, offset, weak), np.array(free)
    k = np.linalg.inv(covariance(scales, [GAIN], [gain]))
    j = jac[:, use]
    h = j.T @ k @ j + np.diag(weak[use])
    side, expected = np.array([1.0, 1.0, -1.0, 1.0]), 0.0
    for i in np.flatnonzero(on):

        def fall(x: float, i: Any = i) -> float:
            """Of the log of density and prior where the bound is left by x inward, the free ones where it is best."""
            moved = residual - side[i] * x * jac[:, i]
            best = -0.5 * (moved @ k @ moved - (b := j.T @ k @ moved) @ np.linalg.solve(h, b))
            first = -0.5 * (residual @ k @ residual - (b := j.T @ k @ residual) @ np.linalg.solve(h, b))
            return float(best - first - 0.5 * weak[i] * ((offset[i] + side[i] * x) ** 2 - offset[i] ** 2))

        # the straight line is that of the place itself, and of a slope that leads inside nothing is left
        slope = max(float(side[i] * (weak[i] * offset[i] - jac[:, i] @ k @ residual)), 0.0)
        curvature = -(fall(1.0) + fall(-1.0))
        x = np.linspace(0, 60 / max(slope, math.sqrt(curvature)), 400_001)
        whole = np.trapezoid(np.exp(-slope * x - 0.5 * curvature * x**2), x)
        expected += math.log(whole) - 0.5 * weak[i] * offset[i] ** 2
    ends = np.full(4, np.inf)
    resting = Resting(np.array(on), side, ends, ends)
    found = on_bounds(scales.blocked, (GAIN,), np.array([gain]), every, resting, use, h)
    assert found == pytest.approx(expected, abs=1e-5)


def test_what_neither_data_nor_prior_say_anything_of_has_no_mass_beside_its_bound():
    scales = scales_of(straight({}))
    every = Linear(np.ones(2 * MEANS), np.zeros((2 * MEANS, 1)), np.zeros(1), np.zeros(1))
    resting = Resting(np.array([True]), np.ones(1), np.zeros(1), np.full(1, np.inf))
    none = np.array([False])
    assert on_bounds(scales.blocked, (GAIN,), np.zeros(1), every, resting, none, np.zeros((0, 0))) == 0.0


def test_a_rest_is_in_pascal_where_it_is_measured_by_what_noise_makes_of_the_peak():
    """By block: all of the peak in one recording, three times that in the other."""
    bench = straight({})
    bench.y[:N] += 0.4 * np.sin(6 * DRIVE[:N])
    scales = scales_of(bench, replace(GAIN, factor=np.sin(np.arange(2.0 * MEANS))[:, None]))
    scales.size = scales.peak * np.repeat([1.0, 3.0], MEANS)
    found: Any = weigh(scales, (), Start(AT), USUAL, Course())
    y = scales.cut.mean(bench.y - found.refit.prediction)
    own = found.v[0] * found.parts[0].factor @ found.parts[0].factor.T
    share = own @ np.linalg.solve(covariance(scales, found.parts, found.v), y) / scales.size
    slopes = scales.cut.mean(bench.jacobian({}, ("a", "b"))) / scales.size[:, None]
    share -= slopes @ np.linalg.lstsq(slopes, share, rcond=None)[0]
    np.testing.assert_allclose(found.rest, share * scales.size, atol=1e-9)
