"""A coarse converter: the reading moves in steps of some per cent of the range."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Stress rounded to steps, less the stress."""
    step = records[0].top * float(rng.uniform(0.02, 0.06))
    return [step * np.round(r.stress / step) - r.stress for r in records]


REST = Rest("coarse", "the reading moves in steps", change)
