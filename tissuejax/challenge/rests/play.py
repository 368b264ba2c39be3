"""Rate-independent hysteresis that scales with the load: a sum of plays (Ishlinskii 1944) times the stress."""

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.rests.rest import History, Record, Rest

PLAYS = 5


def play(x: Float[np.ndarray, " n"], gap: float) -> Float[np.ndarray, " n"]:
    """Output that follows `x` once it has moved by `gap` from where it last turned; starts untouched."""
    out = np.zeros_like(x)
    for i in range(1, len(x)):
        out[i] = min(max(out[i - 1], x[i] - gap), x[i] + gap)
    return out


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """|stress| times the part of the strain that lags by plays of random gaps."""
    span = max(np.abs(r.strain).max() for r in records)
    gaps, weights = span * np.exp(rng.uniform(np.log(0.01), np.log(0.5), PLAYS)), rng.exponential(size=PLAYS)
    out = []
    for r in records:
        lag = sum(w * (r.strain - play(r.strain, gap)) / gap for w, gap in zip(weights, gaps))
        out.append(np.abs(r.stress) * r.along(lag / weights.sum()))
    return out


REST = Rest("play", "hysteresis that no rate changes", change, ("hysteresis",))
