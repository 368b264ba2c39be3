"""A flat punch with a rounded edge as a probe: its distance, and its force on a bonded layer."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.tled import build, statics
from tissuejax.tled.shapes import Punch

RADIUS, EDGE = 0.005, 0.001


def test_the_distance_is_that_of_the_nearest_point_of_the_outline(rng):
    """Outline sampled densely: the face, the quarter circle of the edge, the side; the normal by differences."""
    angle = np.linspace(0, np.pi / 2, 4001)
    core = RADIUS - EDGE
    face = np.stack([np.linspace(0, core, 4001), np.full(4001, -RADIUS)])
    edge = np.stack([core + EDGE * np.sin(angle), EDGE - RADIUS - EDGE * np.cos(angle)])
    side = np.stack([np.full(4001, RADIUS), np.linspace(EDGE - RADIUS, 0.02, 4001)])
    outline = np.concatenate([face, edge, side], axis=1)
    punch = Punch(RADIUS, EDGE)
    x = rng.uniform([-0.01, -0.01, -0.01], [0.01, 0.01, 0.004], (300, 3)).T
    gap, normal = (np.asarray(a) for a in punch.distance(tuple(x)))
    rho = np.hypot(x[0], x[1])
    nearest = np.sqrt(((outline[:, None] - np.stack([rho, x[2]])[:, :, None]) ** 2).sum(0)).min(1)
    np.testing.assert_allclose(np.abs(gap), nearest, atol=5e-6)
    inside = (rho < RADIUS) & (x[2] > -RADIUS)
    corner = np.hypot(rho - core, x[2] - (EDGE - RADIUS)) > EDGE
    outside = ~inside | (corner & (rho > core) & (x[2] < EDGE - RADIUS))
    np.testing.assert_array_equal(gap > 0, outside)
    for k in range(3):
        shift = np.zeros((3, 1))
        shift[k] = 1e-7
        slope = (
            np.asarray(punch.distance(tuple(x + shift))[0]) - np.asarray(punch.distance(tuple(x - shift))[0])
        ) / 2e-7
        smooth = np.abs(np.linalg.norm(normal, axis=0) - 1) < 1e-9
        assert smooth.all()
        assert np.quantile(np.abs(slope - normal[k]), 0.98) < 1e-6  # but beside the bisector of face and side


def test_the_normal_turns_with_the_point_in_every_region():
    """Its derivative, backwards, in closed form: one over the distance from the axis around the side, from the edge's
    circle around that, none under the face; inside the core, where nothing is nearer than the face or the side, too."""
    core, circle = RADIUS - EDGE, EDGE - RADIUS
    places = [
        ((0.6 * core, -RADIUS - 3e-4), (0.0, 0.0)),  # under the face
        ((0.6 * core, circle + 2e-4), (0.0, 0.0)),  # in the core, the face nearer
        ((core - 2e-4, circle + 1e-3), (0.0, 1.0 / (core - 2e-4))),  # in the core, the side nearer
        ((RADIUS + 3e-4, 0.001), (0.0, 1.0 / (RADIUS + 3e-4))),  # beside the side
        ((core + 3e-4, circle - 4e-4), (0.64 / 5e-4, 0.6 / (core + 3e-4))),  # at the edge: 3, 4, 5
    ]
    turn = jax.jit(jax.vmap(jax.jacrev(lambda x: jnp.stack(Punch(RADIUS, EDGE).distance(tuple(x))[1]))))
    found = np.asarray(turn(jnp.asarray([(rho, 0.0, z) for (rho, z), _ in places])))
    for made, (_, (radial, around)) in zip(found, places, strict=True):
        assert made[0, 0] == pytest.approx(radial, rel=1e-9, abs=1e-9)
        assert made[1, 1] == pytest.approx(around, rel=1e-9, abs=1e-9)


def layer_factor(ratio, n):
    """Force over 8 mu a d of a punch on a bonded incompressible layer, a / h = ratio: a Fredholm equation of its Abel
    transform, phi(t) + (2/pi) int phi(s) int (M(k h) - 1) cos kt cos ks dk ds = 1 (Lebedev and Ufliand 1958)."""
    t, w = np.polynomial.legendre.leggauss(n)
    t, w = 0.5 * (t + 1) * ratio, 0.5 * w * ratio
    k = np.linspace(1e-6, 30, 3001)
    m = (np.sinh(2 * k) - 2 * k) / (np.cosh(2 * k) + 1 + 2 * k**2) - 1
    c = np.cos(np.outer(t, k))
    kernel = np.trapezoid(m * c[:, None] * c[None], k, axis=2)
    phi = np.linalg.solve(np.eye(n) + 2 / np.pi * kernel * w, np.ones(n))
    return float(phi @ w) / ratio


@pytest.mark.parametrize(("ratio", "kappa"), [(0.2, 1.281), (0.4, 1.683), (0.6, 2.211), (0.8, 2.855), (1.0, 3.609)])
def test_the_layer_factor_is_the_published_one(ratio, kappa):
    """Hayes, Keer, Herrmann and Mockros 1972, J. Biomech. 5:541, Poisson's ratio 1/2."""
    assert layer_factor(ratio, 20) == pytest.approx(kappa, rel=0.004)


@pytest.mark.slow
def test_a_punch_feels_a_bonded_layer_as_thick_as_it_is_wide():
    """0.1 mm deep, elements of a third of the radius: to some per cent."""
    height, depth, mu = 0.01, 1e-4, 2 * cases.NEO["C10"]
    g = box((0.04, 0.04, height), (26, 26, 6))
    top = height + RADIUS
    path = np.array([[0, 0, top + 1e-4], [0, 0, top - depth]])
    scene = build.scene(
        g,
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), cases.NEO, {"K": 100 * mu}, 1000.0),
        np.array([0.25, 0.75]),
        build.ProbePath(np.array([0.0, 1.0]), path, Punch(jnp.asarray(RADIUS), jnp.asarray(1e-4))),
    )
    found = statics.checked(statics.compiled(scene, 1.0, tolerance=1e-5, margin=3.0))
    expected = 8 * mu * RADIUS * depth * layer_factor(RADIUS / height, 20)
    assert float(found.force[2]) == pytest.approx(expected, rel=0.08)
