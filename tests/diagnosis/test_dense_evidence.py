"""The linearised evidence against dense matrices: its value, slopes, information, and what it is along one part."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from straight_bench import flat

from tissuejax.diagnosis.judgement.marginal import (
    Blocked,
    Linear,
    factored,
    inverted,
    marginal,
    root,
    smooth,
)
from tissuejax.estimation.discrepancy import Part

diagonal: Any = block_diag
ROWS = (slice(0, 5), slice(5, 12))
N = 12
V = np.array([0.3, 0.05, 0.8, 0.02])


def definite(rng: np.random.Generator, n: int) -> np.ndarray:
    a = rng.standard_normal((n, n))
    return a @ a.T / n + 0.1 * np.eye(n)


def drawn(seed: int, kind: str = "white") -> tuple[Linear, Any, Blocked]:
    """Two blocks, two smooth parts and two within blocks in turn, and a flat parameter between two with priors."""
    rng = np.random.default_rng(seed)
    within = [tuple(definite(rng, r.stop - r.start) for r in ROWS) for _ in range(2)]
    parts = (
        Part("law", "law", rng.standard_normal((N, 2))),
        Part("slow", "slow", within=within[0]),
        Part("gain", "gain", rng.standard_normal((N, 1))),
        Part("white", "white", within=within[1]),
    )
    blocked = Blocked(ROWS, rng.uniform(0.3, 0.9, N))
    if kind == "shared":
        blocked = replace(blocked, shared=np.array([0.4, 0.7]))
    if kind == "coloured":
        blocked = replace(blocked, noise=tuple(definite(rng, r.stop - r.start) for r in ROWS))
    weak, offset = np.array([2.5, 0.0, 0.4]), np.array([0.7, 3.0, -1.2])
    return Linear(rng.normal(0, 2, N), rng.standard_normal((N, 3)), offset, weak), parts, blocked


def each(parts) -> list[np.ndarray]:
    return [p.factor @ p.factor.T if p.factor is not None else diagonal(*p.within) for p in parts]


def noise_of(blocked: Blocked) -> np.ndarray:
    k = np.diag(blocked.sigma**2) if blocked.noise is None else diagonal(*blocked.noise)
    for rows, s in zip(blocked.rows, (0.0, 0.0) if blocked.shared is None else blocked.shared, strict=True):
        k[rows, rows] += s**2
    return k


def whole_of(parts, v, blocked: Blocked) -> np.ndarray:
    return noise_of(blocked) + sum(x * b for x, b in zip(v, each(parts), strict=True))


def log_evidence(linear: Linear, parts, v, blocked: Blocked) -> float:
    """Parameters with a prior are so much more covariance about their mean; the flat ones are integrated over."""
    k, known = whole_of(parts, v, blocked), linear.weak > 0
    told = linear.jacobian[:, known]
    y = linear.residual + told @ linear.offset[known]
    k += told @ np.diag(1 / linear.weak[known]) @ told.T
    free = linear.jacobian[:, ~known]
    two_pi = 0.5 * free.shape[1] * np.log(2 * np.pi)
    return flat(y, free, k) - two_pi - 0.5 * float(np.sum(np.log(linear.weak[known])))


def projected(linear: Linear, k: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """P = K^-1 without what the parameters take up, their precision and their step."""
    inverse = np.linalg.inv(k)
    h = linear.jacobian.T @ inverse @ linear.jacobian + np.diag(linear.weak)
    step = np.linalg.solve(h, linear.jacobian.T @ inverse @ linear.residual - linear.weak * linear.offset)
    return inverse - inverse @ linear.jacobian @ np.linalg.solve(h, linear.jacobian.T @ inverse), h, step


@pytest.mark.parametrize("kind", ["white", "shared", "coloured"])
@pytest.mark.parametrize("v", [V, V * [0, 1, 1, 1], V * [0, 1, 0, 1], V * [1, 0, 1, 0], V * 0], ids=str)
def test_value_precision_and_step_are_those_of_dense_matrices(kind, v):
    linear, parts, blocked = drawn(3, kind)
    found = marginal(linear, parts, v, blocked)
    _, h, step = projected(linear, whole_of(parts, v, blocked))
    assert found.value == pytest.approx(log_evidence(linear, parts, v, blocked), abs=1e-9)
    np.testing.assert_allclose(found.precision, h, rtol=1e-9)
    np.testing.assert_allclose(found.step, step, rtol=1e-9)


@pytest.mark.parametrize("kind", ["white", "shared", "coloured"])
@pytest.mark.parametrize("chosen", [(0, 1, 2, 3), (3, 2, 1, 0), (0, 2), (1, 3), (0,), (1,), (2, 0, 1)], ids=str)
def test_slope_and_information_are_traces_of_dense_matrices(kind, chosen):
    """1/2 (r'PBPr - tr PB) and 1/2 tr(P B_a P B_b); for two parts within blocks P is that of each block."""
    linear, every, blocked = drawn(4, kind)
    parts, v = tuple(every[i] for i in chosen), V[list(chosen)]
    found = marginal(linear, parts, v, blocked)
    p, _, step = projected(linear, whole_of(parts, v, blocked))
    z = np.linalg.solve(whole_of(parts, v, blocked), linear.residual - linear.jacobian @ step)
    b = each(parts)
    np.testing.assert_allclose(found.slope, [0.5 * (z @ x @ z - np.trace(p @ x)) for x in b], rtol=1e-8)
    apart = diagonal(*(p[r, r] for r in ROWS))

    def information(i: int, j: int) -> float:
        q = p if parts[i].within is None or parts[j].within is None else apart
        return 0.5 * float(np.trace(q @ b[i] @ q @ b[j]))

    expected = [[information(i, j) for j in range(len(b))] for i in range(len(b))]
    np.testing.assert_allclose(found.fisher, expected, rtol=1e-8)


@pytest.mark.parametrize("k", [0, 2])
def test_along_a_smooth_part_the_evidence_goes_as_the_whole_does(k):
    linear, parts, blocked = drawn(5)
    m = marginal(linear, parts, V, blocked)
    d = np.array([-V[k], -0.5 * V[k], 0.0, 1e-3, 2.0, 1e4])
    here = log_evidence(linear, parts, V, blocked)
    expected = [log_evidence(linear, parts, V + x * (np.arange(4) == k), blocked) - here for x in d]
    np.testing.assert_allclose(m.along(k, d), expected, rtol=1e-8, atol=1e-8)
    assert np.all(np.isfinite(m.along(k, np.array([-1e3]))))  # rounding may lead beyond nothing


@pytest.mark.parametrize("size", [1e4, 1e-4])
def test_a_direction_of_a_part_that_says_ten_orders_less_than_the_whole_is_rounding(size):
    """Of three directions with 1, 1e-9 and 1e-11 of the information the first two count."""
    shares, n = np.array([1.0, 1e-9, 1e-11]) * size, 4
    part = Part("law", "law", np.eye(n)[:, :3] * np.sqrt(shares))
    residual = np.array([3.0, 1e5, 1e6, 0.0])
    linear = Linear(residual, np.eye(n)[:, 3:], np.zeros(1), np.zeros(1))
    m = marginal(linear, (part,), np.zeros(1), Blocked((slice(0, n),), np.ones(n)))
    d = np.array([0.2, 3.0]) / size
    lit = 1 + np.outer(d, shares[:2])
    # of a normal residual whose variance grows from 1 to 1 + d s
    expected = np.sum(-0.5 * np.log(lit) + 0.5 * residual[:2] ** 2 * (1 - 1 / lit), axis=1)
    np.testing.assert_allclose(m.along(0, d), expected, rtol=1e-6)


@pytest.mark.parametrize("power", [-9, 8])
def test_units_of_a_parameter_change_the_evidence_by_their_logarithm_alone(power):
    linear, parts, blocked = drawn(6)
    before, unit = marginal(linear, parts, V, blocked), np.array([1.0, 10.0**power, 1.0])
    after = marginal(replace(linear, jacobian=linear.jacobian * unit), parts, V, blocked)
    assert after.value == pytest.approx(before.value - np.log(10.0**power), abs=1e-7)
    np.testing.assert_allclose(after.step * unit, before.step, rtol=1e-7)
    np.testing.assert_allclose(after.slope, before.slope, rtol=1e-7)
    np.testing.assert_allclose(after.precision, before.precision * np.outer(unit, unit), rtol=1e-7)


def test_of_some_parameters_the_others_are_held():
    linear, *_ = drawn(7)
    some = linear.of(np.array([True, False, True]))
    assert some.residual is linear.residual
    np.testing.assert_array_equal(some.jacobian, linear.jacobian[:, [0, 2]])
    assert some.offset.tolist() == [0.7, -1.2]
    assert some.weak.tolist() == [2.5, 0.4]


@pytest.mark.parametrize("kind", ["white", "shared", "coloured"])
def test_blocks_are_noise_and_parts_within_and_leave_the_noise_as_it_is(kind):
    _, parts, blocked = drawn(8, kind)
    before = None if blocked.noise is None else [b.copy() for b in blocked.noise]
    found = blocked.within(parts, V)
    expected = noise_of(blocked) + V[1] * each(parts)[1] + V[3] * each(parts)[3]
    np.testing.assert_allclose(diagonal(*found), expected * (diagonal(*found) != 0), rtol=1e-12)
    assert [b.shape for b in found] == [(5, 5), (7, 7)]
    if before is not None:
        for b, a in zip(blocked.noise or (), before, strict=True):
            np.testing.assert_array_equal(b, a)


def test_columns_are_those_of_the_smooth_parts_that_act():
    _, parts, _ = drawn(9)
    u = smooth(parts, np.array([4.0, 1.0, 9.0, 1.0]))
    np.testing.assert_allclose(u, np.concatenate([2 * parts[0].factor, 3 * parts[2].factor], axis=1))
    np.testing.assert_allclose(smooth(parts, V * [0, 1, 1, 1]), np.sqrt(V[2]) * parts[2].factor)
    assert smooth(parts, V * 0).shape == (N, 0)
    assert smooth(parts[1:], np.zeros(3)).shape == (N, 0)


def test_as_many_amplitudes_are_asked_for_as_there_are_parts():
    _, parts, blocked = drawn(9)
    for ask in (smooth, blocked.within):
        with pytest.raises(ValueError, match="zip"):
            ask(parts, V[:3])
        with pytest.raises(ValueError, match="zip"):
            ask(parts[:3], V)


def test_a_covariance_its_factor_and_its_inverse(rng):
    a = definite(rng, 6)
    c = root(a)
    np.testing.assert_array_equal(c, np.tril(c))
    np.testing.assert_allclose(c @ c.T, a, rtol=1e-12)
    np.testing.assert_allclose(inverted(c), np.linalg.inv(a), rtol=1e-10)
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        root(a - 2 * np.eye(6) * np.linalg.eigvalsh(a)[-1])
    with pytest.raises(np.linalg.LinAlgError):
        root(np.array([[1.0, 2.0], [2.0, 1.0]]))


@pytest.mark.parametrize(("below", "added"), [(-0.5, 1e-12), (1e-13, 1e-12), (1e-11, 1e-10), (1e-9, 1e-8)])
def test_the_least_is_added_to_a_diagonal_that_makes_it_definite(below, added):
    """1 and 1 + e off the diagonal have an eigenvalue of -e."""
    matrix = np.array([[1.0, 1 + below], [1 + below, 1.0]])
    c = np.tril(factored(matrix)[0])
    np.testing.assert_allclose(c @ c.T - matrix, added * np.eye(2), atol=5e-16)


def test_what_is_further_from_definite_than_rounding_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        factored(np.array([[1.0, 1 + 1e-7], [1 + 1e-7, 1.0]]))
