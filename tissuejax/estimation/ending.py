"""How a descent ended: an enumeration of the sentences that a user reads."""

import enum


class Ending(enum.StrEnum):
    """Why a descent stopped; only the first is an end that the data ask for."""

    CONVERGED = "converged"
    NO_PREDICTION = "the model has no finite prediction at the start"
    NO_DERIVATIVE = "the model has no finite derivative here"
    NOTHING_BETTER = "no nearby point is better, though the derivatives promise one"
    BEHIND = "given up: another start is better and this one creeps"
    BROKEN = "the misfit became infinite; take a bounded or a nearer start"
    SPENT = "no convergence"
    LONG_STEPS = "the last steps are still long"
