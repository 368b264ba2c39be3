"""Fits that a page shows against least squares by hand: where they lie, what they predict and leave, who gets one."""

import contextlib
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from straight_bench import GAIN, MEANS, N, Straight, covariance, scales_of, straight

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement import answer as module
from tissuejax.diagnosis.judgement.answer import Answered, _share, answer, evidence_file, shown_fit
from tissuejax.diagnosis.judgement.carried import between
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.estimation.discrepancy import Part

AT = {"a": 10.0, "b": 20.0}
LAW = Part("law", "law", factor=np.tile(np.sin(np.linspace(0, 6, MEANS)), 2)[:, None] * 2)
ERRS = Part("effects", "effect", factor=np.cos(np.arange(2.0 * MEANS))[:, None])
PARTS: Any = (GAIN, LAW, ERRS)
V = np.array([0.01, 0.03, 0.02])
Answer: Any = Answered


def shown(bench: Straight, keys: tuple[str, ...], values: dict[str, float], **more) -> tuple[Any, Any]:
    """An answer with this set weighed, and the bench it was weighed on."""
    bench.fitted, bench.held_out = more.pop("fitted", ("p", "q")), more.pop("held_out", ())
    scales = scales_of(bench, *PARTS)
    fit = SimpleNamespace(values=values)
    weighed = SimpleNamespace(refit=fit, parts=PARTS, v=V, bench=more.pop("on", None))
    exploration = SimpleNamespace(
        weighed={frozenset(keys): weighed}, scales=scales, effort=Effort(), criteria=Criteria()
    )
    return Answer(bench, exploration, None, SimpleNamespace(chosen=SimpleNamespace(keys=keys)), **more), scales


def paths(keys: tuple[str, ...], bench: Straight) -> tuple[str, ...]:
    return ("a", "b", *(p for k in keys for p in bench.candidates[k].paths))


def least(bench: Straight, names: tuple[str, ...], fitted: tuple[str, ...]) -> np.ndarray:
    rows = bench.mask(fitted)
    return np.linalg.lstsq(bench.jacobian({}, names)[rows], bench.y[rows], rcond=None)[0]


@pytest.mark.parametrize("keys", [(), ("own",), ("push", "own")])
@pytest.mark.parametrize(("fitted", "held_out"), [(("p", "q"), ()), (("p",), ("q",))])
def test_a_set_is_shown_where_it_comes_nearest_to_the_fitted_recordings(keys, fitted, held_out):
    """By least squares of single samples; errors are those under the whole discrepancy."""
    bench = straight({"own.x": 0.3, "push.k": 2.0 * ("push" in keys)}, seed=3)
    bench.sigma = np.where(np.arange(2 * N) < N, 0.05, 0.08)
    names = paths(keys, bench)
    values = dict(zip(names, np.full(len(names), 0.5), strict=True)) | AT
    out, scales = shown(bench, keys, values | {"stranger.x": 1.0}, fitted=fitted, held_out=held_out)
    fit = shown_fit(out, keys)
    rows = bench.mask(fitted)
    weight = 1 / bench.sigma[rows, None]
    jac = bench.jacobian({}, names)
    best = np.linalg.lstsq(jac[rows] * weight, bench.y[rows] * weight[:, 0], rcond=None)[0]
    np.testing.assert_allclose([fit.values[p] for p in names], best, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(fit.prediction[rows], (jac @ best)[rows], atol=1e-6)
    z = (bench.y - jac @ best) / bench.sigma
    assert fit.chi2 == pytest.approx(np.sum(z[rows] ** 2), rel=1e-6)
    assert (fit.n, fit.n_held) == (int(np.sum(rows)), int(np.sum(~rows)))
    assert fit.held == pytest.approx(np.sum(z[~rows] ** 2), rel=1e-4)
    assert fit.converged
    if keys:
        blocks = slice(0, int(np.sum(rows)) // 2)
        j = scales.cut.mean(jac)[blocks]
        k = covariance(scales, PARTS, V)[blocks, blocks]
        std = np.sqrt(np.diag(np.linalg.inv(j.T @ np.linalg.solve(k, j))))
        np.testing.assert_allclose([fit.std[p] for p in names], std, rtol=1e-6)
    assert out.refits == {frozenset(keys): fit}
    assert out.plain[frozenset(keys)].values == fit.values
    whitening = out.whitenings[frozenset(keys)]
    assert (whitening.parts, whitening.v.tolist(), whitening.named) == (PARTS, V.tolist(), frozenset())


def taken_up(scales, v: np.ndarray, named: tuple[str, ...], left: np.ndarray) -> np.ndarray:
    """Posterior mean of the named parts given block means of what is left, straight between their middles."""
    weight = np.linalg.solve(covariance(scales, PARTS, v), scales.cut.mean(left))
    own = sum(x * p.factor @ (p.factor.T @ weight) for p, x in zip(PARTS, v, strict=True) if p.family in named)
    return between(scales.cut, np.reshape(own, (-1, 1)))[:, 0]


@pytest.mark.parametrize("family", ["gain", "law"])
@pytest.mark.parametrize("missing", [0.0, 0.5])
def test_what_a_name_widens_is_fitted_after_the_parameters_or_with_them_whichever_comes_nearer(family, missing):
    """Of each recording's own it reaches no other and is fitted after them alone; what is shared also together with
    them, alone or beside all parts but what laws of effects err by."""
    bench = straight({}, seed=4)
    bench.candidates["named"] = Candidate("named", (), widens={family: 0.2})
    bench.y = bench.y + missing * np.tile(np.sin(np.linspace(0, 6, N)), 2)
    out, scales = shown(bench, ("named",), AT)
    fit = shown_fit(out, ("named",))
    jac, mean = bench.jacobian({}, ("a", "b")), scales.cut.mean
    own = np.array([x * (p.family == family) for p, x in zip(PARTS, V, strict=True)])
    exact = V * [1, 1, 0]
    tries = [(least(bench, ("a", "b"), ("p", "q")), own)]
    if family == "law":
        for v in (own, exact):
            k, j = np.linalg.inv(covariance(scales, PARTS, v)), mean(jac)
            tries.append((np.linalg.solve(j.T @ k @ j, j.T @ k @ mean(bench.y)), v))
    ends = []
    for theta, v in tries:
        line = jac @ theta
        prediction = line + taken_up(scales, v, (family,), bench.y - line)
        ends.append((np.sum(((bench.y - prediction) / bench.sigma) ** 2), theta, prediction))
    chi2, theta, prediction = min(ends, key=lambda e: e[0])
    np.testing.assert_allclose([fit.values["a"], fit.values["b"]], theta, rtol=1e-5)
    np.testing.assert_allclose(fit.prediction, prediction, atol=1e-5)
    assert fit.chi2 == pytest.approx(chi2, rel=1e-5)
    np.testing.assert_allclose(out.plain[frozenset({"named"})].prediction, prediction, atol=1e-5)


@pytest.mark.parametrize("family", ["gain", "law", "added law"])
def test_beside_what_a_name_widens_parameters_are_fitted_alone_with_it_and_with_all_that_is_no_effect_s(
    monkeypatch, family
):
    """What is each recording's own is only fitted after them."""
    bench, taken, beside = straight({}, seed=4), [], []
    bench.candidates["named"] = Candidate("named", (), widens={family: 0.2})
    out, _ = shown(bench, ("named",), AT)
    w = out.exploration.weighed[frozenset({"named"})]
    w.parts, w.v = (*PARTS, Part("turn", "added law", factor=LAW.factor)), np.append(V, 0.04)
    carried, nearest = module.carried, module.nearest

    def tried(whitening, left):
        taken.append(whitening.v.tolist())
        return carried(whitening, left)

    def fitted(on, model, keys, starts, steps):
        beside.append((getattr(model, "v", np.zeros(0)).tolist(), [dict(s) for s in starts], steps))
        return nearest(on, model, keys, starts, steps)

    monkeypatch.setattr(module, "carried", tried)
    monkeypatch.setattr(module, "nearest", fitted)
    shown_fit(out, ("named",))
    own = [float(x) * (p.family == family) for p, x in zip(w.parts, w.v, strict=True)]
    both = [] if family == "gain" else [own, [0.01, 0.03, 0.0, 0.04]]
    assert taken[:-1] == [own, *both]
    assert taken[-1] in taken[:-1]
    assert [v for v, *_ in beside] == [[], *both]
    for _, (first, second, third), steps in beside:
        assert (first, third, steps) == (AT, {}, Effort().shown)
        assert set(second) == {"a", "b"}
        assert second != first


def test_of_two_recordings_each_counts_over_its_noise_or_over_what_nobody_asks():
    """Of one the noise, of the other half a per cent of its range."""
    bench = straight({})
    first = np.arange(2 * N) < N
    bench.sigma = np.where(first, 2.0, 1e-3)
    out, _ = shown(bench, ("own",), AT)
    missed = [np.where(first, a, b) for a, b in ((8.0, 1.0), (3.0, 0.4))]
    keys = (frozenset(), frozenset({"own"}))
    out.refits = {k: SimpleNamespace(prediction=bench.y - m) for k, m in zip(keys, missed, strict=True)}
    unseen = (0.005 * (np.max(bench.y[N:]) - np.min(bench.y[N:]))) ** 2
    before, after = (N * ((a**2 - 4) / 4 + (b**2 - 1e-6) / unseen) for a, b in ((8.0, 1.0), (3.0, 0.4)))
    assert out.explained == (pytest.approx(1 - after / before), 0.0)
    assert 0.1 < 64 / 4 * unseen < 10  # both count


def test_where_predictions_are_costly_the_set_is_shown_under_its_discrepancy():
    """Corrected as it was weighed, and anew where it rests unless the fine simulation breaks down there."""
    bench, taken = straight({"own.x": 0.3}, seed=5), []

    def corrected_as(self, other):
        taken.append(other)
        return self

    bench.__class__ = type("Costly", (type(bench),), {"costly": True, "corrected_as": corrected_as})
    out, scales = shown(bench, ("own",), {**AT, "own.x": 0.2}, on="as it was weighed")
    fit = shown_fit(out, ("own",))
    names = ("a", "b", "own.x")
    j, k, y = scales.cut.mean(bench.jacobian({}, names)), covariance(scales, PARTS, V), scales.cut.mean(bench.y)

    def chi2(theta) -> float:
        left = y - j @ np.array(theta)
        return float(left @ np.linalg.solve(k, left))

    best = chi2(np.linalg.solve(j.T @ np.linalg.solve(k, j), j.T @ np.linalg.solve(k, y)))
    assert best <= chi2([fit.values[p] for p in names]) < best + 0.1  # where a step promises less a fit ends
    assert chi2(least(bench, names, ("p", "q"))) > best + 0.1
    assert taken == ["as it was weighed"]
    out.exploration.weighed[frozenset({"own"})].bench = None
    shown_fit(out, ("own",))
    assert taken[1] is bench


@pytest.mark.parametrize("broken", ["at the start", "where it rests"])
def test_a_fit_is_shown_of_the_simulation_that_runs(broken):
    bench, times = straight({}, seed=6), []

    def anchored(self, values):
        times.append(dict(values))
        made: Any = straight({}, seed=6)
        fails = broken == "at the start" or len(times) > 1
        made.predict = lambda v, recordings=None: np.full(2 * N, np.nan) if fails else bench.predict(v)
        return made

    bench.__class__ = type("Broken", (type(bench),), {"anchored": anchored})
    out, _ = shown(bench, (), {"a": 9.0, "b": 25.0})
    fit = shown_fit(out, ())
    assert times[0] == {"a": 9.0, "b": 25.0}
    np.testing.assert_allclose([fit.values["a"], fit.values["b"]], least(bench, ("a", "b"), ("p", "q")), rtol=1e-5)
    assert np.all(np.isfinite(fit.prediction))


def test_a_page_is_in_si_units():
    """Three times as large and seven more than the bench that is fitted."""
    bench = straight({}, seed=7)
    si = straight({}, seed=7)
    si.y, si.sigma = 3 * bench.y + 7, 3 * bench.sigma
    more = {"shown": property(lambda self: si), "natural": lambda self, x: 3 * x + 7}
    bench.__class__ = type("View", (type(bench),), more)
    out, scales = shown(bench, (), AT)
    fit = shown_fit(out, ())
    line = bench.jacobian({}, ("a", "b")) @ least(bench, ("a", "b"), ("p", "q"))
    np.testing.assert_allclose(fit.prediction, 3 * line + 7, atol=1e-4)
    assert fit.chi2 == pytest.approx(np.sum(((bench.y - line) / bench.sigma) ** 2))
    assert out.bench is si
    assert out.misfit.bench is si
    assert out.empty is out.chosen is fit
    weighed = out.exploration.weighed[frozenset()]
    weighed.rest = np.linspace(0, 1, 2 * MEANS)
    out.judgement.negligible = 0.5
    out.judgement.chosen.amplitudes, out.judgement.chosen.kurtosis = dict.fromkeys(("gain", "law", "effects"), 0.1), 0.0
    told = out.rest()
    rms = math.sqrt(np.sum(weighed.rest**2 * scales.cut.counts) / (2 * N))
    assert (told["unit"], told["rms"]) == ("1", pytest.approx(rms))
    np.testing.assert_allclose(out.rest_size(), np.full(2 * N, 3 * rms), rtol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [(4.0, 1.0, 0.75), (4.0, -1.0, 1.0), (4.0, 5.0, 0.0), (0.0, 1.0, 0.0), (-1.0, -2.0, 0.0), (0.5, 0.25, 0.5)],
)
def test_a_share_of_what_was_there_before(before, after, share):
    assert _share(before, after) == share


def test_what_scatters_over_the_stated_noise():
    out, scales = shown(straight({}), (), AT)
    w = out.exploration.weighed[frozenset()]
    w.parts, w.v = (*PARTS, Part("white", "white", within=(np.eye(MEANS), np.eye(MEANS)))), np.append(V, 2e-3)
    assert out.noise_level == pytest.approx(math.sqrt(1 + np.median(2e-3 / scales.blocked.sigma**2)))


@pytest.mark.parametrize("setup", [True, False])
def test_an_answer_searches_all_recordings_and_fits_the_base_the_chosen_and_the_undecided(monkeypatch, setup):
    """Each once, to the fitted recordings, of which nothing is held for its own."""
    bench, whole, told = straight({}), straight({}), []
    bench.candidates = {"own": Candidate("own", ("own.x",), held=("own.x",)), "push": bench.candidates["push"]}
    bench.fitted, bench.held_out = ("p",), ("q",)

    @contextlib.contextmanager
    def ahead():
        told.append("ahead")
        yield
        told.append("done")

    whole.ahead = ahead
    by = Setup(criteria=Criteria(named=0.6), effort=Effort(course=Course(rounds=1))) if setup else None
    found = SimpleNamespace(bench=bench, effort=Effort(rivals=2), criteria=Criteria(), names=lambda k: ("of", k))
    found.evidence = lambda *given: told.append(given) or "evidence"
    found.scored = {"scored": []}

    def explore(*given):
        told.append(given)
        return found

    judgement = SimpleNamespace(chosen=SimpleNamespace(keys=("own",)), kind=Kind.FOUND, confidence=0.7)
    judged = []
    monkeypatch.setattr(module, "explore", explore)
    monkeypatch.setattr(module, "judge", lambda *given: judged.append(given) or judgement)
    monkeypatch.setattr(module, "undecided", lambda *_: (("push",), (), ("own", "push")))
    fits = []
    monkeypatch.setattr(module, "shown_fit", lambda out, keys: fits.append((out, keys)))
    ask: Any = answer
    out = ask(bench, whole, "cut", "of", by)
    assert told[0] == "ahead"
    assert told[1][:3] == (whole, "cut", "of")
    assert told[1][3] == by if setup else told[1][3].criteria == Criteria()
    assert told[2:] == ["done", (("p",), ("q",))]
    assert judged == [("evidence", told[1][3].criteria)]
    assert [keys for _, keys in fits] == [(), ("own",), ("push",)]
    assert all(o is out for o, _ in fits)
    assert out.fitting is not bench
    assert {k: c.held for k, c in out.fitting.candidates.items()} == {"own": (), "push": ()}
    assert bench.candidates["own"].held == ("own.x",)
    assert (out.exploration, out.evidence, out.judgement) == (found, "evidence", judgement)
    assert (out.kind, out.confidence, out.scored) == (Kind.FOUND, 0.7, found.scored)
    assert out.names(frozenset({"own"})) == ("of", {"own"})
    out.refits = {frozenset({"push"}): "of push", frozenset(): "of the base"}
    assert out.rivals == ("of push", "of the base")


def test_evidence_lies_beside_the_result(tmp_path):
    assert evidence_file(tmp_path) == tmp_path / "evidence.json"
