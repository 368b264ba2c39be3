"""Specimen scatter: a stiffness, or a gain of the sensor, of each recording's own."""

from collections.abc import Mapping
from typing import ClassVar

from tissuejax.effects.widening import Widening


class SpecimenScatter(Widening):
    """Every recording has a gain and a smooth law of its own: specimens or sites differ, or the load cell's gain does.

    Stress and stretch can't tell a softer specimen from a smaller gain, nor force and depth of a probing. A share that
    all recordings have in common is none of it: that is the moduli's.

    Revealed by recordings that repeat themselves at another size, where they pass the same strains or depths. Blind: a
    single recording; recordings that share no strain (each may then follow one law somewhere else). Width: 0.3 of the
    stress, as much as an effect of the tissue usually changes (`Criteria.change`). Source: a random gain and function
    of each recording's own, Rasmussen and Williams 2006, sec. 2.7.
    """

    name: ClassVar[str] = "specimen-scatter"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    reveals: ClassVar[str] = "recordings that repeat each other at another size"
    blind: ClassVar[str] = "a single recording; recordings that share no strain or depth"
    words: ClassVar[tuple[str, ...]] = ("recordings differ by a stiffness or a gain of their own",)
    remedy: ClassVar[str] = (
        "Fit each recording by itself, or all as a cohort, and check the gain of the load cell between them"
    )
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "repeated", "probing": "several"}
    source: ClassVar[str] = "Rasmussen and Williams 2006, Gaussian Processes for Machine Learning, sec. 2.7"
    widens: ClassVar[Mapping[str, float]] = {"gain": 0.3}
