"""Periodic load: pulse or mains hum in the force of a material test."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.effects.material_test import MaterialTest
from tissuejax.parameters import Parameter

CYCLES = 2.5  # periods that the longest recording must hold to show one


class Periodic(Effect):
    """Reported stress = stress + sin a(t) `sin` + cos a(t) `cos`, a = 2 pi frequency t.

    With `separate` (the default) every recording has its own phase and strength, t counted from its beginning;
    otherwise one oscillation runs through all recordings, t counted from the first (it needs `start`).

    In probings it is the support that moves: `support-motion`.

    Revealed by a line in the periodogram of the residual, also at rest. Blind: recordings shorter than a period. The
    grid is one frequency a decade fraction; a periodogram of the residual is the better start.
    Source: harmonic model; Lomb 1976, Astrophys. Space Sci. 39.
    """

    name: ClassVar[str] = "periodic"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous"})
    added: ClassVar[bool] = True
    reveals: ClassVar[str] = "a line in the periodogram of the residual"
    blind: ClassVar[str] = "recordings shorter than a period"
    words: ClassVar[tuple[str, ...]] = ("a load with parts of {sin} and {cos} comes back at {frequency}",)
    source: ClassVar[str] = "Lomb 1976"
    order: ClassVar[int] = 0
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {
        "frequency": tuple(float(f) for f in np.concatenate([np.arange(0.06, 0.6, 0.02), np.arange(0.6, 3.0, 0.04)]))
    }
    amplitudes: ClassVar[tuple[str, ...]] = ("sin", "cos", "sin2", "cos2")
    timed: ClassVar[tuple[str, ...]] = amplitudes
    separate: bool = True

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        both = ("sin", "cos", "sin2", "cos2")
        forms = (
            Form("", ("sin", "cos", "frequency"), each=("sin", "cos"), spectral=("frequency", 3)),
            Form("two harmonics", (*both, "frequency"), nominated=False, each=both, spectral=("frequency", 3)),
        )
        lower = CYCLES / sizes.recording
        upper = max(0.25 / sizes.step, 2 * lower)
        return Offer(cls(separate=True), forms, ranges={"frequency": (lower, upper, 2 * lower)})

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        each = self.separate
        return (
            Parameter("sin", "Pa", 0.0, scale=10.0, each=each, meaning="sine part of the load"),
            Parameter("cos", "Pa", 0.0, scale=10.0, each=each, meaning="cosine part of the load"),
            Parameter("sin2", "Pa", 0.0, scale=10.0, each=each, meaning="sine of twice the frequency"),
            Parameter("cos2", "Pa", 0.0, scale=10.0, each=each, meaning="cosine of that"),
            Parameter("frequency", "1/s", 0.25, lower=1e-4, upper=1e4, meaning="of the load"),
        )

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        angle = 2 * jnp.pi * p["frequency"] * (test.elapsed if self.separate else test.start + test.elapsed)
        s, c = jnp.sin(angle), jnp.cos(angle)
        load = p["sin"] * s + p["cos"] * c + p["sin2"] * 2 * s * c + p["cos2"] * (1 - 2 * s * s)
        return stress + (load if stress.ndim == 1 else load[:, None])
