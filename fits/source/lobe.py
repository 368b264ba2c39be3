"""The lobe of the source's 4.1.1.2: 180 x 115 x 40 mm, ex vivo law, settled under gravity, then pressed by 15.5 mm."""

import jax.numpy as jnp
import numpy as np

from tissuejax.energies.ogden import Ogden
from tissuejax.energies.published import ABAQUS, published
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import Lobe, columns
from tissuejax.mesh.facets import area_vectors, boundary, facing_up
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, statics
from tissuejax.tled.shapes import Hemisphere
from tissuejax.tled.simulate import run

MATERIAL = published("ex-vivo-ogden")
K, DENSITY, G = 20e3, 1060.0, 9.81  # Pa (285 times the shear modulus), kg/m^3, m/s^2
DEEPEST, SPEED = 15.5e-3, 1.25e-3  # m, m/s
START = 0.4  # s, when the probe has come down to the surface
# The law is hundreds of times stiffer where it is pressed than at rest, and the hourglass control knows the rest only:
# with 0.3 elements under the probe fold up (their stress point does not feel it) and the force collapses past 11 mm.
HOURGLASS = 10.0
COMPRESSION = 16.0
UPWARD = 1.8  # layers thinner towards the probed top
STEPS = 40  # displacements of 0.3875 mm
FORMS = (ABAQUS, "2mu/alpha", "mu/alpha")


def lobe() -> Lobe:
    """A flat dome of 180 x 115 mm, 40 mm high in the middle and a third of it at the rim."""
    s = np.linspace(0, 1, 41)
    a, b = np.meshgrid(2 * s - 1, 2 * s - 1, indexing="ij")
    top = 0.040 * (0.35 + 0.65 * ((1 - a**2) * (1 - b**2)) ** 0.5)
    return Lobe.of_grid(s, s, 0.090 * a * (1 - 0.12 * b**2), 0.0575 * b * (1 - 0.12 * a**2), np.zeros_like(top), top)


def settled(
    counts: tuple[int, int, int], form: str = ABAQUS, gravity: float = -G, body=None, hourglass: float = HOURGLASS
):
    """The lobe under its weight: mesh and displacement, m, (N, 3). `form`: in which Ogden form the digits are read."""
    geometry = body or columns(lobe(), counts, [np.zeros(2)], core=0.006, ratio=10.0, upward=UPWARD)
    energy = Ogden(form, MATERIAL.energy.order)
    scene = build.scene(
        geometry,
        build.Tissue(energy, Quadratic(), MATERIAL.constants, dict(K=K), DENSITY),
        np.arange(2.0),
        numerics=build.Numerics(hourglass=hourglass),
        gravity=(0, 0, gravity),
    )
    return geometry, np.asarray(statics.gradual(scene, tolerance=1e-6).displacement)


def sag(geometry, u) -> dict:
    """Mean sag of the upper surface (by area seen from above), greatest sag, and the height left in the middle, mm."""
    points = np.asarray(geometry.points)
    middle = np.linalg.norm(points[:, :2], axis=1) < 1e-6
    top = np.flatnonzero(middle)[points[middle, 2].argmax()]
    upper = facing_up(points, boundary(geometry.cells, geometry.cell_type)).nodes
    plan = area_vectors(points, upper)[:, 2]  # area seen from above
    return {
        "mean_mm": -1e3 * float(plan @ u[upper, 2].mean(1) / plan.sum()),
        "greatest_mm": -1e3 * float(u[:, 2].min()),
        "height_mm": 1e3 * float(points[top, 2] + u[top, 2]),
    }


def press(geometry, u, radius: float, compression: float = COMPRESSION, hourglass: float = HOURGLASS):
    """The scene of the press, from `START` on at `SPEED`. A hemisphere under a shank."""
    middle = np.linalg.norm(np.asarray(geometry.points)[:, :2], axis=1) < 1e-6
    height = float((np.asarray(geometry.points) + u)[middle, 2].max())
    end, depth = START + DEEPEST / SPEED, DEEPEST
    time = np.array([0.0, START, end])
    tip = height + radius + 5e-4 - np.array([0.0, 5e-4, 5e-4 + depth])
    path = np.stack([np.zeros(3), np.zeros(3), tip], 1)
    times = (np.arange(160) + 0.5) * end / 160
    return build.scene(
        geometry,
        build.Tissue(MATERIAL.energy, Quadratic(), MATERIAL.constants, dict(K=K), DENSITY),
        times,
        build.ProbePath(time, path, Hemisphere(radius)),
        numerics=build.Numerics(compression=compression, hourglass=hourglass),
        gravity=(0, 0, -G),
        settled=u,
    )


def pressed(geometry, u, radius: float, compression: float = COMPRESSION, hourglass: float = HOURGLASS) -> dict:
    """Force of the probe at each of the forty depths, N, and how the run went."""
    scene = press(geometry, u, radius, compression, hourglass)
    out = run(scene.cast(jnp.float32))
    depths = np.arange(1, STEPS + 1) * DEEPEST / STEPS
    force = np.interp(START + depths / SPEED, np.asarray(out.time), np.asarray(out.force)[:, 2])
    return {
        "depth_mm": (1e3 * depths).tolist(),
        "force_N": force.tolist(),
        "penetration_of_radius": float(out.depth) / radius,
        "hourglass": float(out.hourglass),
        "inertia": float(out.inertia),
        "hexes": len(geometry.cells),
        "steps": scene.clock.frames * scene.clock.steps,
        "step_ms": 1e3 * float(scene.clock.step),
        "penalty_Pa_m": float(scene.probe.penalty),
    }


def reversed_gravity(counts: tuple[int, int, int]) -> dict:
    """How wrong the source's way to the stress-free shape is (2.2.4): gravity upwards on the measured shape, then down.

    mm: how far the shape so found comes back from the measured one, at most and in the root mean square, and the sag.
    """
    geometry, up = settled(counts, gravity=G)
    relaxed = Geometry(np.asarray(geometry.points) + up, geometry.cells, geometry.cell_type, geometry.fixed)
    _, down = settled(counts, body=relaxed)
    miss = np.linalg.norm(up + down, axis=1)
    return {
        "greatest_mm": 1e3 * float(miss.max()),
        "rms_mm": 1e3 * float(np.sqrt((miss**2).mean())),
        "sag_mm": 1e3 * float(np.linalg.norm(down, axis=1).max()),
    }


def exponential(depths_mm, forces) -> dict:
    """F = -a exp(-b x), x = -depth (source eq. 4.14): a in N, b in 1/m, least squares in the force, and R^2."""
    from scipy.optimize import curve_fit

    x, f = 1e-3 * np.asarray(depths_mm), np.asarray(forces)
    (a, b), _ = curve_fit(lambda x, a, b: a * np.exp(b * x), x, f, p0=(0.01, 300.0), maxfev=10_000)
    left = f - a * np.exp(b * x)
    return {"a_N": float(a), "b_1_m": float(b), "r_squared": float(1 - left @ left / ((f - f.mean()) @ (f - f.mean())))}
