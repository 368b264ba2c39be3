"""A refit that is not one: numbers without a simulation."""

from dataclasses import dataclass


@dataclass
class Fit:
    keys: tuple[str, ...]
    x: float
    held: float
    chi2: float = 1.0
    n: int = 1
    n_held: int = 1
    converged: bool = False
