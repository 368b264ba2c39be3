"""Effects without parameters: a part of what any law leaves, far larger than usual, and by its own name."""

from collections.abc import Mapping
from typing import ClassVar

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.parameters import Parameter


class Widening(Effect):
    """Nothing to simulate and nothing to fit: a family of the discrepancy (`estimation.discrepancy`) that is wide.

    Class data:
        widens: the families, each with the standard deviation of its prior, a share of what is measured.
    """

    amplitudes: ClassVar[tuple[str, ...]] = ()
    widens: ClassVar[Mapping[str, float]]

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        return Offer(cls(), (Form("", (), widens=cls.widens),))

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", (), widens=cls.widens),))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()
