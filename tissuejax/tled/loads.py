"""Forces from outside: at nodes, traction on facets, pressure on facets; scaled over time.

    top = facets(scene, lambda x: x[:, 2] > 0.0119)
    scene = onto(scene, Loads(jnp.array([0.0, 1.0]), jnp.array([0.0, 1.0]), facets=top, pressure=500.0))

Nodal forces and tractions are dead: per stress-free area, in a direction that stays. Pressure follows: per present
area, against the present outward normal, so on a closed surface it is minus p times the gradient of the volume inside.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax.errors import InputError
from tissuejax.tled.internal import add
from tissuejax.tled.scene import Scene


class Loads(eqx.Module):
    """What pulls and presses on the tissue; neutral: factor 0.

    Attributes:
        time, factor: of all loads, real time, s; held before and after.
        nodes, force: nodes and the force on each, (n, 3), N.
        facets: nodes of facets, outward (`facets`).
        traction: of the facets, Pa per stress-free area: one vector, or one a facet, (L, 3).
        pressure: on the facets from outside, Pa per present area: one, or one a facet, (L,).
    """

    time: Float[Array, " t"]
    factor: Float[Array, " t"]
    nodes: Int[Array, " n"] | None = None
    force: Float[Array, "n 3"] | None = None
    facets: Int[Array, "L v"] | None = None
    traction: Float[Array, "... 3"] | None = None
    pressure: Float[Array, "..."] | float | None = None


def facets(scene: Scene, where: Callable[[Float[np.ndarray, "m 3"]], np.ndarray]) -> Int[np.ndarray, "L v"]:
    """Boundary facets all of whose nodes satisfy `where` (positions (m, 3) in m to m truths), stress-free shape.

    Raises:
        InputError: there is none.
    """
    nodes = np.asarray(scene.body.facets)
    here = nodes[np.asarray(where(np.asarray(scene.body.points)))[nodes].all(1)]
    if not len(here):
        low, high = (1e3 * f(np.asarray(scene.body.points), 0) for f in (np.min, np.max))
        raise InputError(
            f"no boundary facet has all its nodes where the load is to act; the body reaches from {low.round(2)} to "
            f"{high.round(2)} mm: choose by coordinates in m, with some room around the nodes"
        )
    return here


def onto(scene: Scene, loads: Loads) -> Scene:
    """The scene with loads on it.

    Raises:
        InputError: a part without its partner, nodes that the body does not have, a body that is being cut.
    """
    count = len(scene.body.points)
    if (loads.nodes is None) != (loads.force is None):
        raise InputError("loads at nodes: give `nodes` and `force` together")
    if (loads.facets is None) != (loads.traction is None and loads.pressure is None):
        raise InputError("loads on facets: give `facets` (`loads.facets` finds them) and `traction` or `pressure`")
    for name, nodes in (("nodes", loads.nodes), ("facets", loads.facets)):
        if nodes is not None and not (int(np.min(nodes)) >= 0 and int(np.max(nodes)) < count):
            raise InputError(f"loads.{name}: node {int(np.max(nodes))} of a body that has {count}, counted from 0")
    if scene.faces is not None:
        raise InputError("loads on a body that is being cut: their work is not in its energy balance; take one of both")
    return scene.put({"loads": loads})


def forces(loads: Loads, points: Float[Array, "N 3"], u: Float[Array, "3 N"], factor: Float[Array, ""]) -> Array:
    """Nodal forces (3, N), N, at displacement u and a factor on all."""
    f = jnp.zeros_like(u)
    if loads.nodes is not None:
        f = f.at[:, loads.nodes].add(jnp.asarray(loads.force, u.dtype).T)
    if loads.facets is not None:
        nodes = jnp.asarray(loads.facets).T
        rest, count = points.T[:, nodes], u.shape[1]
        for shape, along, across, weight in _points(nodes.shape[0]):
            at = jnp.zeros((3, nodes.shape[1]), u.dtype)
            if loads.traction is not None:
                size = jnp.linalg.norm(_area(rest, along, across), axis=0)
                at = at + size * jnp.broadcast_to(jnp.asarray(loads.traction, u.dtype), (nodes.shape[1], 3)).T
            if loads.pressure is not None:
                at = at - jnp.asarray(loads.pressure, u.dtype) * _area(rest + u[:, nodes], along, across)
            share = weight * jnp.asarray(shape, u.dtype)[:, None]
            f = f + jnp.stack([add(share * row, nodes, count) for row in at])
    return factor * f


def _area(x: Float[Array, "3 v L"], along: np.ndarray, across: np.ndarray) -> Float[Array, "3 L"]:
    """Normal times area over that of the reference facet."""
    a, b = (jnp.einsum("ivl,v->il", x, jnp.asarray(d, x.dtype)) for d in (along, across))
    return jnp.cross(a, b, axis=0)


def _points(corners: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, float]]:
    """Shape functions, their two derivatives and the weight of each integration point: exact for these facets."""
    if corners == 3:  # the normal is constant: the middle will do
        return [(np.full(3, 1 / 3), np.array([-1.0, 1.0, 0.0]), np.array([-1.0, 0.0, 1.0]), 0.5)]
    found = []
    for a, b in ((x, y) for x in (-1, 1) for y in (-1, 1)):
        a, b = a / np.sqrt(3), b / np.sqrt(3)
        shape = np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)]) / 4
        along = np.array([-(1 - b), 1 - b, 1 + b, -(1 + b)]) / 4
        across = np.array([-(1 - a), -(1 + a), 1 + a, 1 - a]) / 4
        found.append((shape, along, across, 1.0))
    return found
