"""Stress softening: tissue that has been strained is softer until it is strained further."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed, Sizes
from tissuejax.effects.history import running_peak
from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.errors import unknown
from tissuejax.parameters import Parameter
from tissuejax.tled.history import Damage
from tissuejax.tled.scene import Scene

LAWS = {"erf": jax.scipy.special.erf, "tanh": jnp.tanh}


class Softening(Effect):
    """S = eta S_e, eta = 1 - r f((W_max - W) / (m + beta W_max)), W_max the largest strain energy so far.

    Pseudo-elastic damage; f is `law`, "erf" (Ogden and Roxburgh) or "tanh" (Dorfmann and Ogden); r is the share lost
    far below the largest load (Ogden and Roxburgh write 1/r for it), m an energy, beta how far the scale grows with
    the load. The first loading is undamaged. With `loading` the virgin path softens as well, eta (1 - d (1 -
    exp(-W_max/m))), d the share lost (discontinuous damage).

    Revealed by unloading below loading, with no relaxation in holds, and by reloading along the unloading path up to
    the former largest load. Blind: monotonic loading. Each recording starts undamaged.
    Source: Ogden and Roxburgh 1999, Proc. R. Soc. A 455, eq. 5.1, as extended in ABAQUS (beta); Dorfmann and Ogden
    2003, Int. J. Solids Struct. 40 (tanh); Simo 1987, CMAME 60.
    """

    name: ClassVar[str] = "softening"
    kinds: ClassVar[frozenset[str]] = frozenset({"homogeneous", "probing"})
    history: ClassVar[bool] = True
    group: ClassVar[str] = "history"
    reveals: ClassVar[str] = "unloading below loading at any rate, reloading along the unloading path"
    blind: ClassVar[str] = "monotonic loading"
    words: ClassVar[tuple[str, ...]] = ("{r:%} of the stiffness is lost below the largest past load",)
    needs: ClassVar[Mapping[str, str]] = {"homogeneous": "reversed"}
    source: ClassVar[str] = "Ogden and Roxburgh 1999, eq. 5.1; Simo 1987"
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"m": (0.005, 0.02, 0.08, 0.3)}
    loading: bool = False
    law: str = "erf"

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """See `Effect.in_material_tests`."""
        forms = (
            Form("", ("r", "m"), {"m": tuple(sizes.energy * x for x in (0.02, 0.1, 0.4))}),
            Form("with growth", ("r", "m", "beta"), nominated=False),
            Form("with loading", ("r", "d", "m", "beta")),
        )
        middle = 0.1 * sizes.energy
        return Offer(cls(loading=True), forms, ranges={"m": (0.02 * middle, 40 * middle, middle)})

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        return Offer(cls(), (Form("", ("r", "m"), {"m": (0.05 * sizes.energy, 0.4 * sizes.energy)}),))

    def __check_init__(self):
        if self.law not in LAWS:
            raise unknown("law of softening", self.law, LAWS)

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """r, and d with `loading`."""
        return ("r", "d") if self.loading else ("r",)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        return (
            Parameter("r", "1", 0.0, lower=0.0, upper=1.0, scale=0.1, meaning="share of stiffness lost below the peak"),
            *(
                (Parameter("d", "1", 0.0, lower=0.0, upper=1.0, scale=0.1, meaning="share lost on the virgin path"),)
                if self.loading
                else ()
            ),
            Parameter("m", "Pa", 20.0, lower=1e-6, upper=1e12, meaning="energy over which softening sets in"),
            Parameter("beta", "1", 0.0, lower=0.0, upper=10.0, scale=0.1, frozen=True, meaning="growth of m with load"),
        )

    def memory(self, p: Mapping[str, Array], test: MaterialTest, state: Stress) -> Stress:
        peak = running_peak(state.W)
        eta = 1 - p["r"] * LAWS[self.law]((peak - state.W) / (p["m"] + p["beta"] * peak))
        if self.loading:
            eta = eta * (1 + p["d"] * jnp.expm1(-peak / p["m"]))
        return state.scaled(eta)

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        zero = jnp.zeros_like(jnp.asarray(p["r"]))
        return scene.put({"tissue.damage": Damage(p.get("d", zero), p["m"], p["r"], p["beta"])})
