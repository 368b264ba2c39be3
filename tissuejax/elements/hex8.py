"""Eight-node hexahedron with one stress point and hourglass control, in modal (Hadamard) form.

The eight nodal values are turned by sums and differences into a mean, three gradient modes and four hourglass modes.
F needs the three gradient modes only, the hourglass force the four others, so an element stores 23 numbers instead
of 57. Hourglass control is the total Lagrangian perturbation form of Joldes, Wittek & Miller 2008 (Commun. Numer.
Meth. Engng 24): mode amplitudes gamma . u with gamma orthogonal to every linear field, so that rigid motion and
uniform strain feel nothing. Modes and gamma: Flanagan & Belytschko 1981.
"""

from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.elements.element import Element, Tensor, barrier, determinant, inverse, largest_eigenvalue

SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
XI, ETA, ZETA = SIGNS.T
MODES = np.stack([XI, ETA, ZETA, XI * ETA, XI * ZETA, ETA * ZETA, XI * ETA * ZETA])


class Reference(NamedTuple):
    """`gradient`: (dxi_k/dX_J)/8, (k, J, E); `hourglass`: h_alpha . X_J, (alpha, J, E); `stiffening`: 1/64 of the
    hourglass stiffness per modulus, 8 V sum_a |B_a|^2, m; `volume`, m^3."""

    gradient: Float[Array, "3 3 E"]
    hourglass: Float[Array, "4 3 E"]
    stiffening: Float[Array, " E"]
    volume: Float[Array, " E"]


def modes(n: Float[Array, "3 8 E"]) -> Float[Array, "7 3 E"]:
    """Three gradient modes (xi, eta, zeta) and four hourglass modes of nodal vectors."""
    signs = jnp.asarray(MODES, n.dtype)[:, :, None, None]
    return sum(signs[:, a] * n[None, :, a] for a in range(8))


def nodal(g: Float[Array, "3 3 E"], h: Float[Array, "4 3 E"]) -> Float[Array, "3 8 E"]:
    """Nodal vectors of gradient and hourglass modes: the transpose of `modes`."""
    signs = jnp.asarray(MODES, g.dtype)[:, None, :, None]
    return sum(signs[k] * g[k][:, None] for k in range(3)) + sum(signs[3 + a] * h[a][:, None] for a in range(4))


class Hex8(Element):
    """One-point hexahedron, meshio order. F = 1 + du/dX at the centre; V = 8 det(dX/dxi) there."""

    name: ClassVar[str] = "hexahedron"
    corners: ClassVar[np.ndarray] = SIGNS
    faces: ClassVar[tuple[tuple[int, ...], ...]] = (
        (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7),
    )  # fmt: skip

    def shape(self, xi: Float[Array, "q 3"]) -> Float[Array, "q 8"]:
        return jnp.prod(1 + xi[:, None, :] * SIGNS, axis=-1) / 8

    def reference(self, x: Float[Array, "3 8 E"]) -> Reference:
        m = modes(x)
        jacobian = jnp.swapaxes(m[:3], 0, 1) / 8  # dX_i/dxi_k
        volume = 8 * determinant(jacobian)
        gradient = inverse(jacobian) / 8
        squares = 8 * jnp.sum(gradient * gradient, (0, 1))  # sum_a |grad N_a|^2, 1.5/h^2 in a cube
        return Reference(gradient, m[3:], 8 * volume * squares / 64, volume)

    def gradient(self, reference: Reference, u: Float[Array, "3 8 E"]) -> tuple[Tensor, Any]:
        A, X = reference.gradient, reference.hourglass
        m = barrier(modes(u))
        H = barrier(sum(m[k][:, None] * A[k][None] for k in range(3)))  # du_i/dX_J
        q = m[3:] - sum(X[:, J][:, None] * H[:, J][None] for J in range(3))
        return H + jnp.eye(3, dtype=H.dtype)[:, :, None], q

    def forces(self, reference: Reference, P: Tensor, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        A, X, V = reference.gradient, reference.hourglass, reference.volume
        h = barrier(reference.stiffening * stiffness * memory)
        T = barrier(V * P - sum(h[a][:, None] * X[a][None] for a in range(4)))
        g = barrier(sum(A[:, J][:, None] * T[:, J][None] for J in range(3)))
        return nodal(g, h)

    def hourglass_energy(self, reference: Reference, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        return 0.5 * jnp.sum(reference.stiffening * stiffness * memory * memory)

    def steepness(self, reference: Reference, hourglass: float) -> Float[Array, " E"]:
        A = reference.gradient
        G = 64 * jnp.einsum("kie,kje->ije", A, A)  # nodes * sum_a B_a B_a^T
        return jnp.maximum(largest_eigenvalue(G), hourglass * 64 * jnp.sum(A * A, (0, 1)))
