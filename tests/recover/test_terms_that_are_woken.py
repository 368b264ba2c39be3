"""The score test of idle terms against least squares with and without the term, and who is woken, by made-up slopes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tissuejax.fitting import idle as room
from tissuejax.fitting.idle import merged, roused, terms, woken, woken_modulus


class Series:
    """Terms of effects with linear slopes made up: the column of a share is `column` of its time."""

    moduli: tuple = ()

    def __init__(self, n=2, free=None, effect="e", rng=None, priors=None):
        shares, times = (tuple(f"{kind}{i}" for i in range(1, n + 1)) for kind in ("g", "tau"))
        self.pairs = [(f"effects.{effect}.{g}", f"effects.{effect}.{t}") for g, t in zip(shares, times, strict=True)]
        made = SimpleNamespace(name=effect, shares=shares, times=times)
        plain = SimpleNamespace(name="plain")
        self.predictor = SimpleNamespace(model=SimpleNamespace(effects=(plain, made), parameters={}))
        every = ("energy.m", *(p for pair in self.pairs for p in pair), "effects.plain.x")
        self.free = every if free is None else free
        self.priors = priors or {}
        rng = rng or np.random.default_rng(1)
        self.r, self.other = rng.normal(size=20), rng.normal(size=(20, 2)) * [1e5, 1e-3]
        self.s = np.linspace(0, 5, 20)

    def bound(self, path):
        return 0.02, 20.0

    def column(self, tau):
        return np.exp(-self.s / tau) * 30.0

    def linearised(self, values):
        """Of all free ones; a share of a thousand spoils them: the asked one has to be zero."""
        columns = {"energy.m": self.other[:, 0], "effects.plain.x": self.other[:, 1]}
        for share, time in self.pairs:
            columns[share] = self.column(values[time])
            columns[time] = values[share] * np.sin(self.s)
        return self.r.copy(), np.stack([columns[p] for p in self.free], 1)


def series(n: int = 2, **options) -> Any:
    return Series(n, **options)


def gain(r, others, column) -> tuple[float, float]:
    """The linear step of one column beside others, and how much less the squares are for it."""
    both = np.column_stack([column, others])
    size = np.linalg.norm(both, axis=0)
    size = np.where(size > 0, size, 1.0)
    x = np.linalg.lstsq(both / size, -r, rcond=1e-12)[0] / size
    with_it = r + both @ x
    size = size[1:]
    without = r + (others / size) @ np.linalg.lstsq(others / size, -r, rcond=1e-12)[0] if others.shape[1] else r
    return x[0], float(without @ without - with_it @ with_it)


@pytest.mark.parametrize("seed", range(6))
def test_a_term_is_woken_at_the_time_that_takes_most_of_the_misfit_by_its_linear_step(seed):
    """Of nine times even in their logarithm inside the bounds; a step is cut to between 0.01 and 0.3."""
    p = series(rng=np.random.default_rng(seed))
    (share, time), (share2, time2) = p.pairs
    p.r = -0.2 * p.column(0.6) + 0.5 * p.r * (1 + seed)
    values = {"energy.m": 1.0, "effects.plain.x": 2.0, share: 0.0, time: 1.0, share2: 0.4, time2: 7.0}
    times = 0.02 * 1000.0 ** (np.arange(1, 10) / 10)
    others = np.column_stack([p.other, p.column(7.0), 0.4 * np.sin(p.s)])
    told = [gain(p.r, others, p.column(t)) for t in times]
    order = sorted((g, x, t) for (x, g), t in zip(told, times, strict=True) if x > 0)
    found = woken(p, values)
    if not order:
        assert found is None
        return
    _, step, t = order[-1]
    assert found == values | {
        share: pytest.approx(np.clip(step, 0.01, 0.3), rel=1e-6),
        time: pytest.approx(t, rel=1e-9),
    }


def test_a_step_is_cut_at_both_ends():
    p = series()
    (share, time), (share2, time2) = p.pairs
    values = {"energy.m": 1.0, "effects.plain.x": 2.0, share: 0.4, time: 7.0, share2: 0.0, time2: 1.0}
    for step, taken in ((0.2, 0.2), (0.02, 0.02), (0.004, 0.01), (7.0, 0.3)):
        p.r = -step * p.column(0.02 * 1000**0.5)
        assert woken(p, values) == values | {share2: pytest.approx(taken), time2: pytest.approx(0.02 * 1000**0.5)}
    p.r = 0.2 * p.column(0.02 * 1000**0.5)  # it would have to be negative
    p.column = lambda tau: np.exp(-p.s / 0.6)
    assert woken(p, values) is None


def test_a_time_that_zero_bounds_is_tried_from_nine_decades_under_its_other_end_on():
    p, tried = series(1), []
    p.bound = lambda path: (0.0, 20.0)
    p.linearised = lambda values: tried.append(values[p.pairs[0][1]]) or (np.zeros(3), np.ones((3, 4)))
    assert woken(p, {path: 0.0 for path in p.free}) is None  # a term alone is no series
    assert roused(p, {path: 0.0 for path in p.free}) == {path: 0.0 for path in p.free}
    np.testing.assert_allclose(tried, 20e-9 * 1e9 ** (np.arange(1, 10) / 10), rtol=1e-9)


def test_what_is_set_apart_takes_nothing_of_the_misfit_and_what_is_not_does():
    """The best step of an amplitude and its candidate; of columns that vanish, depend on others or are no numbers."""
    rng = np.random.default_rng(3)
    base, r = rng.normal(size=(15, 3)), rng.normal(size=15)
    candidates = [{"t": float(i)} for i in range(5)]
    columns = rng.normal(size=(5, 15))
    columns[4] = np.nan

    def linearised(values):
        assert values["kept"] == 5.0
        dependent = base @ [0.3, 2.0, 0.0]
        cols = [base[:, 0] * 1e4, columns[int(values["t"])], base[:, 1], base[:, 2], dependent, np.zeros(15)]
        return r, np.stack(cols, 1)

    p: Any = SimpleNamespace(free=("x", "amp", "y", "t", "z", "w"), linearised=linearised)
    found = room._scored(p, {"kept": 5.0, "t": 99.0}, "amp", candidates, {"amp", "t"})
    told = [gain(r, base[:, :2], c) for c in columns[:4]]
    best = max((g, x, i) for i, (x, g) in enumerate(told) if x > 0)
    assert found == (pytest.approx(best[1], rel=1e-8), candidates[best[2]])
    beside = room._scored(p, {"kept": 5.0}, "amp", candidates, {"amp"})  # t's own column counts now
    told = [gain(r, base, c) for c in columns[:4]]
    best = max((g, x, i) for i, (x, g) in enumerate(told) if x > 0)
    assert beside == (pytest.approx(best[1], rel=1e-8), candidates[best[2]])
    columns[:4] = base[:, :2].sum(1)  # nothing that the others don't do
    columns[0] = 0.0
    none = room._scored(p, {"kept": 5.0}, "amp", candidates[:1], {"amp", "t"})
    assert none is None
    nothing = room._scored(p, {"kept": 5.0}, "amp", [], {"amp", "t"})
    assert nothing is None
    alone: Any = SimpleNamespace(
        free=("amp",), linearised=lambda values: (np.array([-3.0, 1.0]), np.array([[2.0], [0.0]]))
    )
    assert room._scored(alone, {}, "amp", [{"t": 1.0}], {"amp"}) == (1.5, {"t": 1.0})


@pytest.mark.parametrize(("small", "seen"), [(0.9e-10, False), (1.2e-10, True)])
def test_another_column_counts_from_a_ten_thousand_millionth_on(small, seen):
    """Two others that differ along the entry where the amplitude acts too."""
    J = np.zeros((3, 3))
    J[0, 1:], J[1, 2], J[:2, 0] = 1.0, 2 * small, [0.0, 1.0]
    J[2, 0] = 1.0
    r = np.array([0.0, -2.0, -1.0])
    p: Any = SimpleNamespace(free=("amp", "x", "y"), linearised=lambda values: (r, J))
    found = room._scored(p, {}, "amp", [{}], {"amp"})
    assert found is not None
    assert found[0] == pytest.approx(1.0 if seen else 1.5)


def test_a_candidate_without_a_finite_residual_is_left_out():
    r = {0.0: np.array([-9.0, np.inf]), 1.0: np.array([-1.0, 0.0])}
    p: Any = SimpleNamespace(free=("amp",), linearised=lambda values: (r[values["t"]], np.array([[1.0], [0.0]])))
    assert room._scored(p, {}, "amp", [{"t": 0.0}, {"t": 1.0}], {"amp"}) == (1.0, {"t": 1.0})


def test_terms_are_those_of_which_share_and_time_are_both_free():
    p = series(3)
    assert terms(p) == [p.pairs]
    p.free = (*p.pairs[0], p.pairs[1][0], *p.pairs[2])
    assert terms(p) == [[p.pairs[0], p.pairs[2]]]
    p.free = (*p.pairs[0], p.pairs[1][0], p.pairs[2][1])
    assert terms(p) == []
    assert terms(p, least=1) == [[p.pairs[0]]]
    assert terms(series(3, free=("energy.m",)), least=1) == []


@pytest.mark.parametrize(("apart", "first", "last", "one"), [
    (0.049, 0.2, 0.3, True),
    (-0.049, 0.2, 0.3, True),
    (0.051, 0.2, 0.3, False),
    (-0.051, 0.2, 0.3, False),
    (0.0, 0.0, 0.3, False),  # one of them does nothing
    (0.0, 0.2, 0.0, False),
])  # fmt: skip
def test_terms_are_one_where_logarithms_of_their_times_differ_by_less_than_a_twentieth(apart, first, last, one):
    p = series(3)
    (g1, t1), (g2, t2), (g3, t3) = p.pairs
    values = {g1: first, t1: 2.0, g2: 0.1, t2: 9.0, g3: last, t3: 2.0 * np.exp(apart)}
    together, idle = merged(p, values)
    expected = values | ({g1: first + last, g3: 0.0} if one else {})
    assert together == expected
    assert idle == [pair for pair in p.pairs if expected[pair[0]] == 0.0]


def test_three_terms_at_one_time_are_put_into_the_first():
    p = series(3)
    (g1, t1), (g2, t2), (g3, t3) = p.pairs
    together, idle = merged(p, {g1: 0.1, g2: 0.2, g3: 0.4, t1: 5.0, t2: 5.0, t3: 5.0})
    assert [together[g] for g in (g1, g2, g3)] == pytest.approx([0.7, 0.0, 0.0])
    assert idle == p.pairs[1:]


@pytest.mark.parametrize(("share", "idle"), [(0.9999e-3, True), (1e-3, False), (1.001e-3, False)])
def test_a_term_is_idle_below_a_thousandth(share, idle):
    p = series()
    (g1, t1), (g2, t2) = p.pairs
    values = {"energy.m": 1.0, "effects.plain.x": 2.0, g1: 0.5, t1: 1.0, g2: share, t2: 9.0}
    assert merged(p, values)[1] == ([p.pairs[1]] if idle else [])
    p.r = -0.2 * p.column(0.6)
    assert (woken(p, values) is None) != idle


def test_of_several_idle_terms_the_first_is_woken_and_the_others_take_nothing():
    p = series(3, rng=np.random.default_rng(8))
    (g1, t1), (g2, t2), (g3, t3) = p.pairs
    p.r = -0.2 * p.column(0.02 * 1000**0.3) + 0.01 * p.r
    values = {"energy.m": 1.0, "effects.plain.x": 2.0, g1: 0.5, t1: 19.0, g2: 0.0, t2: 4.0, g3: 0.0, t3: 0.3}
    found = woken(p, values)
    others = np.column_stack([p.other, p.column(19.0), 0.5 * np.sin(p.s)])
    step, _ = gain(p.r, others, p.column(0.02 * 1000**0.3))
    assert found == values | {g2: pytest.approx(step), t2: pytest.approx(0.02 * 1000**0.3)}


def begun(p, **what):
    return {"energy.m": 1.0, "effects.plain.x": 2.0} | {
        path: start for pair, t in zip(p.pairs, (0.05, 1.0, 15.0), strict=False) for path, start in zip(pair, (0.0, t))
    } | what  # fmt: skip


@pytest.mark.parametrize(("power", "which"), [(0.2, 0), (0.5, 1), (0.9, 2)])
def test_a_series_without_shares_is_begun_by_the_term_next_to_the_time_that_promises_most(power, which):
    p = series(3)
    t = 0.02 * 1000**power
    p.r = -0.2 * p.column(t)
    share, time = p.pairs[which]
    assert roused(p, begun(p)) == begun(p) | {share: pytest.approx(0.2), time: pytest.approx(t)}


def test_a_series_that_is_told_has_priors_or_has_shares_is_left_as_it_is():
    p = series(3)
    p.r = -0.2 * p.column(0.6)
    (g1, _), (_, t2), (g3, _) = p.pairs
    assert roused(p, begun(p)) != begun(p)
    assert roused(p, begun(p), told=frozenset({"energy.m"})) != begun(p)
    for path in (g1, t2):
        assert roused(p, begun(p), told=frozenset({path})) == begun(p)
        p.priors = {path: (0.1, 1.0)}
        assert roused(p, begun(p)) == begun(p)
        p.priors = {"energy.m": (1.0, 1.0)}
    some = begun(p, **{g3: 1e-9})
    assert roused(p, some) == some
    one = series(1)
    one.r = -0.2 * one.column(0.02 * 1000**0.4)
    (share, time) = one.pairs[0]
    assert roused(one, begun(one)) == begun(one) | {share: pytest.approx(0.2), time: pytest.approx(0.02 * 1000**0.4)}
    one.column = lambda tau: np.zeros(20)
    assert roused(one, begun(one)) == begun(one)


class Fibres:
    """A modulus k2 whose columns go by an angle, as cos(angle s), beside a matrix of modulus mu."""

    free = ("energy.mu", "energy.k2", "energy.angle", "energy.bend", "effects.x")
    moduli = ("energy.mu", "energy.k2")

    def __init__(self, at=0.9, lower=0.0):
        known = {p: SimpleNamespace(typical=100.0 if p == "energy.k2" else 1.0) for p in self.free}
        self.predictor = SimpleNamespace(model=SimpleNamespace(parameters=known))
        self.s, self.lower, self.nan = np.linspace(0, 3, 30), lower, False
        self.r = -40.0 * np.cos(at * self.s)

    def bound(self, path):
        return {
            "energy.mu": (0.0, np.inf), "energy.k2": (self.lower, np.inf), "energy.angle": (0.0, 1.5),
            "energy.bend": (-1.0, 1.0), "effects.x": (0.0, 1.0),
        }[path]  # fmt: skip

    def linearised(self, values):
        k2, angle = values["energy.k2"], values["energy.angle"]
        turned = -k2 * self.s * np.sin(angle * self.s)
        columns = [0.1 * self.s**2, np.cos(angle * self.s), turned, 1 + self.s, 0 * self.s]
        if self.nan:
            columns[3] = np.full(30, np.nan)
        return self.r, np.stack(columns, 1)


def fibres(**options) -> Any:
    return Fibres(**options)


DEAD = {"energy.mu": 3.0, "energy.k2": 0.0, "energy.angle": 0.3, "energy.bend": 0.5, "effects.x": 0.0, "off": 1.0}


@pytest.mark.parametrize("k2", [0.0, 0.099, 0.1])
def test_a_modulus_at_zero_is_woken_at_the_shape_of_64_that_takes_most(k2):
    """At most a thousandth of what is typical; the angle alone is its shape: the bend acts without it."""
    from scipy.stats import qmc

    p = fibres()
    found = woken_modulus(p, DEAD | {"energy.k2": k2})
    angles = 1.5 * qmc.Sobol(1, rng=0).random(64)[:, 0]
    others = np.stack([0.1 * p.s**2, 1 + p.s], 1)
    told = [gain(p.r, others, np.cos(a * p.s)) for a in angles]
    _, step, angle = max((g, x, a) for (x, g), a in zip(told, angles, strict=True) if x > 0)
    assert abs(angle - 0.9) < 1.5 / 64
    assert found == DEAD | {"energy.k2": pytest.approx(step), "energy.angle": pytest.approx(angle)}


def test_a_modulus_stays_asleep_where_it_is_not_at_zero_or_nothing_would_help():
    awake, negative = DEAD | {"energy.k2": 0.1001}, DEAD | {"energy.k2": -5.0}
    assert woken_modulus(fibres(), awake) is None
    assert woken_modulus(fibres(lower=-10.0), negative) is None  # zero is no end of its range
    p = fibres()
    p.r = 40.0 + 0 * p.s  # cosines would have to be negative
    p.linearised = lambda values: (p.r, np.stack([0 * p.s, 1 + 0 * p.s, 0 * p.s, 0 * p.s + 1e-9 * p.s, 0 * p.s], 1))
    assert woken_modulus(p, DEAD) is None
    p = fibres()
    p.nan = True
    assert woken_modulus(p, DEAD) is None
    p = fibres()
    p.linearised = lambda values: (p.r, np.ones((30, 5)))  # whose every constant acts: no shapes
    assert woken_modulus(p, DEAD) is None


@pytest.mark.parametrize(("lower", "upper", "typical", "low", "high", "log"), [
    (1.0, 3.0, 1.0, 1.0, 3.0, False),
    (0.0, np.inf, 2.0, 0.2, 200.0, True),
    (-np.inf, 3000.0, 2.0, 0.2, 200.0, True),
    (-np.inf, 150.0, 2.0, 0.2, 150.0, True),
    (0.0, 100.0, 1.0, 0.0, 100.0, False),  # a hundred times what is typical is no far end
    (0.0, 100.1, 1.0, 0.1, 100.0, True),
    (5.0, np.inf, 1.0, 5.0, 100.0, True),
    (0.0, 400.0, 1.0, 0.1, 100.0, True),
])  # fmt: skip
def test_shapes_are_drawn_over_their_range_or_three_decades_about_what_is_typical(
    lower, upper, typical, low, high, log
):
    """One in every 64th of the range; what lies beyond a bound is on it."""
    known = {"x": SimpleNamespace(typical=typical)}
    p: Any = SimpleNamespace(
        bound=lambda path: (lower, upper), predictor=SimpleNamespace(model=SimpleNamespace(parameters=known))
    )
    x = np.sort([d["x"] for d in room._drawn(p, ["x"])])
    assert len(x) == 64
    assert np.all((x >= low) & (x <= high))
    ends = (0.1 * typical, 100 * typical) if log else (low, high)
    even = (np.log(x / ends[0]) / np.log(ends[1] / ends[0])) if log else (x - low) / (high - low)
    inner = (x > lower) & (x < upper)
    expected = (np.arange(64) + 0.5) / 64
    np.testing.assert_allclose(even[inner], expected[inner], atol=0.5 / 64 + 1e-9)
    assert inner.all() == (lower != 5.0 and upper != 150.0)
