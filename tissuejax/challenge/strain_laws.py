"""Strain energies of challenge specimens: energy and hand-derived stress, written without the project's energies.

Every law gives W (Pa) and S = 2 dW/dC, first for an incompressible specimen; `isochoric` takes the volume out.
Invariants' derivatives: dI1/dC = I, dI2/dC = I1 I - C, dI4/dC = a x a. Source: Holzapfel 2000, eq. 6.30-6.32, 6.212.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

Tensors = Float[np.ndarray, "n 3 3"]
Law = Callable[[Tensors], tuple[Float[np.ndarray, " n"], Tensors]]


def polynomial(terms: dict[str, float]) -> Law:
    """Sum of c_ij (I1 - 3)^i (I2 - 3)^j; keys "10", "01", "20", "11", "30", in Pa (Rivlin and Saunders 1951)."""
    powers = [(int(k[0]), int(k[1]), c) for k, c in terms.items()]

    def law(C: Tensors):
        I1 = np.trace(C, axis1=1, axis2=2)
        I2 = (I1**2 - np.trace(C @ C, axis1=1, axis2=2)) / 2
        x, y = I1 - 3, I2 - 3
        W = sum(c * x**i * y**j for i, j, c in powers)
        W1 = sum(c * i * x ** (i - 1) * y**j for i, j, c in powers if i) + 0 * x
        W2 = sum(c * j * x**i * y ** (j - 1) for i, j, c in powers if j) + 0 * x
        eye = np.eye(3)
        return W, 2 * W1[:, None, None] * eye + 2 * W2[:, None, None] * (I1[:, None, None] * eye - C)

    return law


def exponential(a: float, b: float) -> Law:
    """a / (2 b) (exp(b (I1 - 3)) - 1) (Demiray 1972); a in Pa, b a number."""

    def law(C: Tensors):
        x = np.trace(C, axis1=1, axis2=2) - 3
        e = np.exp(b * x)
        return a / (2 * b) * (e - 1), a * e[:, None, None] * np.eye(3)

    return law


def locking(mu: float, limit: float) -> Law:
    """-mu limit / 2 ln(1 - (I1 - 3) / limit) (Gent 1996); mu in Pa, limit the largest I1 - 3."""

    def law(C: Tensors):
        x = np.trace(C, axis1=1, axis2=2) - 3
        left = np.maximum(1 - x / limit, 1e-3)
        return -mu * limit / 2 * np.log(left), (mu / left)[:, None, None] * np.eye(3)

    return law


def ogden(mu: list[float], alpha: list[float]) -> Law:
    """Sum of 2 mu_i / alpha_i^2 (l1^alpha + l2^alpha + l3^alpha - 3); initial shear modulus sum mu_i (Ogden 1972)."""

    def law(C: Tensors):
        squares, vectors = np.linalg.eigh(C)
        l = np.sqrt(squares)
        W = sum(2 * m / a**2 * (np.sum(l**a, -1) - 3) for m, a in zip(mu, alpha))
        s = sum(2 * m / a * l ** (a - 2) for m, a in zip(mu, alpha))
        return W, np.einsum("nk,nik,njk->nij", s, vectors, vectors)

    return law


def fibres(k: float, shape: float, kind: str, along: Float[np.ndarray, "f 3"]) -> Law:
    """Fibre families that bear no push. `along`: unit directions in the test's axes; k in Pa.

    kind: "exponential" k / (2 shape) (exp(shape e^2) - 1) with e = I4 - 1 (Holzapfel, Gasser and Ogden 2000);
    "quadratic" k / 2 e^2; "stretch" k / 2 (sqrt(I4) - 1)^2 (linear fibre); "late" the exponential beyond e = 0.1.
    """

    def law(C: Tensors):
        W, S = np.zeros(len(C)), np.zeros_like(C)
        for a in along:
            I4 = np.einsum("i,nij,j->n", a, C, a)
            e = np.maximum(I4 - 1 - (0.1 if kind == "late" else 0.0), 0.0)
            if kind == "quadratic":
                w, d = k / 2 * e**2, k * e
            elif kind == "stretch":
                l = np.sqrt(np.maximum(I4, 1.0))
                w, d = k / 2 * (l - 1) ** 2, k * (l - 1) / (2 * l)
            else:
                growth = np.exp(shape * e**2)
                w, d = k / (2 * shape) * (growth - 1), k * e * growth
            W = W + w / len(along)
            S = S + (2 * d / len(along))[:, None, None] * np.outer(a, a)
        return W, S

    return law


def isochoric(law: Law) -> Law:
    """`law` of J^(-2/3) C as a function of C: S = J^(-2/3) (S - (S : C) C^-1 / 3)."""

    def without_volume(C: Tensors):
        thin = np.linalg.det(C) ** (-1 / 3)
        W, S = law(thin[:, None, None] * C)
        S = S * thin[:, None, None]
        return W, S - np.einsum("nij,nij->n", S, C)[:, None, None] * np.linalg.inv(C) / 3

    return without_volume


@dataclass(frozen=True)
class Body:
    """The specimen's energy as data, so that it can be written into a key.

    Attributes:
        terms: polynomial coefficients, Pa, by "ij".
        extra: further laws as (kind, parameters): "exponential", "locking", "ogden", "fibres".
        bulk: K of K/2 (J - 1)^2, Pa; None is incompressible.
    """

    terms: dict[str, float]
    extra: tuple[tuple[str, dict], ...] = field(default_factory=tuple)
    bulk: float | None = None

    @property
    def fibrous(self) -> bool:
        """Whether the lateral faces of a uniaxial specimen can differ."""
        return any(kind == "fibres" for kind, _ in self.extra)

    def law(self, frame: Float[np.ndarray, "3 3"]) -> Law:
        """Energy and stress in the axes of a test whose axes are the rows of `frame` in the sample's own."""
        parts = [polynomial(self.terms)] if self.terms else []
        for kind, p in self.extra:
            if kind == "fibres":
                along = np.array([frame @ np.asarray(a) for a in p["along"]])
                parts.append(fibres(p["k"], p["shape"], p["kind"], along))
            else:
                parts.append({"exponential": exponential, "locking": locking, "ogden": ogden}[kind](**p))

        def total(C: Tensors):
            found = [part(C) for part in parts]
            return sum(w for w, _ in found), sum(s for _, s in found)

        return isochoric(total)
