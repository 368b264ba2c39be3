"""Eight-node hexahedron with one stress point and hourglass control, in modal (Hadamard) form.

The eight nodal values are turned by sums and differences into a mean, three gradient modes and four hourglass modes.
An element stores 32 numbers instead of 57. The gradient is the mean one, B_a = (1/V) integral dN_a/dX dV (Flanagan &
Belytschko 1981), not the one at the centre: only the mean passes the patch test in hexes that are no parallelepipeds
(V B_a = dV/dX_a, and volumes of neighbours add up). It takes 9 numbers more, which a mesh that is all parallelepipeds
does without (`straight`). Hourglass control is the total Lagrangian perturbation form of Joldes, Wittek & Miller 2008
(Commun. Numer. Meth. Engng 24): mode amplitudes gamma . u with gamma orthogonal to every linear field, so that rigid
motion and uniform strain feel nothing.
"""

from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax.arrays import barrier
from tissuejax.elements.element import Element, Forces, Tensor, largest_eigenvalue, parts

SIGNS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], float
)
XI, ETA, ZETA = SIGNS.T
MODES = np.stack([XI, ETA, ZETA, XI * ETA, XI * ZETA, ETA * ZETA, XI * ETA * ZETA])


class Reference(NamedTuple):
    """`gradient`, `bending`: (dV/dm_k)/V of the gradient modes m_k of the node positions (which is (dxi_k/dX_J)/8 in a
    parallelepiped) and of the first three hourglass modes (0 there, then None; the fourth has none), (k, J, E), 1/m;
    `hourglass`:
    h_alpha . X_J, (alpha, J, E), m; `stiffening`: 1/64 of the hourglass stiffness per modulus, 8 V sum_a |B_a|^2, m;
    `volume`, m^3."""

    gradient: Float[Array, "3 3 E"]
    bending: Float[Array, "3 3 E"] | None
    hourglass: Float[Array, "4 3 E"]
    stiffening: Float[Array, " E"]
    volume: Float[Array, " E"]


def modes(n: Float[Array, "3 8 E"]) -> Float[Array, "7 3 E"]:
    """Three gradient modes (xi, eta, zeta) and four hourglass modes of nodal vectors: MODES times n, in butterflies."""
    a, b, c, d, e, f, g, h = parts(n, 1)
    s0, s1, s2, s3 = b + a, c + d, f + e, g + h  # sums along xi, in the order (eta, zeta) = --, +-, -+, ++
    d0, d1, d2, d3 = b - a, c - d, f - e, g - h
    low, high, lower, higher = s1 - s0, s3 - s2, d1 - d0, d3 - d2
    return jnp.stack(
        [
            (d0 + d1) + (d2 + d3), low + high, (s2 + s3) - (s0 + s1),
            lower + higher, (d2 + d3) - (d0 + d1), high - low, higher - lower,
        ]
    )  # fmt: skip


def nodal(g: list[Float[Array, "3 E"]], h: list[Float[Array, "3 E"]]) -> tuple[Float[Array, "8 E"], ...]:
    """Nodal vectors of three gradient and four hourglass modes, one array a component: the transpose of `modes`."""
    return tuple(_nodal(*(rows[i] for rows in (*g, *h))) for i in range(3))


def _nodal(x, y, z, p, q, r, w):
    a, b, c, d = x - q, p - w, x + q, p + w
    odd = (a - b, a + b, c - d, c + d)  # what changes sign along xi, in the order (eta, zeta) = --, +-, -+, ++
    even = (r - y - z, y - r - z, z - y - r, y + r + z)
    pairs = [(e - o, e + o) for e, o in zip(even, odd, strict=True)]
    return jnp.stack((*pairs[0], *pairs[1][::-1], *pairs[2], *pairs[3][::-1]))


def _cross(a: Float[Array, "3 E"], b: Float[Array, "3 E"]) -> Float[Array, "3 E"]:
    return jnp.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def volume(m: Float[Array, "7 3 E"]) -> tuple[Float[Array, " E"], Float[Array, "6 3 E"]]:
    """Exact volume of a trilinear hex from the modes of its node positions, m^3, and its derivative to the first six.

    V = (det(a, b, c) + (det(a, p, q) + det(p, b, r) + det(q, r, c)) / 3) / 64 with gradient modes a, b, c and hourglass
    modes p, q, r (xi eta, xi zeta, eta zeta): the integral of det(dX/dxi), all other products being odd.
    """
    a, b, c, p, q, r = (m[k] for k in range(6))
    slope = jnp.stack(
        [
            _cross(b, c) + _cross(p, q) / 3,
            _cross(c, a) + _cross(r, p) / 3,
            _cross(a, b) + _cross(q, r) / 3,
            (_cross(q, a) + _cross(b, r)) / 3,
            (_cross(a, p) + _cross(r, c)) / 3,
            (_cross(p, b) + _cross(c, q)) / 3,
        ]
    )
    return jnp.sum(m[:6] * slope, (0, 1)) / 192, slope / 64  # V is of degree three: 3 V = m . dV/dm


class Hex8(Element):
    """One-point hexahedron, meshio order. F = 1 + mean du/dX; V exact.

    Attributes:
        straight: take every cell for a parallelepiped (exact where it is one, and a sixth cheaper).
    """

    straight: bool = eqx.field(static=True, default=False)

    name: ClassVar[str] = "hexahedron"
    corners: ClassVar[np.ndarray] = SIGNS
    faces: ClassVar[tuple[tuple[int, ...], ...]] = (
        (0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7),
    )  # fmt: skip

    @property
    def general(self) -> "Hex8":
        return Hex8()

    def shape(self, xi: Float[Array, "q 3"]) -> Float[Array, "q 8"]:
        return jnp.prod(1 + xi[:, None, :] * SIGNS, axis=-1) / 8

    def reference(self, x: Float[Array, "3 8 E"]) -> Reference:
        m = modes(x)
        V, slope = volume(m)
        B = slope / V
        squares = 8 * jnp.sum(B * B, (0, 1))  # sum_a |grad N_a|^2, 1.5/h^2 in a cube
        return Reference(B[:3], None if self.straight else B[3:], m[3:], 8 * V * squares / 64, V)

    def gradient(self, reference: Reference, u: Float[Array, "3 8 E"]) -> tuple[Tensor, Any]:
        A, W, X = reference.gradient, reference.bending, reference.hourglass
        m = parts(barrier(modes(u)))
        H = sum(m[k][:, None] * A[k][None] for k in range(3))  # du_i/dX_J
        if W is not None:
            H = H + sum(m[3 + k][:, None] * W[k][None] for k in range(3))
        H = barrier(H)
        columns = parts(H, 1)
        q = jnp.stack([m[3 + a] - sum(X[a, J] * columns[J] for J in range(3)) for a in range(4)])
        return H + jnp.eye(3, dtype=H.dtype)[:, :, None], q

    def forces(self, reference: Reference, P: Tensor, memory: Any, stiffness: Float[Array, " E"]) -> Forces:
        A, W, X, V = reference.gradient, reference.bending, reference.hourglass, reference.volume
        h = parts(barrier(reference.stiffening * stiffness * memory))
        T = parts(barrier(V * P - sum(h[a][:, None] * X[a][None] for a in range(4))), 1)
        g = parts(barrier(jnp.stack([sum(A[k, J] * T[J] for J in range(3)) for k in range(3)])))
        if W is not None:
            bent = barrier(jnp.stack([h[k] + sum(W[k, J] * T[J] for J in range(3)) for k in range(3)]))
            h = [*parts(bent), h[3]]
        return nodal(g, h)

    def hourglass_energy(self, reference: Reference, memory: Any, stiffness: Float[Array, " E"]) -> Array:
        return 0.5 * jnp.sum(reference.stiffening * stiffness * memory * memory)

    def steepness(self, reference: Reference, hourglass: Array | float) -> Float[Array, " E"]:
        B = [reference.gradient] if reference.bending is None else [reference.gradient, reference.bending]
        B = jnp.concatenate(B)
        G = 64 * jnp.einsum("kie,kje->ije", B, B)  # nodes * sum_a B_a B_a^T
        return jnp.maximum(largest_eigenvalue(G), hourglass * 64 * jnp.sum(B * B, (0, 1)))


def straight(points: Float[np.ndarray, "N 3"], cells: Int[np.ndarray, "E 8"]) -> bool:
    """Whether every cell is a parallelepiped, to a millionth of its size."""
    m = np.einsum("ka,eai->eki", MODES, np.asarray(points)[np.asarray(cells)])
    return bool(np.abs(m[:, 3:]).max() < 1e-6 * np.abs(m[:, :3]).max((1, 2)).min())
