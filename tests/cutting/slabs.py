"""Plane slabs that several tests cut."""

import jax.numpy as jnp
import numpy as np

from tissuejax.cohesion.catalogue import law
from tissuejax.energies.neo_hookean import NeoHookean
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.slab import across, block, plane_slice, slice_held
from tissuejax.mesh.split import split
from tissuejax.tled import build, seam
from tissuejax.tled.blade import Wedge

MU, BULK = 1564.0, 2600.0


def cut(
    length=0.02, half=0.005, h=1e-3, travel=0.014, frames=40, strength=4000.0, energy=2.0, bulk=BULK, friction=None,
    thickness=2e-3, rounding=None, speed=0.05, name="bilinear", damping=20.0, notched=0.0, **joint,
):  # fmt: skip
    """A wedge of 30 degrees driven into a slab from its edge."""
    made = plane_slice(length, half, h)
    end = travel / speed
    times = (np.arange(frames) + 0.5) * end / frames
    scene = build.scene(
        made.geometry,
        build.Tissue(NeoHookean(), Quadratic(), {"mu": MU}, {"K": bulk}, 1000.0),
        times,
        numerics=build.Numerics(mass_damping=damping, hourglass=seam.HOURGLASS),
        held=slice_held(made.geometry.points, half),
        joined=seam.pairs(made),
    )
    middle = np.asarray(made.geometry.points)[made.minus].mean(1)[:, 0]
    joint |= {"notch": (middle < notched).astype(float)} if notched else {}
    scene = seam.joined(scene, made, law(name), {"strength": strength, "energy": energy}, **joint)
    slope = float(np.tan(np.radians(15)))
    wedge = Wedge(thickness, slope, seam.shoulder(thickness, slope, h) if rounding is None else rounding)
    tip = np.array([[-2e-3, 0, 0], [-2e-3 + travel, 0, 0]])
    return seam.armed(scene, made, wedge, np.array([0, end]), tip, friction=friction)


def _apart(made, held, path, seconds, frames, values, bulk, **joint):
    """A split body whose held nodes move apart: minus side down, plus side up, by path(t)."""
    points = np.asarray(made.geometry.points)
    times = (np.arange(frames) + 0.5) * seconds / frames
    scene = build.scene(
        made.geometry,
        build.Tissue(NeoHookean(), Quadratic(), {"mu": values.pop("mu", MU)}, {"K": bulk}, 1000.0),
        times,
        numerics=build.Numerics(mass_damping=values.pop("damping", 20.0), hourglass=values.pop("hourglass", 0.3)),
        held=held,
        joined=seam.pairs(made),
    )
    scene = seam.joined(scene, made, law("bilinear"), values, **joint)
    at = np.linspace(0, seconds, 401)
    motion = np.zeros((401, 3))
    motion[:, 1] = path(at)
    sign = np.zeros_like(points)
    sign[:, 1] = np.where(np.isin(np.arange(len(points)), np.unique(made.geometry.cells[_upper(made)])), 1.0, -1.0)
    sign = sign * np.asarray(held)
    return scene.put(
        {
            "support.time": jnp.asarray(at),
            "support.displacement": jnp.asarray(motion),
            "support.pattern": jnp.asarray(sign[np.asarray(made.geometry.fixed)]),
        }
    )


def _upper(made):
    return np.asarray(made.geometry.points)[np.asarray(made.geometry.cells)].mean(1)[:, 1] > 0


def pulled(
    h, bulk, ends, energy, length=0.02, half=0.005, notch=0.0, seconds=1.0, frames=60, strength=4000.0, narrow=False
):
    """A slab, notched or not, whose sides are drawn apart by `ends` each, evenly and slowly."""
    made = plane_slice(length, half, h)
    held = slice_held(made.geometry.points, half)
    held[:, 0] = np.maximum(held[:, 0], float(narrow))  # no stretch along the slab either
    middle = np.asarray(made.geometry.points)[made.minus].mean(1)[:, 0]
    values = {"strength": strength, "energy": energy, "damping": 60.0}
    return _apart(
        made, held, lambda t: ends * t / seconds, seconds, frames, values, bulk,
        notch=(middle < notch).astype(float) if notch else None,
    )  # fmt: skip


def cantilever(n: int, seconds: float = 3.0):
    """Double cantilever: arms 5 mm high, 60 mm long, 10 mm wide, crack of 20 mm, E 50 kPa, nu 0; and its opening(t)."""
    h = 5e-3 / n
    made = split(block(np.arange(round(0.06 / h) + 1) * h, across(5e-3, h), np.array([0, 0.01])), lambda p: p[:, 1])
    points = np.asarray(made.geometry.points)
    held = np.zeros_like(points)
    held[:, 2] = 1
    end = np.isclose(points[:, 0], 0) & np.isclose(np.abs(points[:, 1]), 2.5e-3)
    held[end, :2] = 1
    middle = points[made.minus].mean(1)[:, 0]
    values = {"strength": 500.0, "energy": 0.02, "mu": 25e3, "damping": 40.0, "hourglass": 0.3}
    scene = _apart(
        made, held, lambda t: 1.65e-3 * t / seconds, seconds, 150, values, 5e4 / 3, notch=(middle < 0.02).astype(float)
    )
    return scene, lambda t: 2 * 1.65e-3 * t / seconds


def peeled(energy: float, youth: float, thick: float, seconds: float = 12.0, h: float = 5e-4):
    """Two thin arms, 65 mm long and bonded from 15 mm on, whose ends are drawn apart across (T-peel), nu 0; and the way
    of each end (t)."""
    far, length = 0.032, 0.065
    lines = np.arange(round(length / h) + 1) * h
    made = split(block(lines, across(thick, h), np.array([0, 1e-3])), lambda p: p[:, 1])
    points = np.asarray(made.geometry.points)
    held = np.zeros_like(points)
    held[:, 2] = 1
    held[np.isclose(points[:, 0], 0), 1] = 1
    held[np.isclose(points[:, 0], length), 0] = 1
    middle = points[made.minus].mean(1)[:, 0]
    values = {"strength": 1000.0, "energy": energy, "mu": youth / 2, "damping": 10.0}
    notch = (middle < 0.015).astype(float)
    scene = _apart(made, held, lambda t: far * t / seconds, seconds, 240, values, youth / 3, notch=notch)
    return scene, lambda t: far * t / seconds


EDGE = (0.15, -6.0)  # x = 0.15 z - 6 z^2 (m): an edge that leans back by 9 degrees at the tip and turns upright


def drawn(h=1e-3, length=0.014, half=0.004, height=0.008, friction=0.1, travel=0.012, frames=40):
    """A blade with a curved edge goes into a block at a slant, from 3 to 5 mm deep, above tissue that stays whole:
    draw angle, depth that varies along the path, and a blind cut; and where its tip is at every frame's end."""
    up = np.arange(round(height / h) + 1) * h
    body = block(np.arange(round(length / h) + 1) * h, across(half, h), up, "base")
    made = split(body, lambda p: p[:, 1], within=lambda p: p[:, 2] > height - 5e-3)
    end = travel / 0.05
    scene = build.scene(
        made.geometry,
        build.Tissue(NeoHookean(), Quadratic(), {"mu": MU}, {"K": 2e4}, 1000.0),
        (np.arange(frames) + 0.5) * end / frames,
        numerics=build.Numerics(mass_damping=20.0, hourglass=seam.HOURGLASS),
        joined=seam.pairs(made),
    )
    scene = seam.joined(scene, made, law("bilinear"), {"strength": 3000.0, "energy": 2.0})
    slope = float(np.tan(np.radians(15)))
    blade = Wedge(2e-3, slope, seam.shoulder(2e-3, slope, h), profile=EDGE, height=8e-3, bottom=5e-4)
    tip = np.array([[-2e-3, 0, height - 3e-3], [-2e-3 + travel, 0, height - 5e-3]])
    scene = seam.armed(scene, made, blade, np.array([0, end]), tip, friction=friction)
    share = (np.arange(frames) + 1) / frames
    return scene, tip[0] + share[:, None] * (tip[1] - tip[0])
