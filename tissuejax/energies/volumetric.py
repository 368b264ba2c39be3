"""Volumetric energies U(J), named by their form; all are zero with zero slope at J = 1.

The forms met in the field: K/2 (J-1)^2, K/2 ln(J)^2 and ABAQUS's sum_i (J-1)^(2i) / D_i.
"""

import abc
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.parameters import Constants, Parameter
from tissuejax.tensors import total


class Volumetric(eqx.Module):
    """A volumetric energy per reference volume."""

    name: ClassVar[str]
    formula: ClassVar[str]

    @property
    @abc.abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared parameters."""

    @abc.abstractmethod
    def energy(self, p: Constants, J: Float[Either, "..."]) -> Float[Either, "..."]:
        """U(J), Pa."""

    @abc.abstractmethod
    def bulk_modulus(self, p: Constants) -> Float[Either, ""]:
        """Initial bulk modulus U''(1), Pa."""


class Quadratic(Volumetric):
    """U = K/2 (J-1)^2."""

    name: ClassVar[str] = "quadratic"
    formula: ClassVar[str] = "K/2 (J-1)^2"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("K", "Pa", 20e3, lower=0.0, meaning="bulk modulus"),)

    def energy(self, p: Constants, J: Float[Either, "..."]) -> Float[Either, "..."]:
        return 0.5 * p["K"] * (J - 1) ** 2

    def bulk_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["K"]


class Logarithmic(Volumetric):
    """U = K/2 ln(J)^2."""

    name: ClassVar[str] = "logarithmic"
    formula: ClassVar[str] = "K/2 ln(J)^2"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("K", "Pa", 20e3, lower=0.0, meaning="bulk modulus"),)

    def energy(self, p: Constants, J: Float[Either, "..."]) -> Float[Either, "..."]:
        return 0.5 * p["K"] * jnp.log(J) ** 2

    def bulk_modulus(self, p: Constants) -> Float[Either, ""]:
        return p["K"]


class Compressibility(Volumetric):
    """U = sum_i (J-1)^(2i) / D_i, ABAQUS's form; bulk modulus 2 / D_1."""

    name: ClassVar[str] = "compressibility"
    formula: ClassVar[str] = "sum_i (J-1)^(2i) / D_i"
    order: int = 1

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return tuple(
            Parameter(f"D{i}", "1/Pa", 1e-4, lower=0.0, meaning=f"compressibility of (J-1)^{2 * i}")
            for i in range(1, self.order + 1)
        )

    def energy(self, p: Constants, J: Float[Either, "..."]) -> Float[Either, "..."]:
        return total((J - 1) ** (2 * i) / p[f"D{i}"] for i in range(1, self.order + 1))

    def bulk_modulus(self, p: Constants) -> Float[Either, ""]:
        return 2 / p["D1"]
