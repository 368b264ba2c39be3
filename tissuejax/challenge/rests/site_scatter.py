"""Every recording comes from another place or specimen: each term of the base has a size of its own there."""

import numpy as np

from tissuejax.challenge.material import Specimen, reported
from tissuejax.challenge.rests.rest import History, Record, Rest
from tissuejax.challenge.strain_laws import Body


def change(rng: np.random.Generator, records: list[Record]) -> list[History]:
    """Sum over the base's terms of a random share, by recording, of that term's stress."""
    out = []
    for r in records:
        shares = {term: c * float(np.expm1(0.3 * rng.normal())) for term, c in r.body.terms.items()}
        out.append(reported(Specimen(Body(shares)), r.trial))
    return out


REST = Rest("site-scatter", "specimens or sites differ", change, ("specimen-scatter", "gain", "energy-form"))
