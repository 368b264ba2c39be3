"""A blade: a wedge with a thickness, a bevel and an edge, whose faces each push the tissue on their own side.

In the blade's frame x is the direction of the cut, y across it, z along the blade; the reference point is the tip (the
foremost, lowest point of the edge). A section normal to the edge is a wedge that widens at the bevel's slope to half
the thickness, and its shoulder is rounded, so that distance and normal are continuous: the signed distance of a convex
corner rounded by `rounding` (exact while penetration is less than that). Ahead of the edge the bevel's plane goes on:
each side of the tissue (`side` -1 or 1 by facet) may cross the middle there without being touched, so the edge never
pushes head-on, which buckles elements, and no normal jumps at the tip, which would hide its force from a derivative.
"""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.errors import InputError
from tissuejax.tled.shapes import Shape, Vector


class Wedge(Shape):
    """A blade with two faces; see the module.

    Attributes:
        thickness: m. slope: rise of one bevel over the way from the edge (tangent of half the bevel angle).
        rounding: radius of the shoulder between bevel and flat, m.
        profile: coefficients of x = c1 z + c2 z^2 + ... (1/m, ...), the edge over the height above the tip; lead or
            lag.
        height: of the edge that the profile describes, m; it goes on straight above. bottom: radius by which the edge
            turns into the blade's lower end at the tip, m; below the tip there is no blade.
        side: -1 or 1 for each facet of the contact patch, or one number.
    """

    name: ClassVar[str] = "wedge"
    by_facet: ClassVar[tuple[str, ...]] = ("side",)
    thickness: Float[Array, ""] | float
    slope: Float[Array, ""] | float
    rounding: Float[Array, ""] | float
    side: Any = 1.0
    profile: Any = ()
    height: Float[Array, ""] | float = jnp.inf
    bottom: Float[Array, ""] | float | None = None

    def distance(self, x: Vector) -> tuple[Array, Vector]:
        """Signed distance of points from the face on their side, m, and the direction in which it grows."""
        behind, forward, upward = self._behind(x)
        cos = 1 / jnp.sqrt(1 + jnp.asarray(self.slope) ** 2)
        sin = self.slope * cos
        half, R = 0.5 * self.thickness, self.rounding
        # a sharp wedge, moved in by R: distance from it less R; a, b from its corner
        a = behind - (half - R + R / cos) / self.slope
        b = self.side * x[1] - (half - R)
        along = a * cos + b * sin
        on_bevel, on_flat = along <= 0, a >= 0
        square = jnp.where(on_bevel | on_flat, 1.0, a * a + b * b)
        length = jnp.sqrt(jnp.where(square > 0, square, 1.0))
        gap = jnp.where(on_bevel, b * cos - a * sin, jnp.where(on_flat, b, length)) - R
        back = jnp.where(on_bevel, -sin, jnp.where(on_flat, 0.0, a / length))
        out = jnp.where(on_bevel, cos, jnp.where(on_flat, 1.0, b / length))
        return gap, (back * forward, out * self.side, back * upward)

    def _behind(self, x: Vector) -> tuple[Array, Array, Array]:
        """Distance behind the edge in the plane of the cut, and its derivatives by x and z."""
        z = jnp.clip(x[2], 0.0, self.height)
        edge, lean = jnp.zeros_like(z), jnp.zeros_like(z)
        for k, c in enumerate(self.profile, start=1):
            edge, lean = edge + c * z**k, lean + k * c * z ** (k - 1)
        edge = edge + lean * (x[2] - z)
        cos = 1 / jnp.sqrt(1 + lean**2)
        behind, forward, upward = (edge - x[0]) * cos, -cos, lean * cos
        if self.bottom is None:
            return behind, forward, upward
        # the edge turns into the lower end: the smaller of the two distances, blended over `bottom`
        share = jnp.clip(0.5 + 0.5 * (x[2] - behind) / self.bottom, 0.0, 1.0)
        least = share * behind + (1 - share) * x[2] - self.bottom * share * (1 - share)
        return least, share * forward, share * upward + (1 - share)


def polynomial(profile: Float[np.ndarray, "p 2"], degree: int = 4) -> tuple[tuple[float, ...], float]:
    """Coefficients of the edge x(z) above the tip, and its height, from a table of x and z (tip first), m.

    A table is a picture's points: a polynomial has a normal that turns without jumps (Lister 2012, fig. 3.8).

    Raises:
        InputError: fewer than two points, or heights that do not rise from the tip up.
    """
    profile = np.asarray(profile, float)
    if profile.ndim != 2 or len(profile) < 2 or not (np.diff(profile[:, 1]) > 0).all():
        raise InputError(
            f"blade/profile of shape {profile.shape}: x and z of the edge from the tip up are needed, at least two "
            "points "
            "with rising z; sort the table, or cut off the back of the blade"
        )
    x, z = (profile - profile[0]).T
    height = float(z[-1])
    powers = np.arange(1, min(degree, len(z) - 1) + 1)
    fitted = np.linalg.lstsq((z[:, None] / height) ** powers, x, rcond=None)[0]
    return tuple(float(c) for c in fitted / height**powers), height
