"""Hysteresis that no rate changes: unloading takes another way than loading, however slowly."""

from collections.abc import Mapping
from typing import ClassVar

from tissuejax.effects.widening import Widening


class Hysteresis(Widening):
    """Between loading and unloading the force changes by a share that depends on the way and not on its rate.

    Friction inside a load cell, in a joint of the rig, or between fibres: recordings don't say where. A hysteresis that
    comes from relaxation depends on the rate, and dies out in a hold.

    Revealed by a loop between loading and unloading, as wide at every rate. Blind: what never unloads; one rate alone,
    where relaxation makes a loop too. Width: 0.15 of the force to either side, so that loading and unloading are as far
    apart as an effect of the tissue usually changes the stress (0.3, `Criteria.change`). Source: plays, Ishlinskii
    1944; loops of tissue that rates hardly change, Fung 1993, sec. 7.6.
    """

    name: ClassVar[str] = "hysteresis"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    reveals: ClassVar[str] = "a loop between loading and unloading that is as wide at every rate"
    blind: ClassVar[str] = "what never unloads; at one rate alone, relaxation makes a loop too"
    words: ClassVar[tuple[str, ...]] = ("unloading takes another way than loading, at any rate",)
    remedy: ClassVar[str] = (
        "Cycle a steel spring in the rig: if the loop is there too, it is the rig's; else fit loading alone, or repeat "
        "at rates a decade apart to tell it from relaxation"
    )
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "reversed", "probing": "reversed"}
    source: ClassVar[str] = "Ishlinskii 1944; Fung 1993, sec. 7.6"
    widens: ClassVar[Mapping[str, float]] = {"hysteresis": 0.15}
