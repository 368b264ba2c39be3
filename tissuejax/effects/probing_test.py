"""A probing as effects see it: what they need to know beyond the scene they change."""

import equinox as eqx
from jaxtyping import Float

from tissuejax.arrays import Given


class ProbingTest(eqx.Module):
    """One probing recording, without its measurement. All entries are arrays, so one program serves all recordings.

    Attributes:
        start: this recording's time zero after the sample's first, s.
        centres: element centres in the measured shape, m.
        mass: each node's share of the mass of each element, kg per node (element mass / nodes of an element).
        below_top: depth of every node under the free surface above it, m.
        height: thickness of the tissue under the probe, m.
        first_touch: contact begins, on the recording's clock, s (NaN if never).
        rest: rest positions of the markers, m.
    """

    start: Float[Given, ""]
    centres: Float[Given, "E 3"]
    mass: Float[Given, " E"]
    below_top: Float[Given, " N"]
    height: Float[Given, ""]
    first_touch: Float[Given, ""]
    rest: Float[Given, "k 3"]
