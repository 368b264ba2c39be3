"""A clamped beam one element high, against Timoshenko: what the bending element is for, and what the plain one does."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, internal

HEIGHT, MU = 0.01, 1000.0


def sag(element: str | None, along: int, poisson: float, slender: float = 10.0) -> float:
    """Deflection of the end of a beam of square section under an end load, over Timoshenko's; linear, dense algebra."""
    length = slender * HEIGHT
    g = box((length, HEIGHT, HEIGHT), (along, 1, 1))
    x = np.asarray(g.points)
    clamped = np.flatnonzero(x[:, 0] < x[:, 0].min() + 1e-9)
    body = Geometry(g.points, g.cells, g.cell_type, clamped)
    bulk = 2 * MU * (1 + poisson) / (3 * (1 - 2 * poisson))
    scene = build.scene(
        body,
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), dict(C10=MU / 2), dict(K=bulk), 1000.0),
        np.arange(2.0) * 1e-3,
        numerics=build.Numerics(element=element),
    )
    mesh = internal.mesh(scene)
    none = internal.rest(scene, mesh)
    tangent = jax.jit(jax.jacfwd(lambda u: internal.forces(scene, mesh, u, none, 0.0)[0]))(jnp.zeros((3, len(x))))
    n = x.size
    free = np.setdiff1d(np.arange(n), np.concatenate([clamped + k * len(x) for k in range(3)]))
    end = np.flatnonzero(x[:, 0] > x[:, 0].max() - 1e-9)
    load = np.zeros(n)
    load[2 * len(x) + end] = -1e-6 / 4
    K = np.asarray(tangent).reshape(n, n)[np.ix_(free, free)]
    u = np.linalg.solve(K, load[free])
    moved = np.zeros(n)
    moved[free] = u
    young, inertia, area = 2 * MU * (1 + poisson), HEIGHT**4 / 12, HEIGHT**2
    theory = 1e-6 * (length**3 / (3 * young * inertia) + length / (5 / 6 * MU * area))
    return float(-moved[2 * len(x) + end].mean() / theory)


@pytest.mark.parametrize(("along", "poisson"), [(10, 0.3), (5, 0.3), (2, 0.3), (10, 0.49)])
def test_bending_elements_bend_as_they_should_whatever_their_length(along, poisson):
    """Elements as long as high, twice and five times: within 10 % with a single one through the height (the effect of
    Poisson at the clamp is part of it, and a beam of two elements follows its curvature in two pieces)."""
    assert sag("hexahedron-bending", along, poisson) == pytest.approx(1.0, abs=0.10)


def test_plain_elements_do_so_only_where_they_are_cubes():
    """As is said where a mesh is made (`mesh.columns`): far too stiff where they are five times as long as high."""
    assert sag(None, 10, 0.3) == pytest.approx(0.96, abs=0.05)
    assert sag(None, 2, 0.3) < 0.5


@pytest.mark.parametrize(("true", "chosen"), [(0.0, 0.0), (0.3, 0.3), (0.453, 0.45), (0.4996, 0.5), (-0.2, 0.0)])
def test_poisson_s_ratio_in_bending_is_chosen_by_the_moduli(true, chosen):
    """K = 2 mu (1 + nu) / (3 (1 - 2 nu)), solved to two digits; none below 0."""
    bulk = 2 * MU * (1 + true) / (3 * (1 - 2 * true))
    made = build.scene(
        box((HEIGHT, HEIGHT, HEIGHT), (1, 1, 1)),
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), dict(C10=MU / 2), dict(K=bulk), 1000.0),
        np.arange(2.0) * 1e-3,
        numerics=build.Numerics(element="hexahedron-bending"),
    )
    assert made.body.element.poisson == chosen
