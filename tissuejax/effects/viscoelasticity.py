"""Finite linear viscoelasticity: a Prony series on the isochoric stress."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.effects.history import fading
from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.history import Prony
from tissuejax.tled.scene import Scene


class Viscoelasticity(Effect):
    """S(t) = S_e(t) - sum_i g_i (S_e - h_i), h_i the past of S_e fading with tau_i (quasi-linear viscoelasticity).

    S_e is the elastic isochoric PK2 stress; with `moduli` it is instead 2 dpsi/dCbar before the isochoric projection,
    which is applied afterwards: then it is the moduli that relax, from the first sample on, and no stress is left
    when the specimen is back at its first length. Tissue is seen to follow either; the parameter `moduli` leads from
    the one (0) to the other (1) in between. With `nominal` 1 it is the nominal stress of the specimen itself that
    relaxes, P(t) = P_e(t) - sum_i g_i (P_e - h_i), as in Fung's own quasi-linear law of a tension test; a probing
    knows the first law alone. The energy's moduli are INSTANTANEOUS ones; the long-term stress is (1 - sum_i g_i) of
    it (`long_term`). A recording starts from rested tissue. `terms` relaxation times lie, to start with, in equal
    parts of the decades from `shortest` to `longest` seconds. In a cut it is the layers beside the blade that relax.
    Neutral: all shares 0.

    Revealed by force falling during holds, by hysteresis between loading and unloading, by stiffness rising with rate;
    in cuts by friction that falls with the time that the blade has been where it is, and by wedging that grows with
    speed. Blind: one monotonic ramp at constant rate (it looks like another energy); one speed of a blade without
    friction, whose force is nearly all toughness. Inseparable from softening in a single
    cycle without a hold. Source: Fung 1993, sec. 7.6; Simo and Hughes 1998, sec. 10.3.
    """

    name: ClassVar[str] = "viscoelasticity"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing", "cutting"})
    history: ClassVar[bool] = True
    group: ClassVar[str] = "history"
    reveals: ClassVar[str] = "relaxation during holds, hysteresis, stiffness that rises with rate"
    blind: ClassVar[str] = "a single ramp at constant rate; cuts with a blade that hardly rubs"
    words: ClassVar[tuple[str, ...]] = (
        "{g1:%} of the stress relaxes with {tau1}",
        "{g2:%} with {tau2}",
        "{g3:%} with {tau3}",
        "{g4:%} with {tau4}",
        "{g5:%} with {tau5}",
    )
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "rates"}
    source: ClassVar[str] = "Fung 1993, sec. 7.6; Simo and Hughes 1998, sec. 10.3"
    order: ClassVar[int] = 2
    terms: int = 1
    shortest: float = 0.1
    longest: float = 100.0
    moduli: bool = False

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        last, two = sizes.recording, ("g1", "g2", "tau1", "tau2")
        three = ("g1", "g2", "g3", "tau1", "tau2", "tau3")
        once = {"tau1": tuple(last * float(t) for t in np.geomspace(0.0025, 1.5, 7))}  # what the longest one can show
        pairs = {
            "tau1": tuple(last * t for t in (0.005, 0.015, 0.05)),
            "tau2": tuple(last * t for t in (0.1, 0.3, 1.0)),
        }
        third = {"tau3": (0.025 * last, 1.5 * last, 0.0025 * last)}  # between the two that are there, slower, faster
        moduli, nominal = {"moduli": (1.0,)}, {"nominal": (1.0,)}
        forms = (
            Form("one time", ("g1", "tau1"), once),
            Form("two times", two, pairs),
            Form("two times of the moduli", (*two, "moduli"), pairs | moduli),
            Form("three times", three, third, nominated=False),
            Form("three times of the moduli", (*three, "moduli"), third | moduli, nominated=False),
            Form("two times of the nominal stress", (*two, "nominal"), pairs | nominal),
            Form("three times of the nominal stress", (*three, "nominal"), third | nominal, nominated=False),
        )
        return Offer(cls(terms=3), forms, quickest=sizes.finest)

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        one = Form("one time", ("g1", "tau1"), {"tau1": (0.4, 4.0)}, nominated=False)
        two = Form("two times", ("g1", "g2", "tau1", "tau2"), {"tau1": (0.5,), "tau2": (6.0,)})
        return Offer(cls(terms=2), (one, two), quickest=sizes.finest)

    @classmethod
    def in_cuts(cls) -> Offer:
        """See `Effect.in_cuts`: one time."""
        return Offer.scanned(cls(terms=1))

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """g1 ... gN."""
        return tuple(f"g{i}" for i in self._numbers)

    @property
    def shares(self) -> tuple[str, ...]:
        """Parts of one whole: g1 + ... + gN stays below 1 in a fit, or nothing would be left in the long term."""
        return self.amplitudes

    @property
    def times(self) -> tuple[str, ...]:
        """Relaxation times, which no recording shows below its sampling nor far beyond its length."""
        return tuple(f"tau{i}" for i in self._numbers)

    @property
    def grid(self) -> dict[str, tuple[float, ...]]:
        """Two to three times in each term's part of the decades, so that terms keep their order."""
        edges = np.geomspace(self.shortest, self.longest, self.terms + 1)
        return {
            f"tau{i}": tuple(float(t) for t in np.geomspace(low, high, 7)[1::2])
            for i, low, high in zip(self._numbers, edges[:-1], edges[1:])
        }

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        edges = np.geomspace(self.shortest, self.longest, self.terms + 1)
        times = np.sqrt(edges[:-1] * edges[1:])
        return (
            tuple(
                Parameter(f"g{i}", "1", 0.0, lower=0.0, upper=1.0, scale=0.1, meaning=f"share that relaxes with tau{i}")
                for i in self._numbers
            )
            + tuple(
                Parameter(f"tau{i}", "s", float(t), lower=1e-4, upper=1e7, meaning=f"relaxation time {i}")
                for i, t in zip(self._numbers, times)
            )
            + (
                Parameter("moduli", "1", float(self.moduli), 0.0, 1.0, "share of the moduli's law", frozen=True),
                Parameter("nominal", "1", 0.0, 0.0, 1.0, "share of the nominal stress's law", frozen=True),
            )
        )

    @property
    def _numbers(self) -> range:
        return range(1, self.terms + 1)

    def long_term(self, p: Mapping[str, Array]) -> Array | float:
        """Long-term over instantaneous stiffness, 1 - sum g_i."""
        return 1 - sum((p[f"g{i}"] for i in self._numbers), 0.0)

    def memory(self, p: Mapping[str, Array], test: MaterialTest, state: Stress) -> Stress:
        inverse, share, rest = state.inverse, p.get("moduli", float(self.moduli)), 1 - p.get("nominal", 0.0)
        s = state.stacked()
        seen = s + share * state.spherical[:, None] * inverse
        g, tau = self._series(p)
        h = jax.vmap(lambda t: fading(test.time, seen, t))(tau)
        h = h + share * jnp.exp(-test.elapsed[:, None] / tau[:, None, None]) * seen[0]  # moduli are there before strain
        lost = jnp.tensordot(rest * g, seen - h, 1)
        C = jnp.stack([state.C.xx, state.C.yy, state.C.zz, 2 * state.C.xy], -1)
        lost = lost - share * jnp.sum(lost * C, -1, keepdims=True) / 3 * inverse
        return state.replaced(s - lost)

    def exerted(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        g, tau = self._series(p)
        seen = stress.reshape(len(stress), -1)
        h = jax.vmap(lambda t: fading(test.time, seen, t))(tau)
        lost = jnp.tensordot(p.get("nominal", 0.0) * g, seen - h, 1)
        return stress - lost.reshape(stress.shape)

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        return scene.put({"tissue.prony": Prony(*self._series(p))})

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        return cut.with_(relaxing=self._series(p))

    def _series(self, p: Mapping[str, Array]) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
        g, tau = (jnp.stack([jnp.asarray(p[f"{name}{i}"]) for i in self._numbers]) for name in ("g", "tau"))
        return g, tau
