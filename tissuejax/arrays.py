"""Names for arrays by where they are made.

Float[Array, "3 E"]         of the device, or traced: what compiled programs pass around
Float[np.ndarray, "n"]      of the host: recordings, meshes, results
Float[Either, "..."]        what a formula takes that is written once for both: an array of either side, or a number
Float[Given, "..."]         a field that formulas read and the host fills, with an array of either side or a number
"""

from typing import TYPE_CHECKING, Any

from jax.core import Tracer
from jaxtyping import Array, ArrayLike

if TYPE_CHECKING:
    Either = Array  # formulas are written, and checked, for arrays; the others do what these do
    Given = Array | Any  # so it is read, and checked, as an array of the device, and whatever comes may be put there
else:
    Either = Given = ArrayLike


def traced(*values: Given) -> bool:
    """Whether any of the values is only known while a program is traced: there is no number to look at."""
    return any(isinstance(value, Tracer) for value in values)
