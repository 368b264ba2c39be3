"""The law is another one everywhere: a share of the response of a specimen whose chains lock or exponents differ."""

import numpy as np

from tissuejax.challenge.material import Specimen, reported
from tissuejax.challenge.rests.rest import History, Record, Rest
from tissuejax.challenge.strain_laws import Body


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Other law's stress less the base's, both of the same overall size."""
    if rng.random() < 0.5:
        extra = ("locking", {"mu": 1.0, "limit": float(rng.uniform(0.9, 2.5))})
    else:
        alpha = [float(rng.uniform(4, 12)), -float(rng.uniform(3, 12))]
        extra = ("ogden", {"mu": [float(rng.uniform(0.2, 1)), float(rng.uniform(0.2, 1))], "alpha": alpha})
    other = [reported(Specimen(Body({}, (extra,))), r.trial) for r in records]
    own = [reported(Specimen(r.body), r.trial) for r in records]
    flat, base = (np.concatenate([x.ravel() for x in xs]) for xs in (other, own))
    scale = float(flat @ base / (flat @ flat))
    return [scale * o - b for o, b in zip(other, own)]


REST = Rest("other-law", "the elastic law differs everywhere", change, ("energy-form",))
