"""A block of hexes with a plane of element faces down its middle, to be cut along it."""

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.mesh.columns import _hexes
from tissuejax.mesh.split import Split, split
from tissuejax.recordings.recording import Geometry


def across(half: float, h: float, growth: float = 1.0) -> Float[np.ndarray, " n"]:
    """Lines from -half to half with one at 0; spacing about h there, growing by `growth` from line to line."""
    if growth <= 1.0:
        n = max(2, round(half / h))
        side = np.linspace(0, half, n + 1)
    else:
        n = max(2, round(np.log(1 + half / h * (growth - 1)) / np.log(growth)))
        side = np.concatenate([[0.0], np.cumsum(growth ** np.arange(n))])
        side *= half / side[-1]
    return np.concatenate([-side[:0:-1], side])


def block(
    along: Float[np.ndarray, " a"], over: Float[np.ndarray, " b"], up: Float[np.ndarray, " c"], fixed: str = "all"
) -> Geometry:
    """Hexes between grid lines along x, y, z (m).

    Args:
        fixed: "all" nodes (a slice whose axes are held one by one), "sides" (y ends) or "base" (lowest z).
    """
    if min(len(along), len(over), len(up)) < 2:
        raise InputError(f"block of {len(along)} x {len(over)} x {len(up)} grid lines: at least two along each axis")
    x, y, z = np.meshgrid(along, over, up, indexing="ij")
    points = np.stack([x, y, z], -1).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    held = {"all": index, "sides": index[:, [0, -1]], "base": index[:, :, 0]}[fixed]
    return Geometry(points, _hexes(index), "hexahedron", np.unique(held))


def slice_held(points: Float[np.ndarray, "N 3"], half: float) -> Float[np.ndarray, "N 3"]:
    """Held axes of a plane slice: z everywhere (plane strain), all at the sides y = -half and half."""
    held = np.zeros_like(points)
    held[:, 2] = 1
    held[np.isclose(np.abs(points[:, 1]), half)] = 1
    return held


def plane_slice(length: float, half: float, h: float, growth: float = 1.0) -> Split:
    """One layer of hexes, x from 0 to `length`, split along y = 0; thickness h; every node is "fixed"
    (`slice_held`)."""
    along = np.linspace(0, length, max(2, round(length / h)) + 1)
    return split(block(along, across(half, h, growth), np.array([0.0, h])), lambda p: p[:, 1])
