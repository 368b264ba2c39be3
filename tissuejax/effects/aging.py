"""Aging: stiffness that drifts with the time since the sample's first recording (thawing, drying, decay)."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.effects.history import dying
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel

AGED = 0.5  # standard deviation of the logarithm of stiffness at the end of a session


class Aging(Effect):
    """P = exp(rate T) P_e, T the time since the first recording: `start` of the recording plus its own time.

    All stiffness ages alike, against changes of shape and of volume: it is the whole nominal stress P that is scaled.
    With `settling` s, T counts as (1 - exp(-s T))/s: dying out for s > 0, gathering pace for s < 0. With `straight` q
    the factor is (1 + q rate T)^(1/q): a straight line in time at 1.

    Revealed by later recordings that are stiffer or softer than earlier ones of the same kind. Blind: a single short
    recording, and recordings without `start` (only the drift inside each is then seen).
    Source: first-order drift of the modulus; the exponential keeps stiffness positive.
    """

    name: ClassVar[str] = "aging"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    group: ClassVar[str] = "rig"
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "later recordings stiffer or softer than earlier ones"
    blind: ClassVar[str] = "a single short recording"
    words: ClassVar[tuple[str, ...]] = ("stiffness changes by {rate:%} a second",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "times"}
    source: ClassVar[str] = "first-order drift of the modulus"
    amplitudes: ClassVar[tuple[str, ...]] = ("rate",)

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        ends = {"settling": (1 / sizes.session, -0.5 / sizes.session)}
        forms = (
            Form("", ("rate",)),
            Form("straight", ("rate", "straight"), {"straight": (1.0,)}, nominated=False),
            Form("settling", ("rate", "settling"), ends, nominated=False),
        )
        return Offer(cls(), forms)

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", ("rate",)),), priors={"rate": (0.0, AGED / sizes.session)})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        meaning = "relative change of stiffness a second"
        settling = "rate at which the drift dies out, or gathers pace if negative"
        return (
            Parameter("rate", "1/s", 0.0, lower=-1.0, upper=1.0, scale=1e-4, meaning=meaning),
            Parameter("straight", "1", 0.0, lower=0.0, upper=2.0, scale=0.2, frozen=True, meaning="1: linear in time"),
            Parameter("settling", "1/s", 0.0, lower=-0.02, upper=1.0, scale=1e-3, frozen=True, meaning=settling),
        )

    def exerted(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        power, q = p["rate"] * dying(test.start + test.elapsed, p["settling"]), p["straight"]
        straight = q > 1e-3
        q = jnp.where(straight, q, 1.0)
        factor = jnp.exp(jnp.where(straight, jnp.log1p(jnp.maximum(q * power, -0.999)) / q, power))
        return stress * (factor if stress.ndim == 1 else factor[:, None])

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        # a probe in given places: stiffness alone, of all the tissue alike, changes the force and no displacement
        seen = channels["force"]
        factor = jnp.exp(p["rate"] * dying(test.start + seen.time, p["settling"]))
        return {**channels, "force": Channel(seen.time, factor[:, None] * seen.values, seen.unit, seen.noise_std)}
