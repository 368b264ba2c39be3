"""A zero that wanders by steps: it jumps at random moments and creeps back at a constant speed, in seconds."""

import numpy as np

from tissuejax.challenge.rests.rest import History, Record, Rest

BETWEEN = 6.0  # s, mean


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Zero of the cell, Pa, a course of its own for every recording and component."""
    out = []
    for r in records:
        t = r.trial.time - r.trial.time[0]
        courses = []
        for _ in range(r.stress[:1].size):
            jumps = np.cumsum(rng.exponential(BETWEEN, size=int(4 * t[-1] / BETWEEN) + 8))
            sizes, speed = rng.normal(size=len(jumps)), 1 / rng.uniform(3.0, 15.0)
            left = np.maximum(np.abs(sizes)[:, None] - speed * (t[None] - jumps[:, None]), 0)
            courses.append(np.sum(np.sign(sizes)[:, None] * left * (t[None] >= jumps[:, None]), 0))
        out.append(r.top * np.stack(courses, -1).reshape(r.stress.shape))
    return out


REST = Rest("wander", "the cell's zero jumps and creeps back", change)
