"""Whitened block means against dense matrices, for all recordings and for some of them."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag, sqrtm
from straight_bench import GAIN, MEANS, N, covariance, scales_of, straight

from tissuejax.diagnosis.judgement.whitening import Whitening
from tissuejax.estimation.discrepancy import Part

diagonal: Any = block_diag
FADING = np.exp(-np.abs(np.subtract.outer(np.arange(MEANS), np.arange(MEANS))) / 4.0)
PARTS = (
    GAIN,
    Part("slow", "slow", within=(FADING, 3 * FADING)),
    Part("law", "law", factor=np.stack([np.linspace(-1, 1, 2 * MEANS), np.cos(np.arange(2.0 * MEANS))], axis=1)),
)
V = np.array([0.02, 0.004, 0.05])
WHOLE = {("p", "q"): slice(0, 2 * MEANS), ("p",): slice(0, MEANS), ("q",): slice(MEANS, 2 * MEANS)}


def made(v: np.ndarray = V) -> Any:
    bench = straight({"own.x": 0.4})
    scales = scales_of(bench, *PARTS)
    return Whitening(bench, scales.cut, scales.blocked, PARTS, v)


def averaged(w: Whitening, x: np.ndarray) -> np.ndarray:
    return np.array([part.mean(axis=0) for part in np.split(x, w.cut.starts[1:])])


def dense(w: Any, rows: slice) -> np.ndarray:
    """(L^-1 K L'^-1)^-1/2 L^-1, with L L' what is block-diagonal of the covariance K."""
    scales = scales_of(w.bench, *PARTS)
    slow = [0, *w.v[1:2], 0]
    root = np.linalg.cholesky(covariance(scales, PARTS, slow)[rows, rows])
    light = np.linalg.solve(root, np.linalg.solve(root, covariance(scales, PARTS, w.v)[rows, rows]).T)
    return np.real(np.linalg.inv(sqrtm(light))) @ np.linalg.inv(root)


@pytest.mark.parametrize("v", [V, V * [0, 1, 0], V * [1, 0, 0], V * 0], ids=str)
@pytest.mark.parametrize("recordings", WHOLE, ids=str)
def test_whitening_is_the_inverse_root_of_the_covariance(v, recordings):
    w, rng = made(v), np.random.default_rng(1)
    by = dense(w, WHOLE[recordings])
    for shape in ((2 * N,), (2 * N, 3), (2 * N, 1)):
        x = rng.standard_normal(shape)
        means = averaged(w, x)[WHOLE[recordings]]
        expected = np.tensordot(by, means, axes=1)
        np.testing.assert_allclose(w.whiten(x, list(recordings)), expected, rtol=1e-8, atol=1e-9)
    assert w.count(recordings) == len(by)


def test_a_residual_is_what_was_measured_less_what_is_predicted():
    w = made()
    prediction = w.bench.predict({"a": 9.0, "b": 21.0})
    left = averaged(w, w.bench.y - prediction)
    np.testing.assert_allclose(w.residual(prediction, ("p", "q")), dense(w, WHOLE["p", "q"]) @ left, rtol=1e-8)
    square = float(left @ np.linalg.solve(covariance(scales_of(w.bench, *PARTS), PARTS, V), left))
    assert np.sum(w.residual(prediction, ("p", "q")) ** 2) == pytest.approx(square, rel=1e-10)


def test_means_are_those_of_the_fitted_recordings_where_nothing_else_is_said():
    w, m = made(), np.random.default_rng(2).standard_normal(2 * MEANS)
    np.testing.assert_allclose(w.whiten_means(m), dense(w, WHOLE["p", "q"]) @ m, rtol=1e-8, atol=1e-9)
    w.bench.fitted = ("q",)
    np.testing.assert_allclose(w.whiten_means(m), dense(w, WHOLE[("q",)]) @ m[MEANS:], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(w.whiten_means(m, ("p",)), dense(w, WHOLE[("p",)]) @ m[:MEANS], rtol=1e-8, atol=1e-9)


def test_of_no_recording_nothing_is_left():
    w = made()
    assert w.whiten(np.ones(2 * N), ()).shape == (0,)
    assert w.whiten(np.ones((2 * N, 3)), []).shape == (0, 3)
    assert w.count(()) == 0
    assert np.sum(diagonal(*w.blocked.within(PARTS, V)) != 0) == 2 * MEANS**2
