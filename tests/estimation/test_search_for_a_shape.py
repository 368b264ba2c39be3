"""The search for a shape of noise against grids worked out by hand, on likelihoods made here; each rule at its edge."""

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from tissuejax.estimation import correlation
from tissuejax.estimation.correlation import Estimate, Series, _Found, estimate
from tissuejax.estimation.noise import Noise


def logit(share):
    return np.log(np.asarray(share) / (1 - np.asarray(share)))


@dataclass
class Hill:
    """A likelihood that falls as the square of the distance from one logit and one power of two of the time."""

    at: tuple[float, float] = (0.0, 2.6)
    top: float = 0.0
    steep: float = 1.0
    step: float = 3.0
    span: float = 192.0
    walk: float = 0.01
    level: float = 0.5
    capped: bool = True
    n: int = 100
    least: float = -6.0
    most: float = 8.0
    asked: list = field(default_factory=list)
    fading: float = 0.0  # what every call loses against the one before

    def walks(self, low, high, n=1):
        return np.array([low, high, n])

    def __call__(self, shares, taus, walks, free, order=1):
        self.asked.append((shares, taus, tuple(walks), free, order))
        x, y = np.meshgrid(logit(shares) if shares[0] else 0 * shares, np.log2(taus), indexing="ij")
        told = self.top - self.steep * ((x - self.at[0]) ** 2 + (y - self.at[1]) ** 2)
        told = told - self.fading * len(self.asked)
        return told, np.full(x.shape, self.walk), np.full(x.shape, self.level**2)


def search(*hills, white=-math.inf, free=True, **what) -> _Found:
    return correlation._correlated(hills, [white] * len(hills), free, **what)


def test_three_rounds_each_between_the_neighbours_of_the_best_by_hand():
    """Steps of 2.2, 0.88 and 0.352 in the logit, of 1, 1/3 and 1/9 of an octave."""
    hill = Hill()
    found = search(hill, free=False)
    grids = [(np.linspace(-4.5, 6.5, 6), np.arange(7.0)), (np.linspace(-2.3, 2.1, 6), 2 + np.arange(7) / 3)]
    grids.append((np.linspace(-0.54, 1.22, 6), 7 / 3 + np.arange(7) / 9))
    for (shares, taus, *_), (logits, octaves) in zip(hill.asked, grids, strict=True):
        np.testing.assert_allclose(logit(shares), logits, atol=1e-9)
        np.testing.assert_allclose(np.log2(taus), octaves, atol=1e-9)
    assert [x[3:] for x in hill.asked] == [(False, 1)] * 3
    np.testing.assert_allclose([x[2] for x in hill.asked], [(-6, 8, 1), (-5, 1, 1), (-2 - 9 / 7, -2 + 9 / 7, 1)])
    assert logit(found.share) == pytest.approx(0.164, abs=1e-9)
    assert math.log2(found.tau) == pytest.approx(2 + 5 / 9, abs=1e-9)
    assert found.likelihood == pytest.approx(-(0.164**2) - (0.6 - 5 / 9) ** 2, rel=1e-9)
    assert (found.levels, found.order, found.sampled) == ([0.5], 1, False)


def test_a_later_round_counts_only_where_it_is_better():
    flat = search(Hill(steep=0.0))
    assert (logit(flat.share), flat.tau) == pytest.approx((-4.5, 1.0))
    worse = search(Hill(at=(-0.1, 3.0), fading=1.0))
    assert (logit(worse.share), worse.tau, worse.likelihood) == pytest.approx((-0.1, 8.0, -1.0), abs=1e-9)


@pytest.mark.parametrize(("order", "capped", "greatest", "never"), [
    (1, True, 6.5, 1e-3), (2, False, 6.5, 1e-3), (1, False, 6.5, 1e-3), (2, True, 13.5, 1e-6),
])  # fmt: skip
def test_least_shares_of_white_noise(order, capped, greatest, never):
    hill = Hill(at=(40.0, 2.6), capped=capped)
    found = search(hill, order=order)
    expected = np.minimum(1 / (1 + np.exp(-np.linspace(-4.5, greatest, 6))), 1 - never)
    np.testing.assert_allclose(hill.asked[0][0], expected, rtol=1e-12)
    assert hill.asked[1][0][-1] == hill.asked[2][0][-1] == 1 - never
    assert 1 - found.share == pytest.approx(never, rel=1e-6)
    assert [x[4] for x in hill.asked] == [order] * 3


def test_times_range_from_the_shortest_step_to_the_longest_recording():
    one, other = Hill(step=3.0, span=48.0), Hill(step=6.0, span=192.0)
    search(one, other)
    for hill in (one, other):
        np.testing.assert_allclose(hill.asked[0][1], 2.0 ** np.arange(7), rtol=1e-12)
    one, other = Hill(step=0.5, span=24.0), Hill(step=0.125, span=2.0)
    found = search(one, other, sampled=True)  # of 1 to 48 and 1 to 16 samples
    samples = np.geomspace(1 / 3, 16.0, 7)
    np.testing.assert_allclose(one.asked[0][1], 0.5 * samples, rtol=1e-12)
    np.testing.assert_allclose(other.asked[0][1], 0.125 * samples, rtol=1e-12)
    assert found.sampled
    np.testing.assert_allclose(found.tau, one.asked[2][1][np.isclose(one.asked[2][1], 0.5 * found.tau)] / 0.5)


def test_near_a_shape_two_rounds_are_enough():
    hill = Hill(at=(1.0, 3.0), step=0.5)
    near = _Found(0.6, 7.0, 0.0, [1.0], order=2, sampled=True)
    found = search(hill, near=near, order=1, sampled=False)
    assert len(hill.asked) == 2
    np.testing.assert_allclose(logit(hill.asked[0][0]), math.log(1.5) + np.linspace(-2, 2, 6), atol=1e-9)
    np.testing.assert_allclose(np.log(hill.asked[0][1] / 0.5), math.log(7.0) + np.linspace(-1.2, 1.2, 7), atol=1e-9)
    assert [x[4] for x in hill.asked] == [2, 2]
    assert (found.order, found.sampled) == (2, True)


def test_series_are_summed_and_what_each_would_gain_alone_is_kept():
    """At logits 2.2 apart and the same time; the sum is best between them, at the grid's -0.1 or 2.1."""
    one, other = Hill(at=(-0.1, 3.0), top=5.0, level=0.5), Hill(at=(2.1, 3.0), top=7.0, level=0.7, steep=4.0)
    found = search(one, other)
    assert found.levels == [0.5, 0.7]
    assert found.apart == pytest.approx(12.0 - (12.0 - 2.2**2), abs=1e-9)
    assert search(one, other, white=6.0).apart == pytest.approx(6.0 + 7.0 - 12.0, abs=1e-9)
    assert search(one, other, white=9.0).apart == pytest.approx(0.0, abs=1e-9)
    assert found.likelihood == pytest.approx(12.0 - 2.2**2 * 4 / 5, abs=0.2)
    narrow = Hill(walk=0.0)
    search(narrow, Hill())
    np.testing.assert_allclose([x[2][:2] for x in narrow.asked], [(-6, 8), (-9, -3), (-9 - 9 / 7, -9 + 9 / 7)])


def test_a_shape_in_samples_is_one_in_seconds_of_each_series():
    found = _Found(0.36, 3.0, 0.0, [1.0], order=2, sampled=True)
    assert found.noise(0.5) == Noise.shaped(0.36, 1.5, order=2)
    assert _Found(0.36, 3.0, 0.0, [1.0]).noise(0.5) == Noise.shaped(0.36, 3.0)
    assert (_Found(0.36, 3.0, 0.0, [1.0]).apart, _Found(0.36, 3.0, 0.0, [1.0]).sampled) == (0.0, False)
    assert [_Found(0.0, 1.0, 0.0, [0.1, x]).seen for x in (0.49, 0.5, 0.51)] == [False, True, True]


class Told:
    """Answers of `_correlated`, by whether the level is free, order and clock; what was asked is kept."""

    def __init__(self, monkeypatch, **likelihoods: float):
        self.asked = []
        self.likelihoods = likelihoods

        def correlated(surfaces, white, free, order=1, sampled=False, near=None):
            self.asked.append((list(white), free, order, sampled, near))
            name = f"{'free' if free else 'recorded'}{order if near is None else near.order}{'s' if sampled else ''}"
            likelihood = self.likelihoods[name]
            return _Found(0.5, 2.0, likelihood, [0.9], 3.0 if free else 0.0, order, sampled)

        monkeypatch.setattr(correlation, "_correlated", correlated)


def white_of(*tops, level=1.0, capped=True, steps=(1.0, 1.0, 1.0)) -> list:
    return [Hill(at=(0.0, 0.0), top=t, level=level, capped=capped, step=s) for t, s in zip(tops, steps, strict=False)]


def best(surfaces, *orders) -> _Found:
    return correlation._best(surfaces, orders or (1,))


@pytest.mark.parametrize(("gain", "share"), [(3.9, 0.0), (4.0, 0.0), (4.1, 0.5)])
def test_correlated_noise_must_be_likelier_than_white_by_four(monkeypatch, gain, share):
    told = Told(monkeypatch, free1=30.0 + gain, recorded1=30.0 + gain)
    surfaces = white_of(10.0, 20.0, level=0.8)
    found = best(surfaces)
    assert found.share == share
    assert found.apart == 3.0
    assert told.asked[0] == ([10.0, 20.0], True, 1, False, None)
    for surface in surfaces:
        ((shares, taus, walks, free, order),) = surface.asked
        assert (shares.tolist(), taus.tolist(), walks, free, order) == ([0.0], [1.0], (-6.0, 8.0, 42), True, 1)
    if not share:
        assert (found.tau, found.likelihood, found.levels) == (1.0, 30.0, pytest.approx([0.8, 0.8]))


@pytest.mark.parametrize("series", [1, 3])
@pytest.mark.parametrize(("lost", "free"), [(3.9, False), (4.0, False), (4.1, True)])
def test_the_recorded_level_stands_unless_each_series_loses_four_by_it(monkeypatch, series, lost, free):
    told = Told(monkeypatch, free1=100.0, recorded1=100.0 - lost * series)
    found = best(white_of(*[0.0] * series))
    assert found.likelihood == (100.0 if free else pytest.approx(100.0 - lost * series))
    assert found.apart == 3.0
    white, free_level, _, _, near = told.asked[1]
    assert (white, free_level) == ([-math.inf] * series, False)
    assert (near.likelihood, near.share) == (100.0, 0.5)


def test_without_a_recorded_level_it_is_free(monkeypatch):
    told = Told(monkeypatch, free1=100.0)
    assert best(white_of(0.0, capped=False)).likelihood == 100.0
    assert len(told.asked) == 1


@pytest.mark.parametrize(("orders", "level", "capped", "asked"), [
    ((1,), 0.4, True, [1]),
    ((1, 2), 0.4, True, [1, 2]),
    ((1, 2), 0.5, True, [1]),
    ((1, 2), 0.6, True, [1]),
    ((1, 2), 0.6, False, [1, 2]),
    ((2,), 0.4, True, [2, 2]),
    ((1,), 0.4, False, [1]),
])  # fmt: skip
def test_a_filter_of_second_order_is_sought_where_white_noise_of_the_level_is_not_seen(
    monkeypatch, orders, level, capped, asked
):
    told = Told(monkeypatch, free1=100.0, free2=90.0, recorded1=100.0, recorded2=90.0)
    best(white_of(0.0, level=level, capped=capped), *orders)
    assert [x[2] for x in told.asked if x[1]] == asked
    assert not any(x[3] for x in told.asked), "of one clock the time in samples is that in seconds"


@pytest.mark.parametrize(("capped", "gain", "order"), [
    (True, 3.9, 1), (True, 4.0, 1), (True, 4.1, 2), (False, -0.1, 1), (False, 0.0, 1), (False, 0.1, 2),
])  # fmt: skip
def test_a_filter_of_second_order_must_be_likelier(monkeypatch, capped, gain, order):
    told = Told(monkeypatch, free1=100.0, free2=100.0 + gain, recorded1=100.0, recorded2=100.0)
    found = best(white_of(0.0, level=0.1, capped=capped), 1, 2)
    assert (told.asked[-1][4] if capped else found).order == order
    assert [x[0] for x in told.asked if x[1]] == [[0.0], [0.0]]


@pytest.mark.parametrize(("steps", "clocks"), [
    ((1.0, 1.0), [False]), ((1.0, 1.1), [False]), ((1.12, 1.0), [False, True]), ((1.0, 1.12), [False, True]),
    ((2.0, 2.0), [False]),
])  # fmt: skip
def test_two_clocks_are_tried_where_the_rates_differ_by_more_than_a_tenth(monkeypatch, steps, clocks):
    told = Told(monkeypatch, free1=0.0, free2=200.0, free2s=201.0, recorded2=200.0, recorded2s=200.0)
    surfaces = white_of(0.0, 0.0, level=0.1, capped=False, steps=steps)
    found = best(surfaces, 1, 2)
    assert [x[3] for x in told.asked if x[2] == 2] == clocks
    assert found.sampled == (len(clocks) == 2)
    told.likelihoods["free2s"] = 199.0
    assert not best(surfaces, 1, 2).sampled


@dataclass
class Fake:
    """A surface of a series, by its length."""

    series: Series
    recorded: bool
    mismatch: bool

    @property
    def n(self) -> int:
        return len(self.series.time)

    step = 0.25


def of_length(*lengths: int) -> list[Series]:
    return [Series(0.5 * np.arange(float(n)), np.full((n, 1), 2.0) * (-1) ** np.arange(n)[:, None]) for n in lengths]


@pytest.fixture
def shapes(monkeypatch):
    """What `_best` says: of several series `together`, and of each alone by its length."""
    asked = []

    def put(together: _Found, **alone: float):
        def choose(surfaces, orders=(1,)):
            asked.append(([s.n for s in surfaces], orders, [(s.recorded, s.mismatch) for s in surfaces]))
            if len(asked) == 1:
                return together
            (one,) = surfaces
            return _Found(0.8, 6.0, alone[f"n{one.n}"], [0.7], order=2, sampled=True)

        monkeypatch.setattr(correlation, "_Surface", Fake)
        monkeypatch.setattr(correlation, "_best", choose)
        return asked

    return put


LOG = math.log(64 + 100 + 80)  # Schwarz: of all samples, for share and time of each shape more; half of it each


@pytest.mark.parametrize(("apart", "gain", "asked_each", "common"), [
    (0.99 * LOG, 9.0 * LOG, False, True),  # on the coarse grid no more is to be gained than half the price
    (LOG, 9.0 * LOG, True, False),
    (LOG, 2.0 * LOG, True, True),
    (3.0 * LOG, 2.01 * LOG, True, False),
    (3.0 * LOG, -1.0, True, True),
])  # fmt: skip
def test_series_have_a_shape_each_where_that_is_worth_its_price(shapes, apart, gain, asked_each, common):
    asked = shapes(_Found(0.5, 3.0, 0.0, [0.1, 0.2, 0.3], apart), n64=0.0, n100=gain, n80=0.0)
    found = estimate(of_length(64, 63, 100, 80, 0), orders=(1, 2))
    assert asked[0] == ([64, 100, 80], (1, 2), [(True, True)] * 3)
    assert [x[:2] for x in asked[1:]] == ([([n], (1, 2)) for n in (64, 100, 80)] if asked_each else [])
    shared, own = Noise.shaped(0.5, 3.0), Noise.shaped(0.8, 1.5, order=2)
    assert found.common == common
    if common:
        assert found.noises == (shared,) * 5
        assert found.levels == (0.1, pytest.approx(2.0, abs=1e-3), 0.2, 0.3, 1.0)
    else:
        assert found.noises == (own, shared, own, own, shared)
        assert found.levels == (0.7, pytest.approx(2.0, abs=1e-3), 0.7, 0.7, 1.0)


def test_a_time_in_samples_is_one_of_each_series(shapes):
    shapes(_Found(0.5, 3.0, 0.0, [0.1], sampled=True), n64=0.0)
    found = estimate([*of_length(64, 10), Series(2.0 * np.arange(9), np.zeros((9, 1)))], recorded=False, mismatch=False)
    assert found.noises == (Noise.shaped(0.5, 1.5), Noise.shaped(0.5, 1.5), Noise.shaped(0.5, 6.0))
    assert found.levels == (0.1, 2.0, 1.0)


def test_what_was_not_recorded_or_leaves_no_mismatch_is_passed_on(shapes):
    asked = shapes(_Found(0.0, 1.0, 0.0, [0.1]), n64=0.0)
    estimate(of_length(64), recorded=False, mismatch=False)
    assert asked[0] == ([64], (1,), [(False, False)])


def test_short_series_alone_are_white_of_their_own_size():
    found = estimate([*of_length(63, 0), Series(np.arange(3.0), np.ones((3, 1)))])
    assert found.noises == (Noise(),) * 3
    assert found.levels == (pytest.approx(2.0, abs=1e-3), 1.0, 1.0)
    assert found.common
    assert estimate([]) == Estimate((), ())
    assert Series(np.zeros(1), np.zeros((1, 1))).kinks == ()
