"""The gravity cube at rest by a solver that shares nothing with the project's: static, mixed hexes, Newton with scipy.

Eight Gauss points for the isochoric part, the mean dilatation for the volumetric one (Simo, Taylor, Pister 1985, with
piecewise constant pressure); the element's energy is written out once and differentiated twice. With the pressure taken
at every point instead, it gives what felupe 11.3.0 gives with fully integrated hexes and the same energy, to nine
digits (with D1 alone: 11.945324 mm at the centre of the top of 10 x 10 x 10 elements).
"""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
SIGNS = 2.0 * CORNERS - 1
GAUSS = SIGNS / np.sqrt(3)


def slopes(x, h: float):
    """Derivatives of the eight shape functions at a point of the cell [-1, 1]^3, (8, 3), 1/m."""
    a, b, c = (1 + SIGNS * x).T
    s, t, u = SIGNS.T
    return np.stack([s * b * c, t * a * c, u * a * b], 1) / 8 * (2 / h)


def sunk(n: int, side: float, coefficients, d, density: float, gravity: float = 9.81) -> np.ndarray:
    """Downward displacement of the top's nodes, m, (n + 1, n + 1), base fixed.

    Reduced polynomial of `coefficients` (C10, C20, ...) and sum_i (J - 1)^(2i) / D_i with `d` = (D1, D2, ...), 1/Pa.
    """
    h, nodes = side / n, np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    cells = np.stack([nodes[a : a + n, b : b + n, c : c + n].ravel() for a, b, c in CORNERS], 1)
    dN = jnp.array([slopes(x, h) for x in GAUSS])

    def energy(u):
        F = jnp.eye(3) + jnp.einsum("ai,gaj->gij", u.reshape(8, 3), dN)
        J = jax.vmap(jnp.linalg.det)(F)
        x = J ** (-2 / 3) * (F**2).sum((1, 2)) - 3
        isochoric = sum(c * x ** (i + 1) for i, c in enumerate(coefficients)).mean()
        return h**3 * (isochoric + sum((J.mean() - 1) ** (2 * i) / di for i, di in enumerate(d, 1)))

    whole = jax.jit(lambda u: jax.vmap(energy)(u).sum())
    forces, tangents = jax.jit(jax.vmap(jax.grad(energy))), jax.jit(jax.vmap(jax.hessian(energy)))
    dof = (3 * cells[:, :, None] + np.arange(3)).reshape(-1, 24)
    places = np.repeat(dof, 24, 1).ravel(), np.tile(dof, (1, 24)).ravel()
    weight = np.zeros((nodes.size, 3))
    np.add.at(weight, (cells.ravel(), 2), -density * gravity * h**3 / 8)
    weight, u = weight.ravel(), np.zeros(3 * nodes.size)
    free = np.setdiff1d(np.arange(u.size), (3 * nodes[:, :, 0].ravel()[:, None] + np.arange(3)).ravel())
    for share in (0.25, 0.5, 0.75, 1.0):
        for _ in range(30):
            r = -share * weight
            np.add.at(r, dof.ravel(), np.asarray(forces(u[dof])).ravel())
            if np.abs(r[free]).max() < 1e-8 * np.abs(weight).max():
                break
            K = sp.csr_matrix((np.asarray(tangents(u[dof])).ravel(), places), (u.size, u.size))[free][:, free]
            step = np.zeros_like(u)
            step[free], _ = cg(K, -r[free], rtol=1e-5, M=sp.diags(1 / K.diagonal()), maxiter=3000)
            total = lambda v, share=share: float(whole(v[dof])) - share * weight @ v  # noqa: E731
            size, now = 1.0, total(u)
            while size > 1e-3 and not total(u + size * step) <= now + 1e-12 * abs(now):
                size /= 2
            u = u + size * step
        else:
            raise RuntimeError(f"no equilibrium at {share:.0%} of the weight")
    return -u[3 * nodes[:, :, -1] + 2]
