"""Four-node tetrahedron with nodally averaged pressure.

A linear tetrahedron locks when the material is nearly incompressible; taking the volumetric energy at the nodes, from
volume ratios averaged over the elements around them, frees it (Bonet & Burton 1998, Commun. Numer. Meth. Engng 14; for
total Lagrangian dynamics Joldes, Wittek & Miller 2009). The averaging is in `tled/internal.py`, as it couples elements.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.elements.element import Element, Forces, Tensor, determinant, inverse, largest_eigenvalue
from tissuejax.tensors import total


class Reference(NamedTuple):
    """`gradient`: grad N of nodes 1 to 3 (node 0 has minus their sum), (node, J, E); `volume`, m^3."""

    gradient: Float[Array, "3 3 E"]
    volume: Float[Array, " E"]


class Tet4(Element):
    """Linear tetrahedron, meshio order. F = 1 + sum_a (u_a - u_0) grad N_a^T, V = det(dX/dxi) / 6."""

    name: ClassVar[str] = "tetra"
    corners: ClassVar[np.ndarray] = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    faces: ClassVar[tuple[tuple[int, ...], ...]] = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    averaged_pressure: ClassVar[bool] = True

    def shape(self, xi: Float[Array, "q 3"]) -> Float[Array, "q 4"]:
        return jnp.concatenate([1 - jnp.sum(xi, 1, keepdims=True), xi], axis=1)

    def reference(self, x: Float[Array, "3 4 E"]) -> Reference:
        jacobian = x[:, 1:] - x[:, :1]  # dX_i/dxi_k
        return Reference(inverse(jacobian), determinant(jacobian) / 6)

    def gradient(self, reference: Reference, u: Float[Array, "3 4 E"]) -> tuple[Tensor, Any]:
        d, B = u[:, 1:] - u[:, :1], reference.gradient
        H = total(d[:, a][:, None] * B[a][None] for a in range(3))
        return H + jnp.eye(3, dtype=H.dtype)[:, :, None], ()

    def forces(self, reference: Reference, P: Tensor, memory: Any, stiffness: Float[Array, " E"]) -> Forces:
        B = reference.gradient
        f = reference.volume * sum(P[:, J][:, None] * B[:, J][None] for J in range(3))  # (i, node, E)
        return tuple(jnp.concatenate([-jnp.sum(row, 0, keepdims=True), row]) for row in f)

    def steepness(self, reference: Reference, hourglass: Array | float) -> Float[Array, " E"]:
        B = jnp.concatenate([-jnp.sum(reference.gradient, 0, keepdims=True), reference.gradient])
        return largest_eigenvalue(4 * jnp.einsum("aie,aje->ije", B, B))
