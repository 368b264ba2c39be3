"""Names for arrays by where they are made.

Float[Array, "3 E"]         of the device, or traced: what compiled programs pass around
Float[np.ndarray, "n"]      of the host: recordings, meshes, results
Float[Either, "..."]        what a formula takes that is written once for both: an array of either side, or a number
"""

from typing import TYPE_CHECKING

from jaxtyping import Array, ArrayLike

if TYPE_CHECKING:
    Either = Array  # formulas are written, and checked, for arrays; the others do what these do
else:
    Either = ArrayLike
