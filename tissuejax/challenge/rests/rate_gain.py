"""A reading that grows with the rate of loading and keeps its gain while held: it jumps where the rate does."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Stress times a saturating function of the logarithm of the last rate at which the drive moved."""
    rates = []
    for r in records:
        rate = np.abs(np.gradient(r.strain, r.trial.time))
        moving = rate > 0.05 * rate.max()
        last = np.maximum.accumulate(np.where(moving, np.arange(len(rate)), 0))
        first = int(np.argmax(moving))
        rates.append(np.maximum(rate[np.maximum(last, first)], 1e-6))
    middle = np.median(np.log(np.concatenate(rates)))
    steepness = float(rng.uniform(0.8, 2.0))
    return [r.stress * r.along(np.tanh(steepness * (np.log(x) - middle))) for r, x in zip(records, rates)]


REST = Rest("rate-gain", "the reading's gain depends on the rate", change, ("gain",))
