"""A marker sits on a facet of the surface, at its own place in it, and moves with the facet's nodes.

Taking the nearest node instead (`nearest_nodes`) moves a marker by up to half an element; it is here for comparison.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from tissuejax.errors import InputError
from tissuejax.mesh.facets import Facets

FARTHEST = 5e-3  # m: a marker farther off the surface than this is not on it


class Attached(NamedTuple):
    """Markers on facets: displacement of marker k = sum_v weights[k, v] u[nodes[k, v]].

    Attributes:
        nodes, weights: the facet's nodes and shape functions at the marker.
        rest: measured rest positions, m.
        distance: from the rest position to the meshed surface, m.
    """

    nodes: Int[np.ndarray, "k v"]
    weights: Float[np.ndarray, "k v"]
    rest: Float[np.ndarray, "k 3"]
    distance: Float[np.ndarray, " k"]


def attach(
    rest: Float[np.ndarray, "k 3"], points: Float[np.ndarray, "N 3"], facets: Facets, farthest: float = FARTHEST
) -> Attached:
    """The closest point of the surface to each marker, in the facet's own coordinates.

    Raises:
        InputError: a marker that is NaN throughout or farther off the surface than `farthest` (which, where, how far).
    """
    rest = np.asarray(rest, float)
    missing = np.flatnonzero(~np.isfinite(rest).all(1))
    if len(missing):
        raise InputError(
            f"markers {missing.tolist()} have no rest position (NaN throughout, out of contact); drop them"
        )
    x = np.asarray(points)[facets.nodes]
    found = []
    for place in rest:
        near = np.argsort(np.linalg.norm(x.mean(1) - place, axis=1))[:12]
        q = _closest(x[near], place)
        weights = shape(q, facets.nodes.shape[1])
        gap = np.linalg.norm(np.einsum("fv,fvd->fd", weights, x[near]) - place, axis=1)
        best = gap.argmin()
        found.append((facets.nodes[near[best]], weights[best], gap[best]))
    nodes, weights, distance = (np.array(v) for v in zip(*found))
    far = np.flatnonzero(distance > farthest)
    if len(far):
        k = far[distance[far].argmax()]
        raise InputError(
            f"{len(far)} markers lie off the surface; marker {k} at {np.round(1e3 * rest[k], 1).tolist()} mm is "
            f"{1e3 * distance[k]:.1f} mm away (allowed {1e3 * farthest:.1f}); check frame, registration and units"
        )
    return Attached(nodes, weights, rest, distance)


def shape(q: Float[np.ndarray, "f 2"], corners: int) -> Float[np.ndarray, "f v"]:
    """Shape functions of a facet: bilinear over [-1, 1]^2 or barycentric."""
    a, b = q[..., 0], q[..., 1]
    if corners == 3:
        return np.stack([1 - a - b, a, b], -1)
    return np.stack([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)], -1) / 4


def _closest(x: Float[np.ndarray, "f v 3"], place: Float[np.ndarray, "3"]) -> Float[np.ndarray, "f 2"]:
    """Facet coordinates of the closest point, by Gauss-Newton kept inside the facet."""
    corners = x.shape[1]
    q = np.full((len(x), 2), 1 / 3 if corners == 3 else 0.0)
    for _ in range(30):
        a, b = q[:, :1], q[:, 1:]
        if corners == 3:
            da, db = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
        else:
            da = ((1 - b) * (x[:, 1] - x[:, 0]) + (1 + b) * (x[:, 2] - x[:, 3])) / 4
            db = ((1 - a) * (x[:, 3] - x[:, 0]) + (1 + a) * (x[:, 2] - x[:, 1])) / 4
        r = place - np.einsum("fv,fvd->fd", shape(q, corners), x)
        J = np.stack([da, db], 2)
        step = np.linalg.solve(np.einsum("fdi,fdj->fij", J, J), np.einsum("fdi,fd->fi", J, r)[..., None])[..., 0]
        q = q + step
        if corners == 3:
            q = np.clip(q, 0, 1)
            q = q / np.maximum(q.sum(1, keepdims=True), 1)
        else:
            q = np.clip(q, -1, 1)
    return q


def nearest_nodes(rest: Float[np.ndarray, "k 3"], points: Float[np.ndarray, "N 3"], facets: Facets) -> Attached:
    """Each marker on the nearest surface node, as the source does it."""
    surface = np.unique(facets.nodes)
    d = np.linalg.norm(np.asarray(rest)[:, None] - np.asarray(points)[surface][None], axis=2)
    best = d.argmin(1)
    nodes = np.repeat(surface[best][:, None], facets.nodes.shape[1], 1)
    weights = np.zeros(nodes.shape)
    weights[:, 0] = 1
    return Attached(nodes, weights, np.asarray(rest, float), d.min(1))
