"""Shapes of probes: points set off from their outline along its normal."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.tled.shapes import Hemisphere, Platen, Sphere

RADIUS = 0.004
UP = np.array([0.0, 0.0, 1.0])


def outline(name, rng):
    """A shape, points of its outline (60, 3) and the outward normals there."""
    n = rng.normal(size=(60, 3))
    if name == "platen":
        return Platen(), n * [1.0, 1.0, 0.0], np.tile(-UP, (60, 1))
    n /= np.linalg.norm(n, axis=1)[:, None]
    if name == "ball":
        return Sphere(jnp.asarray(RADIUS)), RADIUS * n, n
    n[:, 2] = -np.abs(n[:, 2])
    n[30:, 2] = 0.0  # the shank's
    n /= np.linalg.norm(n, axis=1)[:, None]
    along = np.where(np.arange(60) < 30, 0.0, rng.uniform(0, 0.01, 60))
    return Hemisphere(jnp.asarray(RADIUS)), RADIUS * n + along[:, None] * UP, n


@pytest.mark.parametrize("name", ["ball", "hemisphere", "platen"])
def test_a_point_set_off_along_the_normal_is_so_far_away(name, rng):
    """On either side, as deep as half a radius; the gradient of the distance is that normal."""
    shape, at, n = outline(name, rng)
    off = rng.uniform(-0.5 * RADIUS, RADIUS, 60)
    x = jnp.asarray((at + off[:, None] * n).T)
    gap, normal = shape.distance(tuple(x))
    np.testing.assert_allclose(gap, off, atol=1e-15)
    np.testing.assert_allclose(np.stack(normal).T, n, atol=1e-12)
    slope = jax.grad(lambda x: jnp.sum(shape.distance(tuple(x))[0]))(x)
    np.testing.assert_allclose(slope.T, n, atol=1e-12)
    assert float(shape.reach()) == (np.inf if name == "platen" else RADIUS)


@pytest.mark.parametrize("shape", [Sphere(RADIUS), Hemisphere(RADIUS)])
def test_the_centre_is_a_radius_deep_and_no_derivative_breaks_there(shape):
    gap, pulled = jax.vjp(lambda x: shape.distance(tuple(x))[0], jnp.zeros(3))
    assert float(gap) == -RADIUS
    assert np.isfinite(pulled(jnp.ones(()))[0]).all()
