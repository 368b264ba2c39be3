"""Material stability of a fitted energy over the stretches that were fitted (Drucker), as sentences for the reader."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tissuejax.fitting.result import Fit


def unstable(found: "Fit") -> list[str]:
    """One sentence if the fitted energy softens to instability inside the range of stretches asked for."""
    return []
