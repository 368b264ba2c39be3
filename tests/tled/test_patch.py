"""Patch tests, rigid rotation and the size of the stable step: what a solid element must do before anything else."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.tled import cases
from tissuejax.elements.hex8 import Hex8
from tissuejax.elements.hex8_bending import Hex8Bending
from tissuejax.elements.tet4 import Tet4
from tissuejax.mesh.columns import box
from tissuejax.tled import internal, stable

A = np.array([[0.05, 0.02, -0.03], [0.01, -0.04, 0.02], [0.03, 0.01, 0.02]])
SIZE, COUNTS = (0.03, 0.03, 0.02), (3, 3, 3)


def balance(scene, u):
    """Internal forces, and those of one element, to scale them by."""
    f = solid(scene, jnp.asarray(u.T))
    return np.asarray(f).T, float(jnp.abs(f).max())


@jax.jit
def solid(scene, u):
    mesh = internal.mesh(scene)
    return internal.forces(scene, mesh, u, internal.rest(scene, mesh), 1.0)[0]


BENDING = {"element": "hexahedron-bending"}


@pytest.mark.parametrize("kind", ["hexes", "bent hexes", "bent tets", "bending", "bent bending"])
def test_a_homogeneous_strain_is_an_equilibrium_of_the_inner_nodes(kind):
    """Inner forces vanish to rounding, also in hexes bent at random by 15 % of their size: their gradient is the mean
    one (taken at the centre it misses by a quarter of a percent)."""
    g = cases.bent(SIZE, COUNTS) if "bent" in kind else cases.sheared(SIZE, COUNTS)
    inner = np.setdiff1d(np.arange(len(g.points)), cases.surface_nodes(box(SIZE, COUNTS)))
    options = BENDING if "bending" in kind else {}
    scene = cases.plain(cases.tets(g) if "tets" in kind else g, np.arange(2.0), **options)
    f, size = balance(scene, np.asarray(g.points) @ A.T)
    assert len(inner) == 8
    assert np.abs(f[inner]).max() < 1e-12 * size
    if "bending" in kind:
        assert isinstance(scene.body.element, Hex8Bending)
        return
    assert scene.body.element == (Tet4() if "tets" in kind else Hex8(straight=kind == "hexes"))


@pytest.mark.parametrize("kind", ["hexes", "tets", "bending"])
def test_a_rigid_rotation_makes_no_force(kind):
    g, options = cases.bent(SIZE, COUNTS), BENDING if kind == "bending" else {}
    g = cases.tets(g) if kind == "tets" else g
    c, s = np.cos(1.1), np.sin(1.1)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    u = np.asarray(g.points) @ (R - np.eye(3)).T
    f, _ = balance(cases.plain(g, np.arange(2.0), **options), u)
    _, size = balance(cases.plain(g, np.arange(2.0), **options), u + 1e-2 * np.asarray(g.points) @ A.T)
    assert np.abs(f).max() < 1e-10 * size  # rounding: displacements are a hundred times those of the strain in `size`


@pytest.mark.parametrize("kind", ["hexes", "tets", "bending"])
def test_forces_are_the_gradient_of_the_energy_and_the_tangent_is_symmetric(kind, rng):
    """Averaged pressure included; plain hexes without hourglass force, bending ones with it and its energy."""
    g = box((0.02, 0.02, 0.02), (2, 2, 2))
    options = BENDING if kind == "bending" else {"hourglass": 0.0}
    scene = cases.plain(cases.tets(g) if kind == "tets" else g, np.arange(2.0), order=2, **options)
    u, w = 1e-3 * jnp.asarray(rng.normal(size=(2, 3, len(g.points))))

    @jax.jit
    def everything(u, w):
        mesh = internal.mesh(scene)
        slope = jax.grad(lambda u: sum(internal.internal_energy(scene, mesh, u)[::2]))(u)
        force, Kw = jax.jvp(lambda u: solid(scene, u), (u,), (w,))
        return slope, force, Kw, jax.jvp(lambda u: solid(scene, u), (u,), (u,))[1]

    slope, force, Kw, Ku = everything(u, w)
    assert np.allclose(force, slope, rtol=1e-9, atol=1e-12 * np.abs(slope).max())
    assert np.isclose(jnp.vdot(u, Kw), jnp.vdot(w, Ku), rtol=1e-9)


def test_tets_share_their_pressure_at_the_nodes_that_they_share(rng):
    """Energy and forces of Bonet and Burton's average, element by element in numpy: U(J_a), J_a the mean volume ratio
    around a node by volume, K that of the stiffness field; neo-Hookean in shape. Forces by differences."""
    g = cases.tets(cases.bent((0.02, 0.02, 0.02), (2, 2, 2)))
    field = rng.uniform(0.5, 2.0, len(g.cells))
    scene = cases.plain(g, np.arange(2.0)).put({"tissue.stiffness": jnp.asarray(field)})
    cells, u = np.asarray(g.cells), 1e-3 * rng.normal(size=g.points.shape)
    edges = lambda x: x[cells[:, 1:]] - x[cells[:, :1]]  # noqa: E731
    inverse = np.linalg.inv(edges(g.points))
    volume = np.linalg.det(edges(g.points)) / 6

    def spread(x):
        return np.bincount(cells.ravel(), np.repeat(volume * x / 4, 4), len(g.points))

    def energy(u):
        F = (inverse @ edges(g.points + u)).swapaxes(1, 2)
        J = np.linalg.det(F)
        shape = cases.NEO["C10"] * ((F**2).sum((1, 2)) * J ** (-2 / 3) - 3)
        U = 0.5 * cases.BULK["K"] * (spread(J) / spread(1.0) - 1) ** 2
        return np.sum(volume * field * shape) + np.sum(spread(field) * U)

    mesh = internal.mesh(scene)
    told = jax.jit(lambda u: internal.internal_energy(scene, mesh, u)[0])(jnp.asarray(u.T))
    assert float(told) == pytest.approx(energy(u), rel=1e-12)
    f, size = balance(scene, u)
    for node, axis in ((0, 2), (5, 0), (13, 1), (26, 2)):
        step = np.zeros_like(u)
        step[node, axis] = 1e-8
        assert f[node, axis] == pytest.approx((energy(u + step) - energy(u - step)) / 2e-8, abs=1e-6 * size)


def test_the_fastest_vibration_of_a_chain_is_the_root_of_its_greatest_eigenvalue():
    """Two masses between two walls, springs k (s + s^3) drawn out by e: (1 + 3 e^2) K along, nothing across."""
    mass, k, e = np.array([1.0, 2e-3, 5e-3, 1.0]), 3.0, 0.4
    held = jnp.ones((3, 4), bool).at[0, 1:3].set(False)

    def force(u):
        s = jnp.diff(u[0])
        t = k * (s + s**3)
        return jnp.zeros_like(u).at[0].set(jnp.pad(-t, (0, 1)) + jnp.pad(t, (1, 0)))

    found = jax.jit(lambda u: stable.fastest(force, jnp.asarray(mass), held, u))(e * jnp.tile(jnp.arange(4.0), (3, 1)))
    K = k * (1 + 3 * e**2) * np.array([[2, -1], [-1, 2]]) / np.sqrt(np.outer(mass[1:3], mass[1:3]))
    assert float(found) == pytest.approx(np.sqrt(np.linalg.eigvalsh(K)[-1]), rel=1e-9)


@pytest.mark.parametrize("kind", ["hexes", "tets", "tall", "bent", "bending", "tall bending"])
def test_the_critical_step_is_that_of_the_fastest_vibration(kind):
    """Largest eigenvalue of M^-1 K by power iteration on a free-topped block, against the estimate and its safety."""
    g = {"tall": lambda: box((0.03, 0.03, 0.006), (4, 4, 4)), "bent": cases.bent}.get(
        kind.split()[0], lambda: box(SIZE, COUNTS)
    )()
    options = BENDING if "bending" in kind else {}
    scene = cases.plain(cases.tets(g) if kind == "tets" else g, np.arange(2.0), **options)
    mesh = jax.jit(internal.mesh)(scene)
    held = jnp.ones(len(g.points)).at[scene.body.fixed].set(0.0)

    @jax.jit
    def apply(w):
        return held * jax.jvp(lambda u: solid(scene, u), (jnp.zeros_like(w),), (w,))[1] / mesh.mass

    w = jnp.asarray(np.random.default_rng(0).normal(size=(3, len(g.points))))
    w = jax.lax.fori_loop(0, 300, lambda _, w: apply(w / jnp.linalg.norm(w)), w)
    true = 2 / np.sqrt(float(jnp.linalg.norm(w)))
    estimate = float(stable.critical_steps(scene).min())
    assert 0.95 < true / estimate < 2.5
