"""Prediction bands against J Sigma J' of dense matrices, of draws of the estimates, and of markers' ways by hand."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from tissuejax.estimation.covariance import Uncertainty
from tissuejax.fitting.bands import carried, fitted_std, half_width, held_out_std, marker_std, prediction_std

RNG = np.random.default_rng(4)
ROOT = RNG.normal(size=(3, 3))
COVARIANCE = ROOT @ ROOT.T
FREE = ("a", "b", "c")
SHAPES = {("one", "force"): (4, 3), ("one", "flow"): (5,), ("two", "force"): (2, 3)}
SLOPES = {key: RNG.normal(size=(*shape, 3)) for key, shape in SHAPES.items()}


def spread(covariance=COVARIANCE, widening=1.0, dof=math.inf) -> Uncertainty:
    covariance = np.asarray(covariance, float)
    none = np.zeros(len(covariance))
    return Uncertainty(none, covariance, covariance, 1.0, (), dof=dof, widening=widening)


def nested(arrays):
    """By recording and channel."""
    return {r: {c: v for (one, c), v in arrays.items() if one == r} for r in dict.fromkeys(r for r, _ in arrays)}


def recordings(arrays):
    return {
        r: SimpleNamespace(channels={c: SimpleNamespace(values=v) for c, v in channels.items()})
        for r, channels in nested(arrays).items()
    }


def expected(slopes):
    """Of N draws of the estimates the exact limit, row by row: sqrt(j' Sigma j)."""
    rows = slopes.reshape(-1, slopes.shape[-1])
    return np.sqrt([j @ COVARIANCE @ j for j in rows]).reshape(slopes.shape[:-1])


class Predictor:
    """Derivatives that are given, of the recordings asked for; what it was asked is kept."""

    def __init__(self, slopes, measured=None):
        self.slopes, self.asked = slopes, []
        self.sample = SimpleNamespace(recordings=recordings(measured or {}))

    def of(self, names):
        self.asked.append(names)
        return self

    def jacobian(self, values, paths):
        self.asked.append((values, paths))
        return None, {
            p: nested({(r, c): J[..., i] for (r, c), J in self.slopes.items() if r in self.asked[0]})
            for i, p in enumerate(paths)
        }


def problem(predictor, **more) -> Any:
    return SimpleNamespace(predictor=predictor, free=FREE, **more)


def test_errors_of_a_curve_are_those_of_draws_of_its_parameters():
    """Of 40,000 draws with the covariance the spread of J x, and exactly the matrix product."""
    J = SLOPES["one", "force"]
    told = carried(J, spread())
    assert told.shape == (4, 3)
    np.testing.assert_allclose(told, expected(J), rtol=1e-12)
    drawn = np.random.default_rng(1).normal(size=(40000, 3)) @ ROOT.T
    np.testing.assert_allclose(told, np.std(drawn @ J.reshape(-1, 3).T, axis=0).reshape(4, 3), rtol=0.02)


def test_what_has_no_covariance_has_no_share_and_rounding_below_zero_none_either():
    """Where two parameters are open to rounding only the third carries."""
    sigma = np.array([[np.inf, np.nan, np.nan], [np.nan, -np.inf, np.nan], [np.nan, np.nan, 4.0]])
    J = np.array([[5.0, 7.0, 0.5], [1.0, 1.0, 0.0]])
    np.testing.assert_allclose(carried(J, spread(sigma)), [1.0, 0.0])
    assert carried(np.array([[1.0, 2.0]]), spread(-1e-12 * np.eye(2))).tolist() == [0.0]
    assert np.isnan(carried(np.array([[np.nan, 1.0]]), spread(np.eye(2)))).all()


def test_the_curves_of_named_recordings_have_errors_by_channel():
    predictor = Predictor(SLOPES)
    told = prediction_std(problem(predictor), {"a": 1.0, "d": 2.0}, spread(), ("two", "one"))
    assert predictor.asked == [("two", "one"), ({"a": 1.0, "d": 2.0}, FREE)]
    assert {r: set(c) for r, c in told.items()} == {"one": {"force", "flow"}, "two": {"force"}}
    for (r, c), J in SLOPES.items():
        np.testing.assert_allclose(told[r][c], expected(J), rtol=1e-12)
    assert list(prediction_std(problem(Predictor(SLOPES)), {}, spread(), ("two",))) == ["two"]
    one: Any = SimpleNamespace(predictor=Predictor(SLOPES), free=FREE[:1])
    alone = prediction_std(one, {}, spread(np.array([[0.25]])), ("two",))["two"]["force"]
    np.testing.assert_allclose(alone, 0.5 * np.abs(SLOPES["two", "force"][..., 0]), rtol=1e-12)


def test_fitted_curves_have_the_errors_of_their_residuals_times_the_noise_and_none_where_lost():
    """Rows of the residuals are in units of the noise; a prior's row comes last and is of no channel."""
    sigma = {("one", "force"): 0.5, ("one", "flow"): 3.0, ("two", "force"): 20.0}
    lost = {("one", "force"): [1, 5], ("one", "flow"): [4], ("two", "force"): []}
    rows, seen, blocks, at = {}, {}, [], 0
    for key, J in SLOPES.items():
        seen[key] = np.setdiff1d(np.arange(J[..., 0].size), lost[key])
        rows[key], at = slice(at, at + len(seen[key])), at + len(seen[key])
        blocks.append(J.reshape(-1, 3)[seen[key]] / sigma[key])
    measured = {key: np.zeros(shape) for key, shape in SHAPES.items()}
    of = problem(Predictor({}, measured), rows=rows, seen=seen, sigma=sigma.get)
    told = fitted_std(of, np.concatenate([*blocks, [[9.0, 9.0, 9.0]]]), spread())
    for (r, c), J in SLOPES.items():
        by_hand = expected(J).ravel()
        by_hand[lost[r, c]] = np.nan
        np.testing.assert_allclose(told[r][c], by_hand.reshape(SHAPES[r, c]), rtol=1e-12)


AMOUNT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 0.75])
WAYS = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.0, 1.0]])
LENGTHS = np.array([3.0, 2.0, 1.0])
PLACES = RNG.normal(size=(3, 3)) + AMOUNT[:, None, None] * LENGTHS[:, None] * WAYS
MOVED = RNG.normal(size=(8, 3, 3, 3))  # frames, markers, axes, parameters
# Of markers 0 ... 2: one lost for a frame, one of whose places a single axis was lost, all lost in the last frame.
SEEN = np.ones((8, 3, 3), bool)
SEEN[2, 1], SEEN[4, 2, 0], SEEN[7] = False, False, False


def mean_way() -> np.ndarray:
    """Std of the mean over markers seen whole of how far each goes along its own way; zero where none is."""
    told = []
    for k in range(8):
        whole = [m for m in range(3) if SEEN[k, m].all()]
        slope = np.mean([WAYS[m] @ MOVED[k, m] for m in whole], axis=0) if whole else np.zeros(3)
        told.append(math.sqrt(slope @ COVARIANCE @ slope))
    return np.array(told)


def test_markers_have_the_error_of_the_mean_of_their_ways():
    sigma, before = 1e-2, 4
    flat = np.flatnonzero(SEEN.ravel())
    jacobian = np.concatenate([np.ones((before, 3)), MOVED.reshape(-1, 3)[flat] / sigma, np.ones((2, 3))])
    keys = {"force": ("press", "force"), "markers": ("press", "markers")}
    of = problem(
        None,
        rows={keys["force"]: slice(0, before), keys["markers"]: slice(before, before + len(flat))},
        seen={keys["force"]: np.arange(before), keys["markers"]: flat},
        sigma=lambda key: sigma if key == keys["markers"] else 1.0,
    )
    predicted = recordings({keys["force"]: np.zeros((2, 2)), keys["markers"]: PLACES})
    told = marker_std(of, jacobian, spread(), predicted)
    assert {r: list(c) for r, c in told.items()} == {"press": ["markers"]}  # forces are no markers
    np.testing.assert_allclose(told["press"]["markers"], mean_way(), rtol=1e-9, atol=1e-12)


def test_held_out_markers_are_left_out_where_they_were_lost_and_forces_taken_as_they_are():
    force = SLOPES["one", "force"]
    slopes = {("press", "force"): force, ("press", "markers"): MOVED, ("other", "flow"): SLOPES["one", "flow"]}
    measured = {("press", "markers"): np.where(SEEN, 1.0, np.nan), ("press", "force"): np.full((4, 3), np.nan)}
    predicted: Any = recordings(
        {("press", "force"): np.zeros((4, 3)), ("press", "markers"): PLACES, ("other", "flow"): np.zeros(5)}
    )
    predictor = Predictor(slopes, measured)
    told = held_out_std(problem(predictor), {"a": 1.0}, spread(), predicted)
    assert predictor.asked[0] == ("press", "other")
    assert {r: set(c) for r, c in told.items()} == {"press": {"force", "markers"}, "other": {"flow"}}
    np.testing.assert_allclose(told["press"]["markers"], mean_way(), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(told["press"]["force"], expected(force), rtol=1e-12)
    np.testing.assert_allclose(told["other"]["flow"], expected(SLOPES["one", "flow"]), rtol=1e-12)


@pytest.mark.parametrize(
    ("noise", "widening", "own"), [(4.0, 1.5, 6.0), (4.0, 1.0, 4.0), (None, 2.0, 0.0), (0.0, 1.0, 0.0)]
)
@pytest.mark.parametrize("dof", [math.inf, 7.0])
def test_the_half_width_is_the_quantile_of_curve_and_noise_together(noise, widening, own, dof):
    std = np.array([0.0, 2.5, 8.0])
    law = norm if math.isinf(dof) else student(dof)
    for level, q in ((0.95, law.ppf(0.975)), (0.8, law.ppf(0.9))):
        told = half_width(std, noise, spread(widening=widening, dof=dof), level)
        np.testing.assert_allclose(told, q * np.hypot(std, own), rtol=1e-9)
    usual = half_width(std, noise, spread(widening=widening, dof=dof))
    np.testing.assert_allclose(usual, law.ppf(0.975) * np.hypot(std, own), rtol=1e-9)
