"""Small scenes that several tests share."""

from dataclasses import fields

import numpy as np

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build

NEO = dict(C10=600.0)
POLY = dict(C10=600.0, C20=400.0)
BULK = dict(K=15e3)


def bent(size=(0.03, 0.03, 0.012), counts=(4, 4, 3), amount=0.15, seed=3) -> Geometry:
    """A box of hexes whose inner nodes are moved at random: not parallelepipeds."""
    g = box(size, counts)
    inner = ((g.points > g.points.min(0) + 1e-9) & (g.points < g.points.max(0) - 1e-9)).all(1)
    shift = np.random.default_rng(seed).uniform(-amount, amount, g.points.shape) * np.array(size) / counts
    return Geometry(g.points + shift * inner[:, None], g.cells, g.cell_type, g.fixed)


def sheared(size, counts) -> Geometry:
    """A box of parallelepipeds."""
    g = box(size, counts)
    lean = np.array([[1.0, 0.1, 0.2], [0.05, 1.0, 0.1], [0.0, 0.0, 1.0]])
    return Geometry(g.points @ lean.T, g.cells, g.cell_type, g.fixed)


def tets(g: Geometry) -> Geometry:
    """Six tetrahedra in each hex."""
    six = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    cells = np.concatenate([np.asarray(g.cells)[:, list(t)] for t in six])
    return Geometry(g.points, cells, "tetra", g.fixed)


def surface_nodes(g: Geometry) -> np.ndarray:
    """Nodes on the boundary of a box."""
    on = (np.isclose(g.points, g.points.min(0)) | np.isclose(g.points, g.points.max(0))).any(1)
    return np.flatnonzero(on)


def numerics(options: dict) -> build.Numerics:
    """How a scene is computed, taken out of the options of a case."""
    names = {f.name for f in fields(build.Numerics)} & set(options)
    return build.Numerics(**{name: options.pop(name) for name in names})


def plain(g: Geometry, times, order=1, **options):
    """A scene without probe."""
    values = NEO if order == 1 else POLY
    return build.scene(
        g,
        build.Tissue(ReducedPolynomial(order=order), Quadratic(), values, BULK, 1000.0),
        times,
        numerics=numerics(options),
        **options,
    )


RADIUS = 0.006


def pressed(g: Geometry | None = None, frames=40, order=2, **options):
    """A ball pressed in, held and dragged sideways, then drawn back; over half a second."""
    g = box((0.03, 0.03, 0.012), (5, 5, 3)) if g is None else g
    t = np.linspace(0, 0.5, 51)
    down = np.interp(t, [0, 0.2, 0.3, 0.5], [0.0, 0.0025, 0.0025, 0.001])
    x = np.interp(t, [0, 0.2, 0.4], [0, 0, 0.001])
    top = g.points[:, 2].max()
    path = np.stack([0.0004 + x, np.full(51, 0.0007), top + RADIUS + 2e-4 - down], 1)
    times = (np.arange(frames) + 0.5) * 0.5 / frames
    options = dict(compression=4.0) | options
    return build.scene(
        g,
        build.Tissue(ReducedPolynomial(order=order), Quadratic(), NEO if order == 1 else POLY, BULK, 1000.0),
        times,
        build.ProbePath(t, path, RADIUS),
        numerics=numerics(options),
        **options,
    )
