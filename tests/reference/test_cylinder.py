"""Unconfined compression of the source's 25.4 mm cylinder to a stretch of 0.6 (Lister 2012, 4.1.1.1).

Frictionless and nearly incompressible the compression is homogeneous: F = A T and a bulge of R (l^-1/2 - 1) = 3.6957 mm
on the radius (12.7 mm). In vivo 1 in ABAQUS's form of the constants; the theory is `reference/cylinder_theory.csv`,
retold here: T = sum_i 2 mu_i / a_i (l^(a_i - 1) - l^(-a_i/2 - 1)), nominal.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from tissuejax.energies import catalogue
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, statics

RADIUS, HEIGHT, STRETCH = 12.7e-3, 25.4e-3, 0.6
MU, ALPHA = (1818.67, 4.752), (3.277, -10.014)


def cylinder(n: int, layers: int) -> Geometry:
    """A round column of hexes: a square grid pressed into a disc."""
    g = box((2.0, 2.0, HEIGHT), (n, n, layers))
    x, y = g.points[:, 0], g.points[:, 1]
    disc = RADIUS * np.stack([x * np.sqrt(1 - y * y / 2), y * np.sqrt(1 - x * x / 2)], 1)
    return Geometry(np.concatenate([disc, g.points[:, 2:]], 1), g.cells, g.cell_type, g.fixed)


def compressed() -> tuple[float, float, float]:
    """Force, the theory's force, N, and bulge, m: top and base glide; static equilibrium, no symmetry used."""
    g = cylinder(8, 8)
    energy = catalogue.energy("ogden-2", ogden_form="2mu/alpha^2")
    values = {f"mu{i + 1}": MU[i] for i in range(2)} | {f"alpha{i + 1}": ALPHA[i] for i in range(2)}
    z = g.points[:, 2]
    ends = np.flatnonzero((z < 1e-9) | (z > HEIGHT - 1e-9))
    centre = [int(np.argmin(np.linalg.norm(g.points - [0, 0, h], axis=1))) for h in (0.0, HEIGHT)]
    side = int(np.argmin(np.linalg.norm(g.points - [RADIUS, 0, 0], axis=1)))
    held = np.tile([0.0, 0.0, 1.0], (len(ends), 1))
    held[np.isin(ends, centre)] = 1.0  # on the axis
    held[ends == side, 1] = 1.0  # no turning about it
    pattern = np.zeros((len(ends), 3))
    pattern[z[ends] > 1e-9, 2] = 1.0
    body = Geometry(g.points, g.cells, g.cell_type, ends)
    scene = build.scene(
        body,
        build.Tissue(energy, Quadratic(), values, dict(K=1e6), 1000.0),
        np.arange(2.0),
        numerics=build.Numerics(hourglass=0.3),
        held=held,
    )
    u, before = jnp.zeros_like(jnp.asarray(g.points)), 1.0
    for stretch in (0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, STRETCH):
        down = np.tile([0.0, 0.0, (stretch - 1) * HEIGHT], (2, 1))
        scene = scene.put(
            {
                "support.time": jnp.arange(2.0),
                "support.displacement": jnp.asarray(down),
                "support.pattern": jnp.asarray(pattern),
                "body.settled": u.at[:, 2].add((stretch - before) * jnp.asarray(z)),  # where the search starts
            }
        )
        u = statics.checked(statics.compiled(scene, tolerance=1e-5, margin=4.0)).displacement
        before = stretch
    f = np.asarray(press(scene, u))
    area = np.pi * RADIUS**2
    polygon = 0.5 * abs(np.sum(rim(g)[:, 0] * np.roll(rim(g)[:, 1], -1) - rim(g)[:, 1] * np.roll(rim(g)[:, 0], -1)))
    nominal = sum(2 * m / a * (STRETCH ** (a - 1) - STRETCH ** (-a / 2 - 1)) for m, a in zip(MU, ALPHA, strict=True))
    force = f[2, z > HEIGHT - 1e-9].sum()
    middle = np.argmin(np.linalg.norm(g.points - [RADIUS, 0, HEIGHT / 2], axis=1))
    return float(force * area / polygon), float(nominal * area), float(u[middle, 0])


@pytest.mark.slow
def test_force_and_bulge_of_the_compressed_cylinder():
    """Within 0.5 %."""
    force, theory, bulge = compressed()
    assert force == pytest.approx(theory, rel=5e-3)
    assert bulge == pytest.approx(3.6957e-3, rel=5e-3)


def press(scene, u):
    """Internal forces, (3, N), N."""
    at = statics.load(scene)
    return statics.pull(at, u.T)[0]


def rim(g):
    """The base's outline, in order."""
    base = g.points[g.points[:, 2] < 1e-9]
    edge = base[np.isclose(np.linalg.norm(base[:, :2], axis=1), RADIUS, rtol=1e-6)]
    return edge[np.argsort(np.arctan2(edge[:, 1], edge[:, 0]))]
