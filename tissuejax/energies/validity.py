"""Where an energy ends, asked at the door: concrete strains outside its valid range are refused with a sentence.

Inside a traced function nothing can be raised; there the energies continue smoothly (`barrier.py`).
"""

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.paths import along
from tissuejax.energies.strain import Strain
from tissuejax.errors import InputError
from tissuejax.parameters import Constants


def check_valid(energy: Energy, p: Constants, strain: Strain, where: str = "the strain asked for") -> None:
    """Nothing, if every strain lies in the valid range of `energy` with parameters `p`; traced inputs pass.

    Args:
        where: what the strains are, for the message: "recording pull-1".

    Raises:
        InputError: a strain outside, with how many and what the range is.
    """
    if any(isinstance(x, Tracer) for x in jax.tree.leaves((dict(p), strain))):
        return
    margin = np.asarray(energy.margin(p, strain))
    bad = ~(margin > 0)  # NaN is bad too
    if bad.any():
        matrix = getattr(energy, "matrix", energy)
        constants = ", ".join(f"{name} = {float(p[name]):.6g}" for name in (d.name for d in matrix.parameters))
        raise InputError(
            f"{where}: {int(bad.sum())} of {bad.size} points lie outside the range of {matrix.name} ({matrix.valid}) "
            f"with {constants}; use smaller strains, change the constants, or choose an energy without an end"
        )


def check_stretches(stretch: Float[Either, "..."] | np.ndarray, where: str = "stretch") -> None:
    """Nothing, if every stretch is finite and above 0.

    Raises:
        InputError: one that isn't, with the first of them.
    """
    values = np.ravel(np.asarray(stretch, dtype=float))
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if bad.size:
        raise InputError(
            f"{where}: {bad.size} of {values.size} are not finite numbers above 0 (first: number {bad[0]}, "
            f"{values[bad[0]]}); a stretch is length / original length, 1 at rest (engineering strain is stretch - 1)"
        )


def valid_stretches(
    energy: Energy, p: Constants, path: str = "uniaxial", within: tuple[float, float] = (0.1, 10.0)
) -> tuple[float, float]:
    """The valid range of stretch around 1 along `path`, not looked for beyond `within`; (nan, nan) if 1 is outside."""

    def inside(stretch: float) -> bool:
        return bool(energy.margin(p, along(path, jnp.asarray(stretch))) > 0)

    at_rest, *ends = np.asarray(energy.margin(p, along(path, jnp.asarray((1.0, *within)))) > 0)
    if not at_rest:
        return float("nan"), float("nan")
    low, high = (end if fine else _last_inside(inside, end) for end, fine in zip(within, ends, strict=True))
    return low, high


def _last_inside(inside, end: float) -> float:
    """Bisection for the last stretch inside between 1 and `end`; margins fall monotonically away from rest."""
    good, bad = 1.0, end
    for _ in range(50):
        middle = 0.5 * (good + bad)
        good, bad = (middle, bad) if inside(middle) else (good, middle)
    return good
