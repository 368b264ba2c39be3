"""Names for arrays by where they are made.

Float[Array, "3 E"]         of the device, or traced: what compiled programs pass around
Float[np.ndarray, "n"]      of the host: recordings, meshes, results
Float[Either, "..."]        what a formula takes that is written once for both: an array of either side, or a number
Float[Given, "..."]         a field that formulas read and the host fills, with an array of either side or a number
"""

from typing import TYPE_CHECKING, Any

import jax
from jax.core import Tracer
from jaxtyping import Array, ArrayLike

if TYPE_CHECKING:
    Either = Array  # formulas are written, and checked, for arrays; the others do what these do
    Given = Array | Any  # so it is read, and checked, as an array of the device, and whatever comes may be put there
else:
    Either = Given = ArrayLike


def barrier(x: Any) -> Any:
    """`x`, kept apart from what is made of it, so that XLA computes it once. For programs compiled as `tled.simulate`
    does, on the CPU; compilers for other devices need no such thing and have no form for it under those options."""
    return jax.lax.optimization_barrier(x) if jax.default_backend() == "cpu" else x


def traced(*values: Given) -> bool:
    """Whether any of the values is only known while a program is traced: there is no number to look at."""
    return any(isinstance(value, Tracer) for value in values)
