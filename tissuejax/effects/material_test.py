"""A material test as effects see it: what was done, to what kind of specimen, and when.

All entries are arrays, so that one compiled prediction serves every recording of the same (padded) length; what is
not known of a specimen is NaN here and the effect that needs it does nothing.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.tensors import Sym


class MaterialTest(eqx.Module):
    """One recording of a homogeneous specimen, without its measurement.

    Attributes:
        time: sample times, s; at the end the last one may repeat (padding).
        drive: recorded stretch, or amount of shear.
        second, swell: the second in-plane stretch is drive^second J^swell (tests with one stretch).
        axial: stretch held along the normal of the sheared plates (simple shear), otherwise 1.
        start: this recording's time zero after the sample's first, s.
        area, height, diameter: of the undeformed specimen, m^2 and m; NaN if not recorded.
        frame: rows are the test's axes (loaded, second, free) in the sample's own frame.
        mode: "extension" (one stretch), "biaxial" (two) or "shear".
    """

    time: Float[Given, " n"]
    drive: Float[Given, "n ..."]
    second: Float[Given, ""]
    swell: Float[Given, ""]
    axial: Float[Given, ""]
    start: Float[Given, ""]
    area: Float[Given, ""]
    height: Float[Given, ""]
    diameter: Float[Given, ""]
    frame: Float[Given, "3 3"]
    mode: str = eqx.field(static=True)

    @property
    def elapsed(self) -> Float[Array, " n"]:
        """Time since this recording began, s."""
        return self.time - self.time[0]

    @property
    def rest(self) -> float:
        """The driven quantity of the undeformed specimen: stretch 1, shear 0."""
        return 0.0 if self.mode == "shear" else 1.0


class Stress(eqx.Module):
    """What effects with memory change: the isochoric stress over time, and what it came from.

    Attributes:
        S: isochoric second Piola-Kirchhoff stress in the test's axes, Pa; entries (n,). No shear out of the plane.
        W: isochoric strain energy, Pa, (n,).
        C: right Cauchy-Green tensor in the test's axes, entries (n,).
        spherical: what the isochoric projection took away, Pa, (n,): 2 dpsi/dCbar = S + spherical C^-1.
    """

    S: Sym
    W: Float[Given, " n"]
    C: Sym
    spherical: Float[Given, " n"]

    def scaled(self, factor: Float[Array, " n"]) -> "Stress":
        """With the stress multiplied at every time; energy and strain stay."""
        return Stress(Sym(*(factor * s for s in self.S)), self.W, self.C, factor * self.spherical)

    def stacked(self) -> Float[Array, "n 4"]:
        """The components that are not zero: 11, 22, 33, 12."""
        return jnp.stack([self.S.xx, self.S.yy, self.S.zz, self.S.xy], -1)

    def replaced(self, s: Float[Array, "n 4"]) -> "Stress":
        """With the components 11, 22, 33, 12 of `s`."""
        zero = jnp.zeros_like(s[:, 0])
        return Stress(Sym(s[:, 0], s[:, 1], s[:, 2], s[:, 3], zero, zero), self.W, self.C, self.spherical)

    @property
    def inverse(self) -> Float[Array, "n 4"]:
        """Components 11, 22, 33, 12 of C^-1."""
        C = self.C
        det = C.xx * C.yy - C.xy * C.xy
        return jnp.stack([C.yy / det, C.xx / det, 1 / C.zz, -C.xy / det], -1)
