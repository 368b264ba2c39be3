"""How fit and amplitudes take turns: what each is asked for, when the last turn is, and where a set has no density."""

import copy
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from straight_bench import DRIVE, GAIN, MEANS, SIGMA, N, scales_of, straight

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement import weigh as module
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course
from tissuejax.diagnosis.judgement.marginal import Blocked, Linear, Widths, marginal
from tissuejax.diagnosis.judgement.ranges import beside
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.weigh import Start, kurtosis, weigh
from tissuejax.estimation.discrepancy import Part

USUAL = Criteria()
climb_of: Any = module.climb
idle: Any = module._idle
AT = {"a": 10.0, "b": 20.0}
ERRS = Part("effects", "effect", factor=np.linspace(0, 1, 2 * MEANS)[:, None])


class Asked:
    """What weighing asks of fits, of the discrepancy and of the climb to its amplitudes."""

    def __init__(self, monkeypatch, scales: Scales):
        self.fits, self.about, self.climbs = [], [], []
        for name, into in (("refit", self.fits), ("climb", self.climbs)):
            monkeypatch.setattr(module, name, self.told(getattr(module, name), into))
        scales.about = self.told(scales.about, self.about)

    @staticmethod
    def told(real, into):
        def call(*given, **more):
            out = real(*given, **more)
            into.append((given, more, out))
            return out

        return call


def means(scales: Scales, values, *paths: str) -> np.ndarray:
    return scales.cut.mean(scales.bench.jacobian(values, paths))


def assert_known(scales: Scales, fit, seed: np.ndarray, values, *paths: str) -> None:
    """Whether the slopes that a fit begins with are those at `values`, under the covariance that it fits beside."""
    raw, (_, misfit, *_) = means(scales, values, *paths), fit
    k = np.diag(scales.blocked.sigma**2)
    k += sum(x * p.factor @ p.factor.T for x, p in zip(misfit.v, misfit.parts, strict=True))
    np.testing.assert_allclose(seed.T @ seed, raw.T @ np.linalg.solve(k, raw), rtol=1e-7)


def test_each_turn_fits_beside_the_amplitudes_of_the_one_before(monkeypatch):
    """The first beside those of the prior, but for what laws of effects err by: before a fit there is none."""
    scales = scales_of(straight({"own.x": 0.3}), GAIN, ERRS)
    asked = Asked(monkeypatch, scales)
    course = Course(rounds=3, iterations=7, settled=-math.inf, first=0.4, later=0.2)
    weigh(scales, ("own",), Start({**AT, "own.x": 0.3}), USUAL, course)
    widths = np.array([USUAL.shares["gain"], USUAL.shares["effect"]])
    assert len(asked.fits) > 1
    before = [widths**2 * [1, 0], *(out[0] for *_, out in asked.climbs)]
    for (given, more, _), v in zip(asked.fits, before, strict=False):
        np.testing.assert_allclose(given[1].v, v)
        assert (more["iterations"], more["errors"]) == (7, False)
    assert asked.fits[0][1]["seed"] is None
    for (given, more, _), (*_, last) in zip(asked.fits[1:], asked.fits, strict=False):
        assert_known(scales, given, more["seed"], last.values, "a", "b", "own.x")
    assert [more["tolerance"] for _, more, _ in asked.fits] == [0.4, *[0.2] * (len(asked.fits) - 1)]
    begun = [given[3] for given, *_ in asked.fits]
    assert begun == [{**AT, "own.x": 0.3}, *(out.values for *_, out in asked.fits[:-1])]
    assert [given[5] for given, *_ in asked.climbs] == [{"wide"}, *[{"there"}] * (len(asked.climbs) - 1)]
    assert {given[6].settled for given, *_ in asked.climbs} == {-math.inf}


def test_where_predictions_are_costly_both_starts_of_the_amplitudes_are_tried_and_fits_are_as_rough_as_the_first(
    monkeypatch,
):
    bench = straight({"bend.k": 30.0})
    bench.__class__ = type("Costly", (type(bench),), {"costly": True})
    scales = scales_of(bench)
    scales.values, scales.reference = AT, scales.cut.mean(np.asarray(bench.predict(AT)))
    asked = Asked(monkeypatch, scales)
    start = Start({**AT, "bend.k": 30.0, "bend.onset": 0.7})
    found = weigh(scales, ("bend",), start, USUAL, Course(settled=-math.inf, first=0.4))
    assert len(asked.fits) > 1
    assert {more["tolerance"] for _, more, _ in asked.fits} == {0.4}
    assert all(more["seed"] is None for _, more, _ in asked.fits)
    assert [given[5] for given, *_ in asked.climbs] == [{"wide", "there"}, *[{"there"}] * (len(asked.climbs) - 1)]
    # the prior of its amplitude goes by the shape it began with
    c, stress = scales.cut.mean(bench.column("bend.k", 0.7)), scales.reference
    size = 0.3 * math.sqrt(np.sum(stress[c != 0] ** 2) / np.sum(c**2))
    assert found.refit.values["bend.onset"] != pytest.approx(0.7, abs=0.01)
    assert (found.bench or bench).free["bend.k"].prior == pytest.approx((0.0, size))


def test_parts_are_about_the_fit_and_across_what_its_free_constants_of_the_tissue_do(monkeypatch):
    """What rests on a bound and what is a fault of the rig are left out; slopes of the base come by themselves."""
    scales = scales_of(straight({"push.k": -2.0, "shift.x": 0.2}, seed=5), GAIN, ERRS)
    asked = Asked(monkeypatch, scales)
    found = weigh(scales, ("shift", "push", "own"), Start(AT), USUAL)
    assert found.evidence.at_bound == ("push.k",)
    (first, _, _), *later = asked.about
    np.testing.assert_array_equal(first[0], scales.bench.predict(AT))
    assert first[2:] == (("shift", "push", "own"), AT)
    assert len(later) == len(asked.fits)
    for (given, _, _), (*_, fit) in zip(later, asked.fits, strict=True):
        np.testing.assert_array_equal(given[0], fit.prediction)
        assert given[3] == fit.values
        np.testing.assert_allclose(given[4], means(scales, fit.values, "a", "b", "own.x"))
        np.testing.assert_allclose(given[5], means(scales, fit.values, "a", "b"))


@pytest.mark.parametrize(
    ("v", "costly", "resumed"),
    [((1e-4, 1e-4), False, True), ((1e-4, 0.0), False, False), (None, False, False), ((1e-4, 1e-4), True, False)],
)
def test_a_set_that_came_to_rest_before_goes_on_beside_what_its_laws_err_by(monkeypatch, v, costly, resumed):
    """From the slopes at that place, which are the first of its fit too."""
    bench = straight({"shift.x": 0.2, "bend.k": 20.0})
    if costly:
        bench.__class__ = type("Costly", (type(bench),), {"costly": True})
    scales = scales_of(bench, GAIN, ERRS)
    asked = Asked(monkeypatch, scales)
    at = {**AT, "shift.x": 0.2, "bend.k": 15.0}
    start = Start(AT, v=None if v is None else np.array(v), at=at)
    found = weigh(scales, ("shift", "bend"), start, USUAL, Course(rounds=1, iterations=0))
    (given, _, _), (fit, more, _) = asked.about[0], asked.fits[0]
    whole = at | {"bend.onset": 0.3, "shift.y": 0.0}
    np.testing.assert_allclose(given[0], bench.predict(whole))
    assert fit[3] == at
    if resumed:
        np.testing.assert_allclose(given[4], means(scales, whole, "a", "b", "bend.k", "bend.onset"))
        assert given[3] == whole
        assert_known(scales, fit, more["seed"], whole, "a", "b", "shift.x", "shift.y", "bend.k", "bend.onset")
        assert fit[1].v.tolist() == list(v or ())
    else:
        assert more["seed"] is None
        assert fit[1].v[1] == 0.0
    assert asked.climbs[0][0][5] == ({"wide"} if v is None else {"there"})
    assert found.begun == AT


def test_where_slopes_are_beyond_all_numbers_a_set_is_begun_as_if_it_were_new(monkeypatch):
    bench = straight({})
    scales = scales_of(bench, GAIN, ERRS)
    usual = bench.jacobian
    bench.jacobian = lambda values, paths, recordings=None: usual(values, paths) * (1e200 if len(paths) > 1 else 1.0)
    asked = Asked(monkeypatch, scales)
    found = weigh(scales, ("own",), Start(AT, v=np.array([1e-4, 1e-4])), USUAL, Course(rounds=1, iterations=0))
    assert len(asked.about[0][0]) == 4
    assert asked.fits[0][1]["seed"] is None
    assert (found.evidence.log_evidence, len(asked.about)) == (-math.inf, 1)


class Stepwise:
    """Turns that stay at one place and come to a mass over the amplitudes that is written down beforehand."""

    def __init__(self, monkeypatch, masses: list[float]):
        self.scales, coming, turns = scales_of(straight({})), iter(masses), []
        real = module.refit
        monkeypatch.setattr(module, "refit", lambda *a, **b: turns.append(1) or real(*a, **b))
        monkeypatch.setattr(module, "amplitude_mass", lambda *_: next(coming))

        def still(linear, parts, widths, blocked, v, begin, course):
            return np.zeros(1), marginal(linear, parts, np.zeros(1), blocked)

        monkeypatch.setattr(module, "climb", still)
        self.turns = turns

    def weigh(self, at=AT, **course):
        return weigh(self.scales, (), Start(at), USUAL, Course(iterations=0, **course)).evidence


@pytest.mark.parametrize(
    ("masses", "course", "turns", "kept"),
    [
        ([0.0, 1.0, 2.0, 3.0, 4.0], {}, 4, 3.0),
        ([0.0, 1.0, 2.0, 3.0, 4.0], {"rounds": 2}, 2, 1.0),
        ([0.0, 1.0, 1.09, 3.0], {}, 3, 1.09),
        ([0.0, 1.0, 1.11, 3.0], {}, 4, 3.0),
        ([0.0, 1.0, 1.3, 3.0], {"settled": 0.4}, 3, 1.3),
        ([2.0, 1.0, 9.0, 9.0], {}, 2, 2.0),
        ([2.0, 2.0, 9.0, 9.0], {"settled": -1.0}, 2, 2.0),
        ([2.0, 2.0 + 0.9e-6, 9.0, 9.0], {"settled": -1.0}, 2, 2.0),
        ([2.0, 2.0 + 1.1e-6, 2.0, 9.0], {"settled": -1.0}, 3, 2.0 + 1.1e-6),
    ],
)
@pytest.mark.parametrize("at", [AT, {"a": 10.5, "b": 20.0}], ids=["likely", "unlikely"])
def test_turns_end_where_one_gains_less_than_is_asked(monkeypatch, masses, course, turns, kept, at):
    """In nats: a tenth is the usual, and less than a millionth is none at all."""
    made = Stepwise(monkeypatch, masses)
    found = made.weigh(at, **course)
    assert found.discrepancy == pytest.approx(kept, abs=1e-12)
    assert (found.log_evidence > 0) == (at is AT)
    assert len(made.turns) == turns


@pytest.mark.parametrize(("above", "turns"), [(-0.01, 2), (0.01, 1)])
def test_a_set_is_hopeless_where_not_even_a_straight_line_leads_above_the_floor(monkeypatch, above, turns):
    """Off the best fit by d, H the precision there: d'Hd/2 above where it is."""
    made = Stepwise(monkeypatch, [0.0, 1.0, 1.0])
    at = {"a": 10.3, "b": 19.0}
    low = made.weigh(at, rounds=1).log_evidence
    jac, y = means(made.scales, AT, "a", "b"), made.scales.cut.mean(made.scales.bench.y)
    sigma = made.scales.blocked.sigma[:, None]
    best = np.linalg.lstsq(jac / sigma, y / sigma[:, 0], rcond=None)[0] - [10.3, 19.0]
    lead = 0.5 * float(np.sum(((jac / sigma) @ best) ** 2))
    assert lead > 1
    masses = iter([0.0, 1.0])
    monkeypatch.setattr(module, "amplitude_mass", lambda *_: next(masses))
    made.turns.clear()
    made.weigh(at, floor=low + lead + above, rounds=2)
    assert len(made.turns) == turns


def test_an_impossible_set_has_no_density_no_fit_and_no_rest():
    bench = straight({})
    bench.predict = lambda values, recordings=None: np.full(2 * N, np.nan)
    scales = scales_of(straight({}), GAIN, ERRS)
    scales.bench.predict = bench.predict
    scales.bench.candidates["own/late"] = Candidate("own", ("own.x",), form="late")
    w = weigh(scales, ("own", "push", "own/late"), Start(AT), USUAL)
    e, fit = w.evidence, w.refit
    assert (e.keys, e.names) == (("own", "push", "own/late"), ("own", "push"))
    assert (e.log_evidence, e.fit, e.parameters, e.discrepancy) == (-math.inf, -math.inf, 0.0, 0.0)
    assert (e.amplitudes, e.k, e.at_bound, e.void, e.chi2, e.n) == ({}, 0, (), True, math.inf, 2 * MEANS)
    assert (e.kurtosis, e.explained, e.rest, e.scattered, e.numerical, e.free) == (0, 0, (0, 0), (0, 0), 0, ())
    assert (fit.keys, fit.values, fit.own, fit.std, fit.at_bound) == (e.keys, {}, {}, {}, ())
    assert (fit.chi2, fit.n, fit.held, fit.n_held, fit.converged) == (math.inf, 2 * MEANS, math.inf, 0, False)
    assert len(fit.prediction) == 2 * N
    assert np.all(np.isnan(fit.prediction))
    assert (w.v.tolist(), w.parts, w.rest.tolist(), w.linear, w.bench) == ([0.0, 0.0], (), [0.0] * 30, None, None)


@pytest.mark.parametrize(("times", "possible"), [(999.0, True), (1001.0, False)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_prediction_of_a_thousand_times_the_peak_has_no_density(times, possible, sign):
    scales = scales_of(straight({}))
    far = sign * times * scales.peak / np.max(np.abs(DRIVE))
    found = weigh(scales, (), Start({"a": far, "b": 0.0}), USUAL, Course(rounds=1, iterations=0))
    assert math.isfinite(found.evidence.log_evidence) == possible


@pytest.mark.parametrize(("anchor", "asked"), [(True, "anchored"), (False, "nearer")])
def test_a_correction_is_taken_anew_where_the_fit_rests_unless_it_is_only_followed(anchor, asked):
    bench, taken = straight({}), []

    def corrected(name):
        def at(self, values):
            taken.append((name, dict(values)))
            return copy.copy(self)

        return at

    names = ("anchored", "nearer")
    bench.__class__ = type("Corrected", (type(bench),), {n: corrected(n) for n in names})
    found = weigh(scales_of(bench), (), Start(AT), USUAL, Course(rounds=1, anchor=anchor))
    assert found.settled == anchor
    assert taken[0] == (asked, AT)
    assert taken[1:] == ([("anchored", found.refit.values)] if anchor else [])


def test_the_share_explained_lies_between_all_and_less_than_nothing():
    """Of a base that leaves noise alone nothing can be explained, and what a worse fit leaves is all of it and more."""
    for at, n, expected in (({"a": 12.0, "b": 20.0}, 1, -1.0), (AT, 2, 1.0)):
        bench = straight({}, seed=3, sigma=SIGMA)
        if n == 2:  # less than the stated noise
            bench.y = bench.predict(AT) + 0.1 * (bench.y - bench.predict(AT))
        found = weigh(scales_of(bench), (), Start(at), USUAL, Course(rounds=1, iterations=0))
        assert found.evidence.explained == expected


ONE, TWO = Part("one", "law", np.eye(4)[:, :2]), Part("two", "gain", np.zeros((4, 1)))
WITHIN = Part("in", "slow", within=(np.eye(4),))


@pytest.mark.parametrize(
    ("begin", "asked"),
    [
        ({"wide"}, [("widest", "v", 0.3), ("usual", "first", 0.02)]),
        ({"there"}, [("usual", "v", 0.02)]),
        ({"wide", "there"}, [("widest", "v", 0.3), ("usual", "first", 0.02), ("usual", "v", 0.02)]),
    ],
)
@pytest.mark.parametrize("better", [0, -1])
def test_amplitudes_are_sought_from_where_all_is_wide_or_from_where_they_are_and_the_better_stands(
    monkeypatch, begin, asked, better
):
    """An empty part stays at nothing."""
    widths, calls = Widths(np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.0, 0.2])), []

    def climb(linear, parts, priors, blocked, v, tolerance=0.02):
        calls.append((priors, v.tolist(), tolerance))
        # of evidence 7 and less, where the prior at 0.01 and 4 differs by far more than one
        value = 7.0 if len(calls) == 2 else 6.0 + 1e4 * (better == 0)
        return np.array([0.01 * len(calls), 0.0, 0.0]), SimpleNamespace(value=value)

    monkeypatch.setattr(module, "amplitudes", climb)
    monkeypatch.setattr(module, "uphill", lambda *_: 1.0)
    v, m = climb_of(
        None, (ONE, TWO, WITHIN), widths, None, np.array([4.0, 5.0, 6.0]), frozenset(begin), Course(settled=0.3)
    )
    begun = {"v": [4.0, 0.0, 6.0], "first": [0.01, 0.0, 0.0]}
    for (priors, at, tolerance), (which, where, least) in zip(calls, asked, strict=True):
        expected = widths.widest if which == "widest" else widths
        np.testing.assert_array_equal(priors.width, expected.width)
        np.testing.assert_array_equal(priors.chance, expected.chance)
        assert (at, tolerance) == (begun[where], least)
    last = len(calls) if better == 0 or len(begin) == 1 else 2
    assert v.tolist() == [0.01 * last, 0.0, 0.0]
    assert m.value == (7.0 if last == 2 else 6.0 + 1e4 * (better == 0))


def test_the_better_amplitudes_are_those_of_evidence_and_prior_together(monkeypatch):
    """Ten widths off the prior costs fifty nats, and the evidence gains 49 or 51."""
    widths = Widths(np.array([0.1]), np.zeros(1))
    for gain, expected in ((49.0, 0.0), (51.0, 1.0)):
        ends = iter([(0.0, 0.0), (0.0, 0.0), (1.0, gain)])

        def climb(*_, ends=ends, **__):
            v, value = next(ends)
            return np.array([v]), SimpleNamespace(value=value)

        monkeypatch.setattr(module, "amplitudes", climb)
        v, _ = climb_of(None, (ONE,), widths, None, np.ones(1), frozenset({"wide", "there"}), Course())
        assert v[0] == expected


def test_amplitudes_are_found_from_where_all_is_wide(rng):
    """A gain of nine widths beside the chance of being wide: from its width alone and from wide it is the same."""
    part, n = Part("one", "law", rng.standard_normal((60, 12))), 60
    residual = part.factor @ rng.normal(0, 0.9, 12) + 0.01 * rng.standard_normal(n)
    linear = Linear(residual, np.ones((n, 1)), np.zeros(1), np.zeros(1))
    blocked, widths = Blocked((slice(0, n),), np.full(n, 0.01)), Widths(np.array([0.1]), np.array([0.1]))
    v, m = climb_of(linear, (part,), widths, blocked, np.array([0.01]), frozenset({"wide"}), Course())
    grid = np.linspace(0.3, 3.0, 2000)
    worth = [marginal(linear, (part,), np.array([x**2]), blocked).value for x in grid]
    worth += widths.log_density((grid**2)[:, None])[:, 0]
    assert math.sqrt(v[0]) == pytest.approx(grid[np.argmax(worth)], rel=0.05)
    assert m.value == pytest.approx(marginal(linear, (part,), v, blocked).value)


@pytest.mark.parametrize(("slope", "curvature"), [(0.0, 0.0), (1e-9, 0.0), (3.0, 1e-280)])
def test_beside_a_bound_without_curvature_lies_what_the_slope_leaves(slope, curvature):
    found = beside(slope, curvature)
    assert found == pytest.approx(-math.log(slope), rel=1e-9) if slope else math.isfinite(found)


def test_a_fourth_moment_is_that_about_the_mean():
    x = np.array([3.0, 3.0, 3.0, 7.0])  # 1, 1, 1, -3 about the mean: 84 / 4 over 9
    assert kurtosis(x) == pytest.approx(21.0 / 9.0 - 3.0)


def test_what_is_felt_of_an_effect_is_the_most_of_its_amplitudes():
    """Costly: one of two amplitudes that moves the stress by more than 1e-6 of the peak is enough to save a
    simulation, in either direction; of a slope that was never taken nothing is known."""
    bench: Any = straight({})
    bench.__class__ = type("Costly", (type(bench),), {"costly": True})
    fit = SimpleNamespace(values={**AT, "shift.x": -2.0, "shift.y": 0.0}, prediction=bench.predict(AT))
    asked = []
    bench.predict = lambda values: asked.append(values) or fit.prediction
    assert not idle(bench.candidates["shift"], fit, bench, 1.0, {"shift.x": 0.6e-6, "shift.y": 1.0})
    assert not asked
    assert idle(bench.candidates["shift"], fit, bench, 1.0, {"shift.x": 0.4e-6, "shift.y": 1.0})
    assert idle(bench.candidates["shift"], fit, bench, 1.0, {})
    assert asked == [{**AT, "shift.x": 0.0, "shift.y": 0.0}] * 2


def test_a_climb_that_ends_on_a_slope_begins_anew_from_the_widths(monkeypatch):
    """Where all is wide that may be; and no other does, however much more it could gain."""
    widths = Widths(np.array([0.1, 0.2]), np.array([0.1, 0.0]))
    for steep, asked in ((10.5, 3), (9.5, 1)):
        calls = []

        def climb(linear, parts, priors, blocked, v, tolerance=0.02, calls=calls):
            calls.append((priors.width.tolist(), v.tolist(), tolerance))
            return np.array([0.01 * len(calls), 0.0]), SimpleNamespace(value=1e6 * len(calls))

        monkeypatch.setattr(module, "amplitudes", climb)
        monkeypatch.setattr(module, "uphill", lambda *_, steep=steep: steep)
        v, _ = climb_of(None, (ONE, WITHIN), widths, None, np.array([4.0, 5.0]), frozenset({"there"}), Course())
        assert calls[0] == ([0.1, 0.2], [4.0, 5.0], 0.02)
        assert len(calls) == asked
        assert v[0] == pytest.approx(0.01 * asked)
        if asked == 3:
            assert calls[1] == (widths.widest.width.tolist(), pytest.approx([0.01, 0.04]), Course().settled)
            assert calls[2] == ([0.1, 0.2], [0.02, 0.0], 0.02)
