"""Plane slabs that several tests cut."""

import numpy as np

from tissuejax.cohesion.catalogue import law
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.mesh.split import Split, split
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, seam
from tissuejax.tled.blade import Wedge

MU, BULK = 1564.0, 2600.0


def slab(length: float, half: float, h: float) -> Split:
    """One layer of hexes of size h from x = 0, split along y = 0; every node is fixed (in z; `grip` frees the rest)."""
    g = box((length, 2 * half, h), (round(length / h), round(2 * half / h), 1))
    points = g.points + np.array([length / 2, 0, 0])
    whole = Geometry(points, g.cells, g.cell_type, np.arange(len(points)))
    return split(whole, lambda p: p[:, 1])


def grip(points, half: float) -> np.ndarray:
    """Held axes: z everywhere (plane strain), all at the sides."""
    held = np.zeros_like(points)
    held[:, 2] = 1
    held[np.isclose(np.abs(points[:, 1]), half)] = 1
    return held


def cut(
    length=0.02, half=0.005, h=1e-3, travel=0.014, frames=40, strength=4000.0, energy=2.0, bulk=BULK, friction=None,
    thickness=2e-3, rounding=2e-4, speed=0.05, name="bilinear", damping=20.0, **joint,
):  # fmt: skip
    """A wedge of 30 degrees driven into a slab from its edge."""
    made = slab(length, half, h)
    end = travel / speed
    times = (np.arange(frames) + 0.5) * end / frames
    scene = build.scene(
        made.geometry, NeoHookean(), Quadratic(), {"mu": MU}, {"K": bulk}, 1000.0, times,
        held=grip(made.geometry.points, half), joined=seam.pairs(made), mass_damping=damping,
        hourglass=seam.HOURGLASS,
    )  # fmt: skip
    scene = seam.joined(scene, made, law(name), {"strength": strength, "energy": energy}, **joint)
    wedge = Wedge(thickness, np.tan(np.radians(15)), rounding)
    tip = np.array([[-2e-3, 0, 0], [-2e-3 + travel, 0, 0]])
    return seam.armed(scene, made, wedge, np.array([0, end]), tip, friction=friction)
