"""Sizes and priors of what a set frees, and the widths of the discrepancy's parts beside it, worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from straight_bench import GAIN, MEANS, scales_of, straight

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.scales import _span, with_priors

USUAL = Criteria()
AT = {"a": 10.0, "b": 20.0}


def root(x: np.ndarray) -> float:
    return float(np.sqrt(np.sum(x**2)))


def widths(families: tuple[str, ...], keys=(), moments=()):
    """The prior of amplitudes of these families, scatter and sagging offered as names of what two of them may be."""
    scales = scales_of(straight({}))
    scales.bench.candidates = {
        "scatter": Candidate("scatter", (), widens={"gain": 0.15}),
        "scatter/waning": Candidate("scatter", ("own.x",), form="waning"),
        "sagging": Candidate("sagging", (), widens={"slow": 0.08, "law": 0.2}),
        "push": Candidate("push", ("push.k",)),
    }
    return replace(scales, families=families, moments=moments).priors(USUAL, keys)


FAMILIES = ("law", "gain", "hysteresis", "hysteresis", "slow", "white", "peak")
SHARES = [USUAL.shares[f] for f in FAMILIES]


def test_what_has_no_name_may_be_strange_and_its_chance_is_shared():
    """Law, gain and slow have names to be wide by, a peak is never wide; three parts are left to be strange."""
    w = widths(FAMILIES)
    assert w.width.tolist() == SHARES
    assert w.chance == pytest.approx(np.array([0, 0, 1, 1, 0, 1, 0]) * USUAL.unknown / 3)
    assert w.factor == USUAL.strange


@pytest.mark.parametrize(
    ("keys", "wide", "partly"),
    [
        (("scatter",), {"gain": 0.15}, ()),
        (("scatter/waning",), {}, ("gain",)),  # another form of what gives it the name
        (("push",), {}, ()),
        (("sagging", "push"), {"slow": 0.08, "law": 0.2}, ()),
        (("scatter/waning", "sagging"), {"slow": 0.08, "law": 0.2}, ("gain",)),
    ],
)
def test_a_name_makes_its_families_wide_and_another_form_of_it_perhaps(keys, wide, partly):
    w = widths(FAMILIES, keys)
    assert w.width.tolist() == [wide.get(f, s) for f, s in zip(FAMILIES, SHARES, strict=True)]
    strange = USUAL.unknown / 3 * np.array([0, 0, 1, 1, 0, 1, 0])
    assert w.chance == pytest.approx(strange + USUAL.partly * np.array([f in partly for f in FAMILIES]))


def test_what_happened_at_once_is_as_likely_as_its_moment_and_as_wide_as_such_things_are():
    w = widths((*FAMILIES, "sudden", "sudden"), moments=(0.02, 0.03))
    assert w.chance[-2:] == pytest.approx([USUAL.unknown * 0.02, USUAL.recurs * 0.03])
    assert w.width[-2:] * w.factor[-2:] == pytest.approx(USUAL.sudden)
    assert w.width[-2:].tolist() == [USUAL.shares["sudden"]] * 2
    assert w.factor[:-2].tolist() == [USUAL.strange] * len(FAMILIES)
    assert w.chance[:-2] == pytest.approx(widths(FAMILIES).chance)


def test_families_that_a_set_names_are_those_of_its_effects_in_whatever_form():
    scales = scales_of(straight({}))
    scales.bench.candidates = {
        "scatter": Candidate("scatter", (), widens={"gain": 0.15}),
        "scatter/waning": Candidate("scatter", ("own.x",), form="waning"),
        "sagging": Candidate("sagging", (), widens={"slow": 0.08}),
    }
    assert scales.widened(()) == frozenset()
    assert scales.widened(("scatter/waning",)) == {"gain"}
    assert scales.widened(("scatter", "sagging")) == {"gain", "slow"}


def test_how_large_amplitudes_are_by_the_stress_where_they_act():
    scales = scales_of(straight({}))
    stress = scales.cut.mean(scales.bench.predict(AT))
    made, priors = with_priors(scales, ("own", "shift", "noted", "push"), {}, USUAL)
    first = np.arange(2 * MEANS) < MEANS
    for path, share, where in (("own.x", 0.3, first), ("shift.x", 0.1, first | True), ("push.k", 0.3, first | True)):
        c = scales.cut.mean(scales.bench.jacobian({}, (path,)))[:, 0]
        assert priors[path] == pytest.approx((0.0, share * root(stress[where]) / root(c)))
        assert made.free[path].prior == priors[path]
    assert priors["noted.x"] == (0.2, 0.03)
    assert made.free["a"].prior is None
    assert scales.bench.free["own.x"].prior is None  # the bench of all sets is left as it is
    assert (USUAL.usual(False), USUAL.usual(True)) == (USUAL.change, USUAL.rig) == (0.3, 0.1)


def test_an_amplitude_about_a_neutral_that_is_not_nothing():
    scales = scales_of(straight({}))
    scales.bench.start = {**scales.bench.start, "own.x": 1.5}
    _, priors = with_priors(scales, ("own",), {}, USUAL)
    assert priors["own.x"][0] == 1.5


def test_shapes_about_the_middle_of_what_is_scanned():
    """Of either sign as wide as its typical steps, or as what is scanned; positive ones in their logarithm."""
    scales, bench = scales_of(straight({})), straight({})
    free = bench.free | {f"s{i}": Free(-9.0, 9.0, 0.2) for i in (1, 2)} | {"late": Free(0.1, 100.0, 1.0, log=True)}
    scales.bench.free = free
    scales.bench.start = {**bench.start, "s1": 0.4, "s2": 0.0, "late": 3.0}
    grid = ({"bend.onset": 0.3, "s2": -2.0}, {"bend.onset": 0.7, "s2": 1.0}, {"s2": 0.7})
    scales.bench.candidates = {"bend": Candidate("bend", ("bend.k",), ("bend.onset", "s1", "s2", "late"), grid)}
    _, priors = with_priors(scales, ("bend",), {}, USUAL)
    assert priors["bend.onset"] == pytest.approx((math.log(0.21) / 2, math.hypot(math.log(5), math.log(7 / 3) / 2)))
    assert priors["s1"] == pytest.approx((0.4, 5 * 0.2))  # nothing scanned: about where it begins
    assert priors["s2"] == pytest.approx((-0.1, 3.0))
    assert priors["late"] == pytest.approx((math.log(3.0), math.log(5)))


def test_where_an_amplitude_does_nothing_as_it_is_the_shapes_scanned_are_asked_in_their_order():
    scales = scales_of(straight({}))
    usual, dead = scales.bench.jacobian, {0.3, 0.01}

    def jacobian(values, paths, recordings=None):
        out = usual(values, paths, recordings)
        out[:, [p == "bend.k" and values["bend.onset"] in dead for p in paths]] = 0.0
        return out

    scales.bench.jacobian = jacobian
    bend = scales.bench.candidates["bend"]
    size = scales.effect_size(bend, {"bend.onset": 0.01}, USUAL)["bend.k"]
    late = scales.cut.mean(scales.bench.column("bend.k", 0.7))
    stress = scales.cut.mean(scales.bench.predict(AT))[late != 0]
    assert size == pytest.approx(USUAL.change * root(stress) / root(late))
    dead.add(0.7)
    assert scales.effect_size(bend, {"bend.onset": 0.01}, USUAL)["bend.k"] == scales.bench.free["bend.k"].scale


@pytest.mark.parametrize("broken", [np.inf, 1e200])
def test_a_slope_beyond_all_numbers_gives_no_size(broken):
    scales = scales_of(straight({}))
    scales.bench.jacobian = lambda values, paths, recordings=None: np.full((len(scales.bench.y), len(paths)), broken)
    assert scales.effect_size(scales.bench.candidates["own"], {}, USUAL) == {"own.x": 0.1}


def test_about_a_prediction_come_the_parts_and_what_the_simulation_has_wrong():
    """By column where its sign is known, of each block alone where it is not."""
    bench = straight({})
    bench.__class__ = type("Simulated", (type(bench),), {"numerical": None})
    scales = scales_of(bench)
    assert scales.about(bench.y, bench) == (GAIN,)
    mesh, speed = np.linspace(0, 1, 60), np.stack([np.ones(60), np.linspace(1, 2, 60)], axis=1)
    bench.__class__.numerical = {"mesh": mesh, "speed": speed}
    of, own, columns = scales.about(bench.y, bench)
    assert of is GAIN
    assert (own.name, own.family, columns.name, columns.family) == ("mesh", "numerical", "speed", "numerical")
    np.testing.assert_allclose(columns.factor, scales.cut.mean(speed))
    for block, rows in zip(own.within, scales.blocked.rows, strict=True):
        np.testing.assert_allclose(block, np.diag(scales.cut.mean(mesh)[rows] ** 2))
    assert own.factor is None


def test_rows_noise_and_peak_are_those_of_the_means():
    bench = straight({})
    bench.sigma = np.linspace(0.01, 0.05, 60)
    scales = scales_of(bench)
    assert scales.blocked.rows == (slice(0, MEANS), slice(MEANS, 2 * MEANS))
    starts = [*scales.cut.starts, 60]
    expected = [root(bench.sigma[a:b]) / (b - a) for a, b in zip(starts, starts[1:], strict=False)]
    np.testing.assert_allclose(scales.blocked.sigma, expected)
    assert scales.blocked.shared is None
    assert scales.size is None
    assert scales.peak == max(np.quantile(np.abs(bench.y[s.rows]), USUAL.means.peak) for s in bench.segments)
    assert scales.families == ("gain",)
    bench.y[:] = 0.0
    assert scales_of(bench).peak == 1.0


def test_what_a_simulation_leaves_is_held_against_a_share_of_its_noise_too():
    bench = straight({})
    bench.__class__ = type("Costly", (type(bench),), {"costly": True, "shared": np.array([0.1, 0.2])})
    bench.sigma = np.where(np.arange(60) < 30, 0.01, 5.0)
    scales = scales_of(bench)
    noisy = USUAL.unseen / USUAL.negligible * 5.0
    np.testing.assert_allclose(scales.size, [scales.peak] * MEANS + [max(noisy, scales.peak)] * MEANS)
    assert noisy > scales.peak
    assert scales.blocked.shared.tolist() == [0.1, 0.2]


def test_a_basis_spans_what_slopes_do_and_leaves_out_what_is_rounding(rng):
    a = rng.standard_normal((9, 2))
    slopes = np.column_stack([a[:, 0] * 1e5, a[:, 1] * 1e-4, np.zeros(9), a[:, 0] + a[:, 1] * 1e-9])
    basis = _span(slopes)
    assert basis.shape == (9, 2)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(basis @ (basis.T @ a), a, atol=1e-8)
    assert _span(np.zeros((9, 2))).shape == (9, 0)


def test_lasting_parts_are_all_but_what_happened_at_once():
    scales = replace(scales_of(straight({})), families=("law", "sudden", "gain"))
    assert scales.lasting.tolist() == [True, False, True]
