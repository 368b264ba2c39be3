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

from tissuejax.elements.element import Element, Tensor9, determinant, inverse, largest_eigenvalue

SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)


class Reference(NamedTuple):
    """`gradient`: (dxi_k/dX_J)/8, 9 arrays; `hourglass`: h_alpha . X_J, 12 arrays; `stiffening`: 1/64 of the
    hourglass stiffness per modulus, 8 V sum_a |B_a|^2, m; `volume`, m^3."""

    gradient: tuple[Float[Array, " E"], ...]
    hourglass: tuple[Float[Array, " E"], ...]
    stiffening: Float[Array, " E"]
    volume: Float[Array, " E"]


def modes(n: Float[Array, "8 E"]) -> tuple[Float[Array, " E"], ...]:
    """Gradient modes (xi, eta, zeta) and hourglass modes (xi eta, xi zeta, eta zeta, xi eta zeta) of nodal values."""

    def quad(a, b, c, d):
        low, high, left, right = b + a, c + d, b - a, c - d
        return high + low, left + right, high - low, right - left  # 1, xi, eta, xi eta

    s = quad(*(n[a + 4] + n[a] for a in range(4)))
    d = quad(*(n[a + 4] - n[a] for a in range(4)))
    return s[1], s[2], d[0], s[3], d[1], d[2], d[3]


def nodal(xi, eta, zeta, xieta, xizeta, etazeta, all_three) -> tuple[Float[Array, " E"], ...]:
    """Nodal values of the seven modes: the transpose of `modes`."""

    def quad(one, x, e, xe):
        low, high, left, right = one - e, one + e, x - xe, x + xe
        return low - left, low + left, high + right, high - right

    # a node's value is s -+ d with s the even part and d the odd part in zeta
    s = quad(0.0, xi, eta, xieta)
    d = quad(zeta, xizeta, etazeta, all_three)
    return tuple(s[a] - d[a] for a in range(4)) + tuple(s[a] + d[a] for a in range(4))


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
        m = [modes(x[i]) for i in range(3)]
        jacobian = tuple(m[i][k] / 8 for i in range(3) for k in range(3))  # dX_i/dxi_k
        volume = 8 * determinant(jacobian)
        gradient = tuple(g / 8 for g in inverse(jacobian))  # by rows: k, then J
        hourglass = tuple(m[i][3 + a] for a in range(4) for i in range(3))
        squares = sum(8 * g * g for g in gradient)  # sum_a |grad N_a|^2, 1.5/h^2 in a cube
        return Reference(gradient, hourglass, 8 * volume * squares / 64, volume)

    def gradient(self, reference: Reference, u: Float[Array, "3 8 E"]) -> tuple[Tensor9, Any]:
        A, X = reference.gradient, reference.hourglass
        F, q = [], []
        for i in range(3):
            m = modes(u[i])
            H = [m[0] * A[J] + m[1] * A[3 + J] + m[2] * A[6 + J] for J in range(3)]
            q += [m[3 + a] - (X[3 * a] * H[0] + X[3 * a + 1] * H[1] + X[3 * a + 2] * H[2]) for a in range(4)]
            F += [h + 1.0 if i == J else h for J, h in enumerate(H)]
        return tuple(F), tuple(q)

    def forces(self, reference: Reference, P: Tensor9, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        A, X, V = reference.gradient, reference.hourglass, reference.volume
        kappa = reference.stiffening * stiffness
        rows = []
        for i in range(3):
            h = [kappa * memory[4 * i + a] for a in range(4)]
            T = [V * P[3 * i + J] - sum(X[3 * a + J] * h[a] for a in range(4)) for J in range(3)]
            g = [sum(T[J] * A[3 * k + J] for J in range(3)) for k in range(3)]
            rows.append(jnp.stack(nodal(*g, *h)))
        return jnp.stack(rows)

    def steepness(self, reference: Reference, hourglass: float) -> Float[Array, " E"]:
        A = reference.gradient

        def product(I, J):
            return 64 * sum(A[3 * k + I] * A[3 * k + J] for k in range(3))  # nodes * sum_a B_aI B_aJ

        waves = largest_eigenvalue(*(product(*ij) for ij in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))))
        return jnp.maximum(waves, hourglass * 64 * sum(g * g for g in A))
