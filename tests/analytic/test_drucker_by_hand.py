"""Drucker's test of a Mooney-Rivlin law by its Hessian written out, its ranges by roots, and its sentences."""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue
from tissuejax.energies.stability import (
    PATHS,
    PathStability,
    Stability,
    least_eigenvalue,
    log_strain_tangent,
    penalty,
    stability,
)

quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})  # compiled for one use
MOONEY, SOFT = catalogue.energy("mooney-rivlin"), {"C10": 500.0, "C01": -50.0}
L = np.array([0.45, 0.8, 1.0, 1.3, 1.9])


def hessian(c10: float, c01: float, path: str, stretch: np.ndarray) -> np.ndarray:
    """Of W = C10 sum l^2 + C01 sum l^-2 in e1 = ln l1, e2 = ln l2, with l3 = 1 / (l1 l2)."""
    one = stretch
    two = {"uniaxial": stretch**-0.5, "planar": np.ones_like(stretch), "equibiaxial": stretch}[path]
    each = [4 * c10 * l**2 + 4 * c01 * l**-2.0 for l in (one, two, 1 / (one * two))]
    return np.moveaxis(np.array([[each[0] + each[2], each[2]], [each[2], each[1] + each[2]]]), -1, 0)


@pytest.mark.parametrize("path", PATHS)
def test_drucker_of_mooney_and_rivlin_by_hand(path):
    expected = hessian(500.0, -50.0, path, L)
    both = quick(lambda p, l: (log_strain_tangent(MOONEY, p, path, l), least_eigenvalue(MOONEY, p, path, l)))
    tangents, least = both(SOFT, jnp.asarray(L))
    np.testing.assert_allclose(tangents, expected, rtol=1e-11, atol=1e-8)
    np.testing.assert_allclose(least, np.linalg.eigvalsh(expected)[:, 0], rtol=1e-11, atol=1e-8)
    _, soft = both({name: 1e-9 * x for name, x in SOFT.items()}, jnp.asarray(L))
    np.testing.assert_allclose(soft, 1e-9 * np.linalg.eigvalsh(expected)[:, 0], rtol=1e-11, atol=1e-17)


def test_a_penalty_is_the_mean_square_of_what_is_unstable_over_the_size():
    of = {"equibiaxial": L, "uniaxial": np.array([0.9, 6.0, 9.0])}
    expected = 0.0
    for path, stretch in of.items():
        d = hessian(500.0, -50.0, path, stretch)
        least = np.linalg.eigvalsh(d)[:, 0] / np.mean(np.abs(d))
        assert np.any(least < 0)
        assert np.any(least > 0)
        expected += np.mean(np.where(least < 0, least, 0.0) ** 2)
    stretches = {k: jnp.asarray(v) for k, v in of.items()}
    with_slope = quick(jax.value_and_grad(lambda p: penalty(MOONEY, p, stretches)))
    assert float(with_slope(SOFT)[0]) == pytest.approx(expected, rel=1e-10)
    value, slope = with_slope({"C10": 0.0, "C01": 0.0})
    assert float(value) == 0.0
    assert np.all(np.isfinite([float(x) for x in slope.values()]))


def root(low: float, high: float) -> float:
    """Where a state pulled in two directions loses stability: the sign of the least eigenvalue by hand."""
    sign = np.linalg.eigvalsh(hessian(500.0, -50.0, "equibiaxial", np.array([low])))[0, 0] > 0
    for _ in range(60):
        middle = 0.5 * (low + high)
        same = (np.linalg.eigvalsh(hessian(500.0, -50.0, "equibiaxial", np.array([middle])))[0, 0] > 0) == sign
        low, high = (middle, high) if same else (low, middle)
    return low


def test_ranges_and_nearest_ends_on_either_side():
    below, above = root(0.4, 1.0), root(1.0, 3.0)
    assert below == pytest.approx(0.1**0.25, abs=1e-9)
    of = stability(MOONEY, SOFT, (3.0, 0.4), ("equibiaxial", "uniaxial"), 11)
    found = of.paths["equibiaxial"]
    (least, most), *more = found.ranges
    assert not more
    assert (least, most) == pytest.approx((below, above), abs=2.2e-7)
    assert (found.unstable_below, found.unstable_above) == (least, most)
    assert not of.stable
    assert f"equibiaxial from stretch {above:.3f} up and from {below:.3f} down" in of.sentence
    part = stability(MOONEY, SOFT, (1.2, 3.0), ("equibiaxial",), 12).paths["equibiaxial"]
    assert (part.unstable_below, part.unstable_above) == (None, pytest.approx(above, abs=2.2e-7))
    assert part.stretch[0] == pytest.approx(1.2, rel=1e-12)
    part = stability(MOONEY, SOFT, (2.5, 3.0), ("equibiaxial",), 12).paths["equibiaxial"]
    assert (part.unstable_below, part.unstable_above) == (None, pytest.approx(2.5))
    assert part.ranges == ()


def test_what_is_looked_at_is_even_in_the_logarithm_with_rest_among_it():
    found = stability(MOONEY, {"C10": 1.0, "C01": 1.0}, (0.8, 2.0), points=11)
    expected = np.sort(np.append(np.exp(np.linspace(math.log(0.8), math.log(2.0), 11)), 1.0))
    assert list(found.paths) == ["uniaxial", "planar", "equibiaxial"]
    for path in found.paths.values():
        np.testing.assert_allclose(path.stretch, expected, rtol=1e-12)
        assert 1.0 in path.stretch
        np.testing.assert_allclose(
            path.least, np.linalg.eigvalsh(hessian(1.0, 1.0, path.path, expected))[:, 0], rtol=1e-9
        )
    usual = stability(MOONEY, {"C10": 1.0, "C01": 1.0}, paths=("planar",)).paths["planar"].stretch
    assert len(usual) in (201, 202)
    assert (usual[0], usual[-1]) == pytest.approx((0.5, 2.0))
    beyond = stability(MOONEY, {"C10": 1.0, "C01": 1.0}, (1.5, 2.0), ("planar",), 12).paths["planar"].stretch
    np.testing.assert_allclose(beyond, np.geomspace(1.5, 2.0, 12), rtol=1e-12)
    up = stability(MOONEY, {"C10": 1.0, "C01": 1.0}, (1.0, 2.0), ("planar",), 12).paths["planar"].stretch
    np.testing.assert_allclose(up, np.geomspace(1.0, 2.0, 12), rtol=1e-12)


def told(path: str, below: float | None, above: float | None) -> PathStability:
    return PathStability(path, np.array([0.51234, 1.0, 2.0]), np.ones(3), (), below, above)


@pytest.mark.parametrize(("paths", "said"), [
    ([told("a", None, None)], "The material is stable (Drucker) in a between stretches 0.512 and 2."),
    (
        [told("a", None, None), told("b", None, None)],
        "The material is stable (Drucker) in a, b between stretches 0.512 and 2.",
    ),
    (
        [told("a", 0.75, None), told("b", None, 1.25), told("c", None, None), told("d", 0.5, 1.0)],
        "The material is unstable (Drucker), looked at between stretches 0.512 and 2: a from 0.750 down; b from "
        "stretch 1.250 up; d from stretch 1.000 up and from 0.500 down.",
    ),
])  # fmt: skip
def test_the_sentence_on_stability(paths, said):
    of = Stability({p.path: p for p in paths})
    assert of.sentence == said
    assert of.stable == ("unstable" not in said)
    assert [p.stable for p in paths] == [p.unstable_below is None and p.unstable_above is None for p in paths]
