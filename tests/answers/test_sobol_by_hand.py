"""Sobol indices of products and sums against their analysis of variance by hand; which samples are analysed."""

import json
from dataclasses import FrozenInstanceError, replace
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.errors import InputError
from tissuejax.fitting.sobol import Sobol, _predicted, sobol
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel, Recording

DECLARED = {name: Parameter(name, "1", 0.5) for name in ("a", "b", "c", "d")}
RANGES = {"a": (1.0, 3.0), "c": (-2.0, 2.0)}
VALUES = {"a": 2.0, "b": 7.0, "c": 0.0, "d": 1.0}


class Formulas:
    """A predictor of channels by formulas of the values: (recording, channel) -> array over time."""

    def __init__(self, formulas):
        self.formulas, self.calls = formulas, 0
        self.model = SimpleNamespace(parameters=DECLARED)

    def predict(self, values):
        self.calls += 1
        found: dict[str, Any] = {}
        for (r, c), formula in self.formulas.items():
            y = formula(values)
            found.setdefault(r, {})[c] = Channel(np.arange(float(len(y))), y, "Pa")
        return {r: Recording(r, "made", {}, channels) for r, channels in found.items()}


def made(formulas) -> Any:
    return Formulas(formulas)


def by_time(*factors):
    """Over time f_t(values)."""
    return lambda v: jnp.stack([jnp.asarray(f(v), float) for f in factors])


def variances(a=RANGES["a"], c=RANGES["c"]):
    """Mean and variance of uniform a and c."""
    return [((low + high) / 2, (high - low) ** 2 / 12) for low, high in (a, c)]


def test_indices_of_a_sum_and_a_product_are_shares_of_their_variance():
    """a + c: shares of 1/3 and 4/3. a c: m_c is nought, so a alone does nothing, c alone m_a^2 v_c of it, the rest is
    both. What does not change has no part, and times count by their variance."""
    (m_a, v_a), (_, v_c) = variances()
    joint = v_c * (v_a + m_a**2)
    alone, whole = {}, {}
    alone["sum"], whole["sum"] = 2 * [np.array([v_a, v_c]) / (v_a + v_c)]
    alone["product"] = np.array([0.0, m_a**2 * v_c]) / joint
    whole["product"] = np.array([v_a * v_c, joint]) / joint
    weight = np.array([v_a + v_c, 9 * joint]) / (v_a + v_c + 9 * joint)
    for of in (alone, whole):
        of["both"] = weight[0] * of["sum"] + weight[1] * of["product"]
        of["still"] = np.zeros(2)

    def add(v):
        return v["a"] + v["c"] + v["b"] - 7

    def times(v):
        return 3 * v["a"] * v["c"] * v["d"]

    def still(v):
        return 5.0 + 0 * v["a"]

    predictor = made(
        {
            ("r", "sum"): by_time(add, add, add),
            ("r", "product"): by_time(times, times),
            ("r", "both"): by_time(add, times),
            ("s", "still"): by_time(still, still),
        }
    )
    told = sobol(predictor, VALUES, RANGES, n=1024, seed=2)
    assert (told.paths, told.ranges, told.n, told.failed) == (("a", "c"), RANGES, 1024 * 4, 0.0)
    assert list(told.first) == list(told.total) == ["r/sum", "r/product", "r/both", "s/still"]
    for key in told.first:
        channel = key.split("/")[1]
        np.testing.assert_allclose(told.first[key], alone[channel], atol=0.03, err_msg=key)
        np.testing.assert_allclose(told.total[key], whole[channel], atol=0.03, err_msg=key)
    assert told.first["s/still"].tolist() == told.total["s/still"].tolist() == [0.0, 0.0]


def test_a_time_without_variance_does_not_change_the_indices_of_the_others():
    def grow(v):
        return v["a"] + 2 * v["c"]

    moving = sobol(made({("r", "y"): by_time(*[grow] * 12)}), VALUES, RANGES, n=64)
    resting = sobol(made({("r", "y"): by_time(*[lambda v: 0.0 * v["a"]] * 6, *[grow] * 6)}), VALUES, RANGES, n=64)
    np.testing.assert_allclose(resting.first["r/y"], moving.first["r/y"], rtol=1e-12)
    np.testing.assert_allclose(resting.total["r/y"], moving.total["r/y"], rtol=1e-12)


def test_256_base_samples_are_drawn_from_seed_nought_many_at_once_unless_told():
    law = {("r", "y"): by_time(lambda v: v["a"] * v["c"] + v["a"])}
    usual, again = sobol(made(law), VALUES, RANGES), sobol(made(law), VALUES, RANGES, n=256, seed=0, batched=True)
    few, by_one = sobol(made(law), VALUES, RANGES, n=16), sobol(made(law), VALUES, RANGES, n=16, batched=False)
    for told, other in ((usual, again), (few, by_one)):
        np.testing.assert_allclose(told.first["r/y"], other.first["r/y"], rtol=1e-9)
        np.testing.assert_allclose(told.total["r/y"], other.total["r/y"], rtol=1e-9)
    other = sobol(made(law), VALUES, RANGES, seed=1)
    assert usual.n == 4 * 256
    assert not np.allclose(usual.first["r/y"], other.first["r/y"], rtol=1e-6)
    predictor = made(law)
    sobol(predictor, VALUES, RANGES)
    assert predictor.calls == 2  # once for the shapes, once to be compiled
    sobol(predictor, VALUES, RANGES, n=2, batched=False)
    assert predictor.calls == 2 + 1 + 8


def test_what_is_not_finite_is_counted_and_its_mean_stands_for_it():
    """A law that holds below a = 2: half of the range. One component lost is a prediction lost."""

    def valid(v):
        return jnp.where(v["a"] < 2.5, v["c"] + 0 * v["a"], jnp.nan)

    told = sobol(made({("r", "y"): by_time(lambda v: v["c"], valid)}), VALUES, RANGES, n=1024)
    assert told.failed == pytest.approx(0.25, abs=0.01)
    assert np.isfinite(told.first["r/y"]).all()
    assert told.total["r/y"][1] > 0.9
    whole = sobol(made({("r", "y"): by_time(valid)}), VALUES, {"c": (0.0, 4.0), "d": (0.0, 1.0)}, n=64)
    assert whole.failed == 0.0
    with pytest.raises(InputError, match="no prediction is finite over these ranges"):
        sobol(made({("r", "y"): by_time(valid)}), VALUES, {"a": (2.6, 3.0), "c": (0.0, 1.0)}, n=4)


def test_the_mean_that_stands_for_a_lost_prediction_is_of_those_that_are_finite():
    """Of the same draws a law that is the mean itself where it would be lost has the same indices."""
    draws = []

    def lost(v):
        draws.append((float(v["a"]), float(v["c"])))
        return np.where(v["a"] < 2.5, 100 + v["c"] * v["a"], np.nan)

    told = sobol(made({("r", "y"): lambda v: np.array([lost(v)])}), VALUES, RANGES, n=32, batched=False)
    a, c = np.transpose(draws[1:])
    assert told.failed == pytest.approx(np.mean(a >= 2.5), abs=1e-12)
    mean = np.mean((100 + c * a)[a < 2.5])
    filled = made({("r", "y"): lambda v: np.array([np.where(v["a"] < 2.5, 100 + v["c"] * v["a"], mean)])})
    expected = sobol(filled, VALUES, RANGES, n=32, batched=False)
    assert expected.failed == 0.0
    np.testing.assert_allclose(told.first["r/y"], expected.first["r/y"], rtol=1e-9)
    np.testing.assert_allclose(told.total["r/y"], expected.total["r/y"], rtol=1e-9)


def test_draws_fill_the_ranges():
    seen = []

    def law(v):
        seen.append((float(v["a"]), float(v["c"]), v["b"]))
        return np.array([float(v["a"])])

    sobol(made({("r", "y"): law}), VALUES, RANGES, n=128, batched=False)
    a, c, b = np.transpose(seen[1:])
    assert set(b) == {7.0}
    for x, (low, high) in ((a, RANGES["a"]), (c, RANGES["c"])):
        assert low <= x.min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < x.max() <= high


@pytest.mark.parametrize(("ranges", "n", "said"), [
    ({"a": (0.0, 1.0), "e": (0.0, 1.0)}, 4, "parameter"),
    ({"a": (0.0, 1.0), "b": (1.0, 1.0)}, 4, "range of b: 1.0 to 1.0"),
    ({"a": (0.0, 1.0), "b": (2.0, 1.0)}, 4, "range of b: 2.0 to 1.0"),
    ({"a": (0.0, np.inf), "b": (0.0, 1.0)}, 4, "range of a"),
    ({"a": (-np.inf, 0.0), "b": (0.0, 1.0)}, 4, "range of a"),
    ({"a": (0.0, 1.0)}, 4, "two or more"),
    ({}, 4, "two or more"),
    (RANGES, 0, "n = 0: it must be a power of two"),
    (RANGES, 1, "n = 1: it must be a power of two"),
    (RANGES, -4, "n = -4: it must be a power of two"),
    (RANGES, 3, "n = 3: it must be a power of two"),
    (RANGES, 12, "n = 12: it must be a power of two"),
])  # fmt: skip
def test_what_cannot_be_compared_is_refused(ranges, n, said):
    with pytest.raises(InputError, match=said):
        sobol(made({("r", "y"): by_time(lambda v: v["a"])}), VALUES, ranges, n=n)


def test_two_samples_are_a_power_of_two_and_two_parameters_enough():
    assert sobol(made({("r", "y"): by_time(lambda v: v["a"])}), VALUES, RANGES, n=2).n == 2 * 4
    three = RANGES | {"d": (0.0, 1.0)}
    assert sobol(made({("r", "y"): by_time(lambda v: v["a"])}), VALUES, three, n=4, batched=False).n == 4 * 5


@pytest.mark.parametrize("batched", [True, False])
@pytest.mark.parametrize("count", [3, 256, 257])
def test_every_component_is_analysed_at_twelve_places_from_the_first_to_the_last(batched, count):
    """Long channels at rounded even places, short ones at all of theirs, over and over; one draw or many."""
    if not batched and count > 3:
        count = 5
    ramp, few = np.arange(100.0), np.arange(5.0)
    pair = np.stack([np.arange(12.0), 100 + np.arange(12.0)], -1)
    cube = np.arange(2 * 2 * 3.0).reshape(2, 2, 3)
    predictor = made(
        {
            ("r", "long"): lambda v: v["a"] * ramp,
            ("r", "pair"): lambda v: v["c"] + pair,
            ("s", "few"): lambda v: v["b"] + 10 * few,
            ("s", "cube"): lambda v: v["a"] + cube,
        }
    )
    draws = np.random.default_rng(0).normal(size=(count, 2))
    keys, told = _predicted(predictor, VALUES, ("a", "c"), draws, batched)
    assert keys == ["r/long", "r/pair[0]", "r/pair[1]", "s/few", *(f"s/cube[{i}]" for i in range(6))]
    assert told.shape == (count, 10, 12)
    a, c = draws[:, :1], draws[:, 1:]
    places = [0, 9, 18, 27, 36, 45, 54, 63, 72, 81, 90, 99]
    np.testing.assert_allclose(told[:, 0], a * places, rtol=1e-12)
    np.testing.assert_allclose(told[:, 1], c + np.arange(12.0), rtol=1e-12)
    np.testing.assert_allclose(told[:, 2], c + 100 + np.arange(12.0), rtol=1e-12)
    np.testing.assert_allclose(told[:, 3], np.tile(7 + 10 * np.array([*few, *few, 0, 1]), (count, 1)), rtol=1e-12)
    for i in range(6):
        np.testing.assert_allclose(told[:, 4 + i], a + np.tile([i, 6 + i], 6), rtol=1e-12)


def test_a_record_is_plain_data_by_path():
    of = Sobol(
        ("a", "b"),
        {"a": (0.0, 1.0), "b": (2.0, 3.0)},
        {"r/y": np.array([0.25, 0.5])},
        {"r/y": np.array([0.5, 0.75])},
        8,
        0.125,
    )
    told = of.record()
    assert (
        json.loads(json.dumps(told))
        == told
        == {
            "ranges": {"a": [0.0, 1.0], "b": [2.0, 3.0]},
            "first": {"r/y": {"a": 0.25, "b": 0.5}},
            "total": {"r/y": {"a": 0.5, "b": 0.75}},
            "n": 8,
            "failed": 0.125,
        }
    )
    with pytest.raises(FrozenInstanceError):
        of.n = 9  # pyright: ignore[reportAttributeAccessIssue]
    for part in ("first", "total"):  # an index too few is noticed
        with pytest.raises(ValueError, match="zip"):
            replace(of, **{part: {"r/y": np.array([0.25])}}).record()
