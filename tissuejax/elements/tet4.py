"""Four-node tetrahedron with nodally averaged pressure.

A linear tetrahedron locks when the material is nearly incompressible; taking the volumetric energy at the nodes, from
volume ratios averaged over the elements around them, frees it (Bonet & Burton 1998, Commun. Numer. Meth. Engng 14; for
total Lagrangian dynamics Joldes, Wittek & Miller 2009). The averaging is in `tled/internal.py`, as it couples elements.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.elements.element import Element, Tensor9, determinant, inverse, largest_eigenvalue


class Reference(NamedTuple):
    """`gradient`: grad N of nodes 1 to 3 (node 0 has minus their sum), 9 arrays; `volume`, m^3."""

    gradient: tuple[Float[Array, " E"], ...]
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
        jacobian = tuple(x[i, k + 1] - x[i, 0] for i in range(3) for k in range(3))  # dX_i/dxi_k
        return Reference(inverse(jacobian), determinant(jacobian) / 6)

    def gradient(self, reference: Reference, u: Float[Array, "3 4 E"]) -> tuple[Tensor9, Any]:
        B = reference.gradient
        d = [[u[i, a + 1] - u[i, 0] for a in range(3)] for i in range(3)]
        F = [sum(d[i][a] * B[3 * a + J] for a in range(3)) + float(i == J) for i in range(3) for J in range(3)]
        return tuple(F), ()

    def forces(self, reference: Reference, P: Tensor9, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        B, V = reference.gradient, reference.volume
        f = [[V * sum(P[3 * i + J] * B[3 * a + J] for J in range(3)) for a in range(3)] for i in range(3)]
        return jnp.stack([jnp.stack([-(r[0] + r[1] + r[2]), *r]) for r in f])

    def steepness(self, reference: Reference, hourglass: float) -> Float[Array, " E"]:
        B = reference.gradient
        nodes = [[-sum(B[3 * a + J] for a in range(3)) for J in range(3)]]
        nodes += [[B[3 * a + J] for J in range(3)] for a in range(3)]

        def product(i, j):
            return 4 * sum(b[i] * b[j] for b in nodes)

        return largest_eigenvalue(*(product(*ij) for ij in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))
