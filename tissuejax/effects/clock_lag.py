"""Force and displacement, or force and markers, on different clocks."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect, Respond
from tissuejax.effects.history import delayed
from tissuejax.effects.material_test import MaterialTest
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel


class ClockLag(Effect):
    """In a material test, stress stamped t is that of the stretch at t - lag (`history.delayed`); in a probing, a
    marker frame stamped t shows the tissue at t - lag; in a cut, force stamped t is that of the blade at t - lag.
    Neutral: 0.

    Revealed by residuals in proportion to the rate of what was done, none in holds: in a probing by markers alone, in a
    cut where the blade enters, turns, and leaves. Blind: recordings at one rate without holds (it then looks like
    hysteresis), or at rest; probings without markers; a cut recorded in its steady middle.
    Source: Lister 2012, 2.2.1 (force at 62.5 Hz and cameras at 15 Hz on separate clocks).
    """

    name: ClassVar[str] = "clock-lag"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing", "cutting"})
    group: ClassVar[str] = "rig"
    reveals: ClassVar[str] = "residuals proportional to the rate of what was done, none in holds"
    blind: ClassVar[str] = (
        "ramps at one rate without holds; holds alone; probings without markers; the steady middle of a cut"
    )
    words: ClassVar[tuple[str, ...]] = ("the clocks are {lag} apart",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "rates"}
    misjudged: ClassVar[Mapping[str, float]] = {"lag": 0.05}  # of one controller: its filters, a few samples
    source: ClassVar[str] = "Lister 2012, 2.2.1 (force at 62.5 Hz and cameras at 15 Hz on separate clocks)"
    amplitudes: ClassVar[tuple[str, ...]] = ("lag",)
    order: ClassVar[int] = 0

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("lag", "s", 0.0, -1.0, 1.0, "how late the clock of stress or markers is", scale=0.05),)

    def stretch(
        self, p: Mapping[str, Array], test: MaterialTest, drive: Float[Array, "n ..."], respond: Respond
    ) -> Float[Array, "n ..."]:
        def late(x: Float[Array, " n"]) -> Float[Array, " n"]:
            return delayed(test.time, x, p["lag"]) - delayed(test.time, x, jnp.zeros_like(p["lag"]))

        return drive + (late(drive) if drive.ndim == 1 else jax.vmap(late, 1, 1)(drive))

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        late = {
            name: Channel(seen.time + p["lag"], seen.values, seen.unit, seen.noise_std)
            for name, seen in channels.items()
            if name in ("markers", "cutting_force")
        }
        return {**channels, **late}
