"""Eight-node hexahedron with one stress point whose hourglass control is the stiffness of bending itself.

The one-point hex (`hex8`) feels bending through its hourglass control alone, with one stiffness for all modes whatever
the shape: elements twice to five times as long as high are 36 to 80 % too stiff or too soft. Here each mode has the
stiffness of the strain that it stands for, by assumed strains without parasitic shear (after Belytschko & Bindeman
1993, Comput. Methods Appl. Mech. Engng 105: quintessential bending, three dimensions), in a parallelepiped with
half-edges a_k along local axes, amplitudes q_i of mode xi_j xi_k:

- bending, two modes for each direction of thickness t (xi_i xi_t along i): e_ii = q_i xi_t / a_i, plane stress, so
  W = E / (1 - nu^2) / 2 (e_ii^2 + e_jj^2 + 2 nu e_ii e_jj) V / 3: exact for beams and plates of such elements,
- twisting and warping, three modes (xi_j xi_k along i): their shear strains as they are, mu/2 gamma^2 V / 3,
- the fourth hourglass mode (xi_1 xi_2 xi_3 along i): e_ii, E/2 e_ii^2 V / 9.

The amplitudes are those in axes that turn with the element, F^T gamma.u: the energy is objective, linear fields give
none, and forces are its derivative, what comes through F included. It costs no further stress point. The moduli are
those at rest times `hourglass` (1 is the tissue's own bending; where that stiffens, more is due).
"""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.elements.element import Element, Forces, Tensor
from tissuejax.elements.hex8 import SIGNS, Hex8
from tissuejax.elements.hex8 import Reference as Plain

PAIRS = ((0, 1), (0, 2), (1, 2))  # axes of the first three hourglass modes: xi eta, xi zeta, eta zeta
MODE = {pair: a for a, pair in enumerate(PAIRS)} | {pair[::-1]: a for a, pair in enumerate(PAIRS)}


class Reference(NamedTuple):
    """`plain`: of `Hex8`; `axes`: rows are the local axes, (k, J, E); `length`: half-edges along them, (k, E), m;
    `volume`, m^3."""

    plain: Plain
    axes: Float[Array, "3 3 E"]
    length: Float[Array, "3 E"]
    volume: Float[Array, " E"]


class Hex8Bending(Element):
    """One-point hexahedron with assumed-strain bending, meshio order.

    Attributes:
        poisson: Poisson's ratio in bending; soft tissue is all but incompressible.
    """

    poisson: float = eqx.field(static=True, default=0.5)

    name: ClassVar[str] = "hexahedron-bending"
    cell_type: ClassVar[str] = "hexahedron"
    corners: ClassVar = SIGNS
    faces: ClassVar[tuple[tuple[int, ...], ...]] = Hex8.faces
    natural_hourglass: ClassVar[float] = 1.0

    def shape(self, xi: Float[Array, "q 3"]) -> Float[Array, "q 8"]:
        return Hex8().shape(xi)

    def reference(self, x: Float[Array, "3 8 E"]) -> Reference:
        plain = Hex8().reference(x)
        edges = jnp.einsum("ai,jae->ije", jnp.asarray(SIGNS) / 8, x)  # dX/dxi_i: rows of half-edges
        u, _, vt = jnp.linalg.svd(jnp.moveaxis(edges, -1, 0))
        axes = jnp.moveaxis(u @ vt, 0, -1)  # the rotation nearest to the edges' directions
        return Reference(plain, axes, jnp.sqrt(jnp.sum(edges * edges, 1)), plain.volume)

    def gradient(self, reference: Reference, u: Float[Array, "3 8 E"]) -> tuple[Tensor, Any]:
        F, q = Hex8().gradient(reference.plain, u)
        return F, (q, F)

    def _slopes(self, reference: Reference, q: Float[Array, "4 3 E"], stiffness: Float[Array, " E"]):
        """dW/dq of local amplitudes q (alpha, k, E), N; W is half of q . dW/dq."""
        nu, V, a = self.poisson, reference.volume / 64, reference.length  # modes are sums over eight nodes
        young = 2 * (1 + nu) * stiffness
        plate = young / (1 - nu * nu) * V / 3
        out: list[list[Any]] = [[0.0] * 3 for _ in range(4)]
        for t in range(3):
            i, j = (k for k in range(3) if k != t)
            ei, ej = q[MODE[i, t], i] / a[i], q[MODE[j, t], j] / a[j]
            out[MODE[i, t]][i] = plate * (ei + nu * ej) / a[i]
            out[MODE[j, t]][j] = plate * (ej + nu * ei) / a[j]
            # shear in the plane i, j that varies along t: mode xi_j xi_t along i, and xi_i xi_t along j
            shear = stiffness * V / 3 * (q[MODE[j, t], i] / a[j] + q[MODE[i, t], j] / a[i])
            out[MODE[j, t]][i] = out[MODE[j, t]][i] + shear / a[j]
            out[MODE[i, t]][j] = out[MODE[i, t]][j] + shear / a[i]
            out[3][t] = young * V / 9 * q[3, t] / (a[t] * a[t])
        return jnp.stack([jnp.stack(row) for row in out])

    def forces(self, reference: Reference, P: Tensor, memory: Any, stiffness: Float[Array, " E"]) -> Forces:
        q, F = memory
        along = jnp.einsum("aie,iJe->aJe", q, F)  # F^T q
        slope = self._slopes(reference, jnp.einsum("aJe,kJe->ake", along, reference.axes), stiffness)
        pulled = jnp.einsum("ake,kJe->aJe", slope, reference.axes)  # dW/d(F^T q)
        by_mode = jnp.einsum("iJe,aJe->aie", F, pulled)  # dW/dq at fixed F
        by_gradient = jnp.einsum("aie,aJe->iJe", q, pulled)  # dW/dF at fixed q
        # `Hex8` takes volume * P and stiffening * stiffness * memory: both are given whole
        one = jnp.ones_like(reference.volume)
        plain = reference.plain._replace(stiffening=one, volume=one)
        return Hex8().forces(plain, reference.volume * P + by_gradient, by_mode, one)

    def hourglass_energy(self, reference: Reference, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        q, F = memory
        local = jnp.einsum("aie,iJe,kJe->ake", q, F, reference.axes)
        return 0.5 * jnp.sum(local * self._slopes(reference, local, stiffness))

    def steepness(self, reference: Reference, hourglass: Array | float) -> Float[Array, " E"]:
        nu, a = self.poisson, reference.length
        short = jnp.sum(1 / (a * a), 0)
        # plane stress with both curvatures: E / (1 - nu) = 2 mu (1 + nu) / (1 - nu); twice the shear of two amplitudes
        hourglass_modes = hourglass * jnp.maximum(2 * (1 + nu) / (1 - nu), 2.0) / 3 * short
        return jnp.maximum(Hex8().steepness(reference.plain, 0.0), hourglass_modes)
