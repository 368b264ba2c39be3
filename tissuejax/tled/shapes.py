"""Shapes of rigid probes, each by its signed distance (positive outside), from which follows the direction of push."""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.arrays import Given

Vector = tuple[Float[Array, "..."], Float[Array, "..."], Float[Array, "..."]]


def _length(*parts):
    """Euclidean length whose derivative at zero is zero instead of NaN."""
    square = sum(p * p for p in parts)
    safe = jnp.where(square > 0, square, 1.0)
    return jnp.where(square > 0, jnp.sqrt(safe), 0.0)


class Shape(eqx.Module):
    """A rigid shape about its reference point.

    Class data:
        by_facet: names of attributes that may hold one number for each facet that the shape may touch.
    """

    name: ClassVar[str]
    by_facet: ClassVar[tuple[str, ...]] = ()

    @abc.abstractmethod
    def distance(self, x: Vector) -> tuple[Float[Array, "..."], Vector]:
        """Signed distance of points x (relative to the reference point), m, and its gradient (outward normal)."""

    def reach(self) -> Float[Array, ""] | float:
        """Radius, across the probe's axis, within which it may touch; m."""
        return float("inf")


class Sphere(Shape):
    """A ball: |x| - R."""

    name: ClassVar[str] = "sphere"
    radius: Float[Given, ""]

    def distance(self, x: Vector) -> tuple[Array, Vector]:
        r = _length(*x)
        safe = jnp.where(r > 0, r, 1.0)
        return r - self.radius, (x[0] / safe, x[1] / safe, x[2] / safe)

    def reach(self) -> Any:
        return self.radius


class Hemisphere(Shape):
    """A half ball that points down (-z) under a cylindrical shank of the same radius: distance to an upward capsule."""

    name: ClassVar[str] = "hemisphere"
    radius: Float[Given, ""]

    def distance(self, x: Vector) -> tuple[Array, Vector]:
        below = jnp.minimum(x[2], 0.0)
        r = _length(x[0], x[1], below)
        safe = jnp.where(r > 0, r, 1.0)
        return r - self.radius, (x[0] / safe, x[1] / safe, below / safe)

    def reach(self) -> Any:
        return self.radius


class Punch(Shape):
    """A flat-ended cylinder that points down (-z), its edge rounded: |max(q, 0)| + min(max q, 0) - edge.

    q = (rho - R + edge, edge - R - z) of a point at rho from the axis. The reference point lies one radius above the
    middle of the face, as a ball's centre lies above its tip.
    """

    name: ClassVar[str] = "punch"
    radius: Float[Given, ""]
    edge: Float[Given, ""]

    def distance(self, x: Vector) -> tuple[Array, Vector]:
        rho = _length(x[0], x[1])
        safe = jnp.where(rho > 0, rho, 1.0)
        side, below = rho - (self.radius - self.edge), self.edge - self.radius - x[2]
        out = _length(jnp.maximum(side, 0.0), jnp.maximum(below, 0.0))
        reached = jnp.where(out > 0, out, 1.0)
        sideways = jnp.where(out > 0, jnp.maximum(side, 0.0) / reached, jnp.where(side > below, 1.0, 0.0))
        down = jnp.where(out > 0, jnp.maximum(below, 0.0) / reached, jnp.where(side > below, 0.0, 1.0))
        gap = out + jnp.minimum(jnp.maximum(side, below), 0.0) - self.edge
        return gap, (sideways * x[0] / safe, sideways * x[1] / safe, -down)

    def reach(self) -> Any:
        return self.radius


class Platen(Shape):
    """A flat platen that fills the half space above its reference point: -z; it pushes down."""

    name: ClassVar[str] = "platen"

    def distance(self, x: Vector) -> tuple[Array, Vector]:
        zero = jnp.zeros_like(x[2])
        return -x[2], (zero, zero, zero - 1.0)
