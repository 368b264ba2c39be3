"""Every part of the discrepancy against its kernel, pair of rows by pair of rows; the loading state against its law."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tissuejax.estimation.discrepancy import (
    Done,
    Part,
    Series,
    discrepancy,
    loading_states,
    smooth_factor,
    turned,
)
from tissuejax.estimation.smoothness import USUAL, Smoothness

OTHER = Smoothness(
    law={"law": 0.4, "fine law": 0.2},
    turning=0.3,
    states={"one": 0.1, "two": 0.5},
    slow={"hasty": 0.2, "idle": 0.7},
    begun=0.02,
    waning=0.6,
    band=0.1,
)
STRESS = np.array([0.0, 1.0, -3.0, 2.0, 0.5, 4.0, 5.0, 7.0, -1.0, 2.5, 3.0, 6.0, -8.0, 2.0])
SIGMA = np.array([1.0, 2.0, 1.0, 3.0, 1.0, 2.0, 2.0, 8.0, 2.0, 0.5, 1.5, 2.5, 1.0, 1.0])
PEAKS = np.repeat([3.0, 7.0, 3.0, 8.0], [5, 4, 2, 3])  # largest stress of the recording: 3, 7 and 8


def curved(n: int, top: float) -> np.ndarray:
    x = top * np.linspace(0.0, 1.0, n)
    return np.stack([x, -0.7 * x**2], 1)


def series_of(sign: float = 1.0) -> list[Series]:
    """Extension of two recordings, shear of the first once more, and a third recording that is alone in its mode."""
    up, down = np.array([[0.2, 0.1], [0.5, 0.2], [0.9, 0.4]]), np.array([[-0.8, 0.3], [-0.6, 0.1]])
    return [
        Series(
            "r1", "pull", np.array([1.0, 1.5, 2.5, 4.0, 5.0]), curved(5, 0.4), np.concatenate([up, sign * down]), 10.0
        ),
        Series("r2", "pull", np.array([0.0, 1.0, 3.0, 4.0]), curved(4, 0.25), np.concatenate([up, up[:1]]), 20.0, 50.0),
        Series("r1", "shear", np.array([2.0, 3.0]), curved(2, 0.1), np.abs(down), 10.0, 7.0),
        Series("r3", "push", np.array([0.0, 0.5, 2.0]), 0.0 * curved(3, 1.0) + 0.3, up, 30.0, 9.0),
    ]


OWNER = np.repeat([0, 1, 2, 3], [5, 4, 2, 3])
RECORDING = np.array([0, 1, 0, 2])[OWNER]
MODE = np.array([0, 0, 1, 2])[OWNER]


def alike(labels: np.ndarray) -> np.ndarray:
    return (labels[:, None] == labels[None]).astype(float)


def stacked(what: str, series: list[Series]) -> np.ndarray:
    return np.concatenate([getattr(s, what) for s in series])


def near(x: np.ndarray, length: float, groups: np.ndarray, passed: np.ndarray | None = None) -> np.ndarray:
    """Squared exponential within each group, over its range; with what passed as one dimension more."""
    out = np.zeros((len(x), len(x)))
    for g in np.unique(groups):
        at = np.flatnonzero(groups == g)
        scaled = x[at] / (np.max(np.ptp(x[at], axis=0)) or 1.0)
        if passed is not None:
            scaled = np.column_stack([scaled, passed[at]])
        out[np.ix_(at, at)] = np.exp(-0.5 * np.sum((scaled[:, None] - scaled[None]) ** 2, axis=-1) / length**2)
    return out


def elapsed(series: list[Series]) -> np.ndarray:
    """Of each series' duration, from its first sample on."""
    return np.concatenate([(s.time - s.time[0]) / (s.time[-1] - s.time[0]) for s in series])


def matrix(part: Part) -> np.ndarray:
    if part.factor is not None:
        assert part.within is None
        return part.factor @ part.factor.T
    assert part.within is not None
    rows = sum(len(block) for block in part.within)
    out, at = np.zeros((rows, rows)), 0
    for block in part.within:
        out[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return out


@pytest.mark.parametrize("smooth", [USUAL, OTHER], ids=["usual", "other"])
@pytest.mark.parametrize("paced", [False, True])
def test_every_part_is_its_kernel(smooth, paced):
    series = series_of()
    states = stacked("states", series)
    if smooth is USUAL:
        states = np.column_stack([states, states[:, 0] * states[:, 1]])
        cuts = np.split(states, [5, 9, 11])
        series = [replace(s, states=own) for s, own in zip(series, cuts, strict=True)]
    x, both = stacked("strain", series), np.outer(STRESS, STRESS)
    of = discrepancy(series, SIGMA, paced=paced, smooth=smooth)
    parts = {p.name: p for p in of.about(STRESS)}
    kernels = {name: ("law", both * near(x, length, MODE)) for name, length in smooth.law.items()}
    kernels["gain"] = "gain", both * alike(RECORDING)
    only = (MODE == 0).astype(float)  # the others' law is their own
    own = near(x, smooth.law["law"], OWNER) * np.outer(only, only)
    kernels["own law"] = "gain", both * own
    for k, shape in enumerate(smooth.states):
        loop = PEAKS * states[:, k]
        kernels[f"hysteresis, {shape}"] = "hysteresis", np.outer(loop, loop) * near(x, smooth.turning, MODE)
    peak, within = np.array([10.0, 20.0, 10.0, 30.0])[OWNER], alike(OWNER)
    since = np.abs(np.subtract.outer(elapsed(series), elapsed(series)))
    for name, time in smooth.slow.items():
        kernels[name] = "slow", np.outer(peak, peak) * np.exp(-since / time) * within
    median = np.array([1.0, 2.0, 1.0, 1.0])[OWNER]  # the third's of 0.5 and 1.5
    kernels["white"] = "white", np.diag((peak * SIGMA / median) ** 2)
    kernels["effects"] = "effect", np.zeros_like(both)
    if paced:
        kernels["waning gain"] = "slow", both * np.exp(-since / smooth.waning) * within
    assert list(parts) == list(kernels)
    for name, (family, expected) in kernels.items():
        assert parts[name].family == family
        np.testing.assert_allclose(matrix(parts[name]), expected, rtol=1e-9, atol=3e-5 * np.max(np.abs(expected)))
    effects = parts["effects"].factor
    assert effects is not None
    assert effects.shape == (14, 1)


@pytest.mark.parametrize("paced", [False, True])
def test_what_the_law_of_an_effect_errs_by_is_smooth_in_strain_and_if_it_knows_time_in_its_logarithm(paced):
    series, change = series_of(), np.cos(np.arange(14.0))
    of = discrepancy(series, SIGMA, paced=paced, smooth=OTHER)
    x, gain = stacked("strain", series), alike(RECORDING)
    passed = np.log(1 + elapsed(series) / 0.02) / math.log(51.0)
    blind = near(x, 0.4, MODE) + gain
    knows = near(x, 0.4, MODE, passed) + gain if paced else blind
    both = np.outer(change, change)
    *_, effects = (p for p in of.about(STRESS, [Done(change, False)]) if p.name == "effects")
    np.testing.assert_allclose(matrix(effects), both * blind, atol=1e-4)
    *_, effects = (p for p in of.about(STRESS, [Done(change, True)]) if p.name == "effects")
    np.testing.assert_allclose(matrix(effects), both * knows, atol=1e-4)
    two = [Done(change, True), Done(2 * change, False)]
    *_, effects = (p for p in of.about(STRESS, two) if p.name == "effects")
    np.testing.assert_allclose(matrix(effects), both * (knows + 4 * blind), atol=5e-4)


def test_where_nothing_turns_round_there_is_a_law_more_and_where_one_recording_pulls_no_own_law():
    straight = series_of(sign=-1.0)
    parts = discrepancy(straight, SIGMA, smooth=OTHER).about(STRESS)
    added = [(p.name, p.family) for p in parts if p.family in ("added law", "hysteresis")]
    assert added == [("added law, one", "added law"), ("added law, two", "added law")]
    alone = [straight[0], straight[3]]
    own = next(
        p for p in discrepancy(alone, SIGMA[OWNER % 3 == 0], smooth=OTHER).about(np.ones(8)) if p.name == "own law"
    )
    np.testing.assert_array_equal(own.factor, np.zeros((8, 1)))


def test_noise_of_nothing_scatters_by_nothing():
    parts = discrepancy(series_of(), 0 * SIGMA, smooth=OTHER).about(STRESS)
    np.testing.assert_array_equal(matrix(next(p for p in parts if p.name == "white")), np.zeros((14, 14)))


def test_a_series_in_which_time_or_strain_stands_still_is_all_alike():
    still = Series("r", "m", np.full(3, 2.0), np.full((3, 1), 0.4), np.zeros((3, 2)), 2.0)
    parts = {p.name: p for p in discrepancy([still], np.ones(3), paced=True, smooth=OTHER).about(np.ones(3))}
    for name, size in (("law", 1.0), ("idle", 4.0), ("waning gain", 1.0)):
        part = parts[name]
        np.testing.assert_allclose(matrix(part), np.full((3, 3), size), rtol=1e-12)
    paced = discrepancy([still], np.ones(3), True, smooth=OTHER)
    *_, effect = (p for p in paced.about(np.ones(3), [Done(np.ones(3), True)]) if p.name == "effects")
    np.testing.assert_allclose(matrix(effect), np.full((3, 3), 2.0), rtol=1e-12)


@dataclass
class Whole:
    """A moment that shows what it was given."""

    name: str = "at once"

    def factor(self, disturbed) -> np.ndarray:
        return disturbed.prediction[:, None] * disturbed.timed.time[:, None]


def test_what_may_happen_at_once_is_timed_where_it_is_looked_for():
    series = series_of()
    of = discrepancy(series, SIGMA, at_once=True, smooth=OTHER)
    timed = of.timed
    assert timed is not None
    np.testing.assert_array_equal(timed.time, stacked("time", series))
    np.testing.assert_array_equal(timed.owner, OWNER)
    np.testing.assert_array_equal(timed.recording, RECORDING)
    np.testing.assert_array_equal(timed.strain, stacked("strain", series)[:, 0])
    np.testing.assert_array_equal(timed.start, np.array([0.0, 50.0, 7.0, 9.0])[OWNER])
    assert (timed.names, timed.smooth) == (("r1", "r2", "r3"), OTHER)
    *_, last = replace(of, sudden=(Whole(),)).about(STRESS)  # pyright: ignore[reportArgumentType]
    assert (last.name, last.family) == ("at once", "sudden")
    np.testing.assert_array_equal(last.factor, (STRESS * stacked("time", series))[:, None])
    blind = discrepancy(series, SIGMA, smooth=OTHER)
    assert blind.timed is None
    assert "at once" not in [p.name for p in replace(blind, sudden=(Whole(),)).about(STRESS)]  # pyright: ignore
    assert of.sudden == ()


def test_a_smooth_factor_leaves_out_what_is_a_hundred_thousandth_of_the_largest():
    x = np.stack([np.linspace(3.0, 7.0, 15), np.linspace(0.0, 1.0, 15) ** 2], 1)
    k = np.exp(-np.sum((x[:, None] - x[None]) ** 2, axis=-1) / 16 / 2 / 0.3**2)
    values, vectors = np.linalg.eigh(k)
    large = values > 1e-5 * values.max()
    assert 0 < np.sum(large) < 14
    found = smooth_factor(x, 0.3)
    assert found.shape == (15, np.sum(large))
    np.testing.assert_allclose(found @ found.T, vectors[:, large] * values[large] @ vectors[:, large].T, atol=1e-11)
    np.testing.assert_allclose(smooth_factor(np.full((4, 2), 5.0), 0.3) ** 2, np.full((4, 1), 1.0), rtol=1e-12)
    tiny = np.array([[0.0], [1e-13]])  # a range of less than a million millionth is none
    product = smooth_factor(tiny, 0.5) @ smooth_factor(tiny, 0.5).T
    assert product[0, 1] == pytest.approx(math.exp(-0.5 * 0.1**2 / 0.25), rel=1e-9)


@pytest.mark.parametrize(("first", "turns"), [
    ([0.0, 0.5, 1.0], False), ([0.0, -0.5, -1.0], False), ([0.5, -0.1], True), ([-1e-9, 1e-9], True),
    ([0.0, 0.0], False),
])  # fmt: skip
def test_a_series_turned_round_where_its_narrowest_state_has_either_sign(first, turns):
    assert turned(np.stack([first, [-1.0, *[1.0] * (len(first) - 1)]], 1)) is turns


@pytest.mark.parametrize("smooth", [USUAL, OTHER], ids=["usual", "other"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_loading_state_follows_its_law_along_the_path(smooth, sign):
    """From 1 to 5, a rest, back to 3 and on to 4: over a straight path s the distance from the sign of the motion falls
    by exp(-s / w); a play of twice the band is lost at each turn, of once at the start."""
    band, widths = smooth.band, np.array(list(smooth.states.values()))
    up, down, again = np.linspace(1, 5, 41), np.linspace(5, 3, 21)[1:], np.linspace(3, 4, 11)[1:]
    found = loading_states(sign * np.concatenate([[1.0, 1.0], up, [5.0, 5.0], down, again]), smooth)
    expected = [np.zeros(len(widths))] * 2

    def follow(start, path, toward):
        return toward + (start - toward) * np.exp(-path / widths)

    expected += [follow(0.0, max(x - band, 0.0), 1.0) * (x > band) for x in (up - 1) / 4]
    top = expected[-1]
    expected += [top] * 2
    expected += [follow(top, max(x - 2 * band, 0.0), -1.0) for x in (5 - down) / 4]
    bottom = expected[-1]
    expected += [follow(bottom, max(x - 2 * band, 0.0), 1.0) for x in (again - 3) / 4]
    np.testing.assert_allclose(found, sign * np.array(expected), atol=1e-12)


def test_a_drive_that_stands_still_has_no_state_and_one_that_starts_moving_has_at_once():
    np.testing.assert_array_equal(loading_states(np.full(4, 3.0)), np.zeros((4, 3)))
    moved = loading_states(np.array([0.0, 2.0, 2.0]), OTHER)
    np.testing.assert_array_equal(moved[0], [0.0, 0.0])
    np.testing.assert_allclose(moved[1:], np.tile(1 - np.exp(-0.9 / np.array([0.1, 0.5])), (2, 1)), rtol=1e-12)
