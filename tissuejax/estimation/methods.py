"""The three descents that fits and diagnoses are made by, as choices of parts (`descent`)."""

from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Float

from tissuejax.estimation.derivatives import Corrected, Exact
from tissuejax.estimation.descent import Method
from tissuejax.estimation.reach import Reach
from tissuejax.estimation.rules import Damping, InChiSquare, InErrors, Precise

# a step of a hundredth of what one standard error moves is free at the start
TRUSTED = Damping(1e-4, 1e-3, trusted=0.75, falls=6.0, least=0.0, doubted=1.0, rises=5.0, from_rise=0.0, of_start=True)
SPARED = Damping(1e-4, 1e-3, trusted=0.5, falls=10.0, least=1e-8, doubted=2.0, rises=10.0, from_rise=1e-3)
EAGER = Damping(1e-3, 0.0, trusted=None, falls=10.0, least=1e-9, doubted=1.0, rises=8.0, from_rise=1e-6)
ALL = 10**6


def trust_region(p: int, runs: int = 200, tolerance: float = 1e-9, to_beat: float = np.inf) -> Method:
    """Of predictions whose derivatives come with them at little cost, in p coordinates of order one without bounds."""
    return Method(Exact, Reach.anywhere(p), TRUSTED, Precise(tolerance, runs, to_beat), ALL, ALL)


def marquardt(p: int, points: int = 20, fraction: float = 0.1, last: float = 0.5, longest: float = 1.0) -> Method:
    """Of predictions that cost a simulation, in p coordinates of order one (logarithms, scaled parameters).

    A trial costs a forward run; a Jacobian (five times as much) follows only once the point is better.
    """
    return Method(Exact, Reach.anywhere(p, longest), SPARED, InErrors(fraction, last), points, 8)


def broyden(
    reach: Reach,
    points: int,
    tolerance: float,
    known: Float[np.ndarray, "n p"] | None = None,
    sharpen: Callable[[], None] | None = None,
    costly: bool = False,
) -> Method:
    """Of Jacobians that are differences of many predictions, between bounds.

    Args:
        tolerance: of chi-square.
        known, sharpen: see `derivatives.Corrected`.
        costly: whether every prediction is a simulation.
    """
    source = partial(Corrected, known=known, sharpen=sharpen)
    return Method(source, reach, EAGER, InChiSquare(tolerance, costly), points, 2 if costly else 10)
