"""The source's check of its settings (4.1.1.1): a cylinder of 25.4 mm compressed to a stretch of 0.6 in twenty steps.

Frictionless and nearly incompressible the compression is homogeneous: F = A T (eq. 4.9 to 4.11). The constants of the
source's two-term law are not printed; here are its ex vivo law, of the same data, and its only printed two-term law.
"""

import jax.numpy as jnp
import numpy as np

from tissuejax.energies.ogden import Ogden
from tissuejax.energies.published import published
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.disc import disc
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, statics

RADIUS, HEIGHT = 12.7e-3, 25.4e-3  # m; "2.54 mm" and "40 %" do not fit one height, and the force does not depend on it
STRETCHES = np.linspace(1.0, 0.6, 21)[1:]  # twenty steps
COUNTS = (3, 6)  # elements along a radius, and layers
BULKS = (1e6, 1e7)  # Pa: the closed form is incompressible
LAWS = ("ex-vivo-ogden", "in-vivo-1")


def theory(law: str, stretch) -> np.ndarray:
    """Nominal stress of eq. 4.10 in ABAQUS's form, sum 2 mu / alpha (l^(alpha - 1) - l^(-alpha/2 - 1)), Pa."""
    values, stretch = published(law).constants, np.asarray(stretch, float)[:, None]
    mu, a = (np.array([v for name, v in values.items() if name.startswith(k)]) for k in ("mu", "alpha"))
    return (2 * mu / a * (stretch ** (a - 1) - stretch ** (-a / 2 - 1))).sum(1)


def sample() -> tuple[Geometry, np.ndarray]:
    """The quarter that symmetry leaves, base and top gliding: mesh, and the held axes of its fixed nodes, (F, 3)."""
    mesh = disc(RADIUS, HEIGHT, COUNTS).geometry
    points = np.asarray(mesh.points)
    held = np.stack(
        [points[:, 0] < 1e-9, points[:, 1] < 1e-9, (points[:, 2] < 1e-9) | (points[:, 2] > HEIGHT - 1e-9)], 1
    )
    fixed = np.flatnonzero(held.any(1))
    return Geometry(mesh.points, mesh.cells, mesh.cell_type, fixed), held[fixed].astype(float)


def compressed(law: str, bulk: float) -> dict:
    """Force of the whole sample, N, and bulge of the radius, mm, at each stretch, beside eq. 4.11 and 4.12.

    The force is four times the quarter's, per area of the mesh (its rim is a polygon) times that of the disc.
    """
    geometry, held = sample()
    points, entry = np.asarray(geometry.points), published(law)
    z, order = points[:, 2], entry.energy.order
    energy = Ogden(entry.ogden_form, order)
    scene = build.scene(
        geometry, build.Tissue(energy, Quadratic(), entry.constants, dict(K=bulk), 1000.0), np.arange(2.0), held=held
    )
    pattern = np.zeros((len(geometry.fixed), 3))
    top = z > HEIGHT - 1e-9
    pattern[top[geometry.fixed], 2] = 1.0
    u, before, force, bulge = jnp.zeros_like(jnp.asarray(points)), 1.0, [], []
    for stretch in STRETCHES:
        scene = scene.put(
            {
                "support.time": jnp.arange(2.0),
                "support.displacement": jnp.tile(jnp.array([0.0, 0.0, (stretch - 1) * HEIGHT]), (2, 1)),
                "support.pattern": jnp.asarray(pattern),
                "body.settled": u.at[:, 2].add((stretch - before) * jnp.asarray(z)),  # where the search starts
            }
        )
        u = statics.checked(statics.compiled(scene, tolerance=1e-5, margin=4.0)).displacement
        pull = np.asarray(statics.pull(statics.load(scene), u.T)[0])
        force.append(-float(pull[2, top].sum()) / top_area(geometry) * np.pi * RADIUS**2)
        bulge.append(1e3 * float(np.asarray(u)[np.hypot(points[:, 0], points[:, 1]) > RADIUS * (1 - 1e-9), 0].max()))
        before = stretch
    told = -np.pi * RADIUS**2 * theory(law, STRETCHES)
    error = np.abs(np.array(force) - told)
    return {
        "stretch": STRETCHES.tolist(),
        "force_N": force,
        "eq_4.11_N": told.tolist(),
        "bulge_mm": bulge,
        "greatest_error_N": float(error.max()),
        "at_stretch": float(STRETCHES[error.argmax()]),
        "greatest_force_N": float(told.max()),
        "hexes": len(geometry.cells),
    }


def top_area(geometry: Geometry) -> float:
    """Area of the mesh's base or top, m^2."""
    points = np.asarray(geometry.points)
    ring = points[(points[:, 2] < 1e-9) & (np.hypot(points[:, 0], points[:, 1]) > RADIUS * (1 - 1e-9))]
    angle = np.sort(np.arctan2(ring[:, 1], ring[:, 0]))
    return float(0.5 * RADIUS**2 * np.sin(np.diff(angle)).sum())
