"""A thin elastic skin on the surface of the organ: an incompressible neo-Hookean membrane on the boundary facets.

Energy per reference area (c/2) (tr M + 1/det M - 3), M = G0^-1 G with the metrics G0, G of the facet's mid-point before
and after; c is shear modulus times thickness, N/m. Forces are its gradient. (Plane stress: Holzapfel 2000, 6.5.)
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.tled.scene import Body


class Skin(NamedTuple):
    """Inverse reference metric (three arrays (S,)), reference area (S,), nodes (v, S) and reference positions."""

    metric: tuple[Float[Array, " S"], ...]
    area: Float[Array, " S"]
    nodes: Int[Array, "v S"]
    x: Float[Array, "3 v S"]


def _tangents(x):
    """Two tangents at the middle of a facet, over reference coordinates of measure one."""
    if x.shape[1] == 3:
        return x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    return (x[:, 1] + x[:, 2] - x[:, 0] - x[:, 3]) / 2, (x[:, 2] + x[:, 3] - x[:, 0] - x[:, 1]) / 2


def _metric(x):
    a, b = _tangents(x)
    return jnp.sum(a * a, 0), jnp.sum(a * b, 0), jnp.sum(b * b, 0)


def skin(body: Body) -> Skin:
    """Reference quantities of the boundary facets."""
    nodes = body.facets.T
    x = body.points.T[:, nodes]
    aa, ab, bb = _metric(x)
    det = aa * bb - ab * ab
    measure = 0.5 if x.shape[1] == 3 else 1.0
    return Skin((bb / det, -ab / det, aa / det), measure * jnp.sqrt(det), nodes, x)


def energy(skin: Skin, capsule: Float[Array, ""], u: Float[Array, "3 v S"]) -> Float[Array, ""]:
    """Energy of the membrane, J, from the displacements of its facets' nodes."""
    aa, ab, bb = _metric(skin.x + u)
    i11, i12, i22 = skin.metric
    stretch = i11 * aa + 2 * i12 * ab + i22 * bb
    area_ratio = (aa * bb - ab * ab) * (i11 * i22 - i12 * i12)
    return jnp.sum(skin.area * (capsule / 2) * (stretch + 1 / area_ratio - 3))


def ballast(body: Body, capsule: Float[Array, ""], step: Float[Array, ""]) -> Float[Array, " N"]:
    """Mass with which the membrane alone would stand a time step, kg a node; nothing without a membrane.

    A facet's stiffness is at most k = 4 c area sum |grad N|^2 (plane stress of an incompressible sheet, trace bound);
    nodes of mass k h^2 / 4 vibrate with omega h <= 2. Twice that, since a squeezed sheet stiffens.
    """
    ((aa, ab, bb), area, nodes, _) = skin(body)  # inverse metric of the mid-point
    count = nodes.shape[0]
    spread = aa + bb if count == 4 else 2 * (aa + ab + bb)
    mass = 2 * (4 * capsule * area * spread) * step**2 / 4
    return (
        jnp.zeros_like(body.points[:, 0]).at[nodes].add(jnp.broadcast_to(mass, nodes.shape).astype(body.points.dtype))
    )


def forces(skin: Skin, capsule: Float[Array, ""], u: Float[Array, "3 N"]) -> Float[Array, "3 N"]:
    """Internal forces of the membrane, (3, N), N."""
    ue = u.at[:, skin.nodes].get(mode="promise_in_bounds")
    f = barrier(jax.grad(lambda w: energy(skin, capsule, w))(ue))
    return jnp.zeros_like(u).at[:, skin.nodes].add(f, mode="promise_in_bounds")
