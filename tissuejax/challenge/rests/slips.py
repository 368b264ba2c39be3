"""Slips that recover: at random moments under load a share of the stress is lost, and comes back over seconds."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Stress times minus the losses present at each time."""
    out = []
    for r in records:
        loaded = np.flatnonzero(np.abs(r.strain) > 0.2 * np.abs(r.strain).max())
        lost = np.zeros(len(r.strain))
        for at in rng.choice(loaded, size=int(rng.integers(2, 5))):
            since = r.trial.time - r.trial.time[at]
            lost += rng.exponential() * (since >= 0) * np.exp(-np.maximum(since, 0) / rng.uniform(0.5, 4.0))
        out.append(-r.stress * r.along(lost))
    return out


REST = Rest("slips", "grips slip and hold again", change)
