"""What a law of rest is, and how several make the rest of a sample."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body

History = Float[np.ndarray, "n ..."]


@dataclass(frozen=True)
class Record:
    """One recording as a law of rest sees it.

    Attributes:
        trial: what was done.
        stress: what the specimen with its effects gives, Pa.
        body: the base.
        top: the largest stress of the sample, Pa.
    """

    trial: Trial
    stress: History
    body: Body
    top: float

    @property
    def strain(self) -> Float[np.ndarray, " n"]:
        """Logarithmic stretch or shear in the first driven direction."""
        return self.trial.strain if self.trial.strain.ndim == 1 else self.trial.strain[:, 0]

    def along(self, x: Float[np.ndarray, " n"]) -> History:
        """`x` over time, ready to be multiplied with the stress."""
        return x.reshape(-1, *([1] * (self.stress.ndim - 1)))


@dataclass(frozen=True)
class Rest:
    """A law of rest.

    Attributes:
        name: of the law.
        about: what happens in the lab.
        change: from a generator of the sample's own and its recordings, the change of every recording's stress, Pa.
        true_names: effects that a diagnosis may rightly name for it, should a catalogue have them.
    """

    name: str
    about: str
    change: Callable[[np.random.Generator, list[Record]], list[History]]
    true_names: tuple[str, ...] = ()


def together(parts: list[list[History]], weights: list[float], sizes: list[float]) -> list[History]:
    """Sum of the laws' changes, each brought to unit size first.

    Args:
        parts: changes by law and recording.
        sizes: of each law's changes, in any unit common to all.
    """
    scaled = [[w / s * x for x in part] for part, w, s in zip(parts, weights, sizes)]
    return [np.sum(np.stack([part[i] for part in scaled]), 0) for i in range(len(parts[0]))]
