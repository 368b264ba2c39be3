"""What every element is: where its nodes lie, its shape functions, its faces, and how it turns displacement into force.

An element keeps what depends on the reference shape alone (`reference`) and offers the two linear maps that the
total Lagrangian step needs: `gradient` from nodal displacements to F, and `forces` back from first
Piola-Kirchhoff stress to nodal forces (its transpose, times the volume). Components come first and the element
axis last, so that XLA vectorises over elements. Total Lagrangian dynamics: Lister 2012, 4.3.1; Miller et al. 2007.
"""

import abc
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Tensor = Float[Array, "3 3 E"]
Forces = tuple[Float[Array, "k E"], ...]


class Element(eqx.Module):
    """A solid element with one stress point.

    Class data:
        name: of the element; where `cell_type` says nothing, as meshio calls its cells.
        cell_type: as meshio calls the cells of an element that shares them with another.
        corners: reference coordinates of the nodes.
        faces: local nodes of each face, normal outward.
        averaged_pressure: True where the volumetric energy is taken at the nodes.
        natural_hourglass: hourglass stiffness over shear modulus that is taken where none is given.
    """

    name: ClassVar[str]
    cell_type: ClassVar[str | None] = None
    corners: ClassVar[np.ndarray]
    faces: ClassVar[tuple[tuple[int, ...], ...]]
    averaged_pressure: ClassVar[bool] = False
    natural_hourglass: ClassVar[float] = 0.3

    @property
    def cells(self) -> str:
        """What meshio calls the cells."""
        return self.cell_type or self.name

    @property
    def nodes(self) -> int:
        """Nodes of one element."""
        return len(self.corners)

    @property
    def general(self) -> "Element":
        """The same element without a short cut that holds for some shapes only."""
        return self

    def least_corner(self, X: Float[Array, "3 k E"], x: Float[Array, "3 k E"]) -> Float[Array, " E"]:
        """Least volume ratio of an element at its corners, where three edges meet: 1 undeformed, negative where the
        element is folded, which the stress point in its middle may not feel.

        Args:
            X, x: node positions in the reference and now, m.
        """
        ratios = []
        for a, here in enumerate(self.corners):
            steps = np.sum(np.abs(self.corners - here) > 0, 1)
            near = np.flatnonzero(steps == 1) if len(self.corners) > 4 else np.flatnonzero(steps)
            then, now = (determinant(jnp.stack([y[:, b] - y[:, a] for b in near])) for y in (X, x))
            ratios.append(now / then)
        return jnp.min(jnp.stack(ratios), 0)

    @abc.abstractmethod
    def shape(self, xi: Float[Array, "q 3"]) -> Float[Array, "q k"]:
        """Shape functions at reference points: 1 at their own node, 0 at the others, sum 1."""

    @abc.abstractmethod
    def reference(self, x: Float[Array, "3 k E"]) -> Any:
        """What depends on the reference node positions alone; the volume is its attribute `volume` (E,), m^3."""

    @abc.abstractmethod
    def gradient(self, reference: Any, u: Float[Array, "3 k E"]) -> tuple[Tensor, Any]:
        """Deformation gradient F at the stress point, and what the element remembers for its hourglass force."""

    @abc.abstractmethod
    def forces(self, reference: Any, P: Tensor, memory: Any, stiffness: Float[Array, " E"]) -> Forces:
        """Nodal forces of the first Piola-Kirchhoff stress P (Pa) and of hourglass stiffness (Pa).

        One array a component: in one they would be copied on the way to the nodes, a fifth of a gradient's time.
        """

    def hourglass_energy(self, reference: Any, memory: Any, stiffness: Float[Array, " E"]) -> Float[Array, ""] | float:
        """Energy of the hourglass control, J."""
        return 0.0

    @abc.abstractmethod
    def steepness(self, reference: Any, hourglass: Array | float) -> Float[Array, " E"]:
        """Largest eigenvalue of sum_a B_a B_a^T times the number of nodes, 1/m^2, or that of the hourglass modes.

        With wave speed c the highest frequency of a mesh of such elements is about c sqrt(steepness): 2 c/L for cubes
        of side L. `hourglass`: stiffness of the hourglass control over that of the waves (rho c^2).
        """


def parts(x: Float[Array, "..."], axis: int = 0) -> list[Float[Array, "..."]]:
    """The slices of an array along an axis. Their transpose is one concatenation, where that of indexing pads each
    slice to the whole array and adds them up: it makes a reverse pass cheaper."""
    return [jnp.squeeze(part, axis) for part in jax.lax.split(x, (1,) * x.shape[axis], axis)]


def determinant(F: Tensor) -> Float[Array, " E"]:
    """J = det F."""
    (a, b, c), (d, e, f), (g, h, i) = F
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def cofactor(F: Tensor) -> Tensor:
    """cof F = J F^-T, the derivative of det F."""
    (a, b, c), (d, e, f), (g, h, i) = F
    rows = (
        (e * i - f * h, f * g - d * i, d * h - e * g),
        (c * h - b * i, a * i - c * g, b * g - a * h),
        (b * f - c * e, c * d - a * f, a * e - b * d),
    )
    return jnp.stack([jnp.stack(r) for r in rows])


def inverse(F: Tensor) -> Tensor:
    """F^-1 = cof(F)^T / det F."""
    return jnp.swapaxes(cofactor(F), 0, 1) / determinant(F)


def largest_eigenvalue(G: Tensor) -> Float[Array, " E"]:
    """Largest eigenvalue of symmetric 3x3 matrices."""
    return jnp.linalg.eigvalsh(jnp.moveaxis(G, -1, 0))[..., -1]
