"""Stiffness that changes by kinks at random strains: fibres or contacts that come in one after the other."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest

KNOTS = 7


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Stress times a piecewise straight function of the strain, one for the sample."""
    low, high = min(r.strain.min() for r in records), max(r.strain.max() for r in records)
    knots = np.sort(np.concatenate([[low, 0.0, high], rng.uniform(low, high, KNOTS - 3)]))
    heights = rng.normal(size=KNOTS)
    return [r.stress * r.along(np.interp(r.strain, knots, heights)) for r in records]


REST = Rest("kinked-law", "stiffness changes by kinks", change, ("energy-form",))
