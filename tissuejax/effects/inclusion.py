"""A stiffer (or softer) region inside the tissue, its place and size found with its contrast."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.effect import Effect
from tissuejax.effects.form import Form, Offer, Probed
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.parameters import Parameter
from tissuejax.tled.scene import Scene

DEPTHS = (0.25, 0.45, 0.7)  # below the surface, shares of the height, at which one is looked for


class Inclusion(Effect):
    """Strain energy times exp(contrast * w), w = exp(-s^4), s = distance / radius, z counted `flatness` times.

    The flat-topped w is close to a sharp edge and yet smooth in place and size, so both have derivatives. A stiff
    region would need smaller steps; it gets the mass that keeps the step instead (probing is slow, inertia is nothing).
    Neutral: contrast 0. Reveals: force and markers of one site unlike the others. Blind: sites farther away than about
    twice its depth.
    """

    name: ClassVar[str] = "inclusion"
    kinds: ClassVar[frozenset[str]] = frozenset({"probing"})
    group: ClassVar[str] = "rig"
    remembers: ClassVar[bool] = False
    reveals: ClassVar[str] = "one site stiffer or softer than the rest, the more the deeper the probe"
    blind: ClassVar[str] = "sites farther off than about twice its depth; material tests"
    words: ClassVar[tuple[str, ...]] = (
        "a lump {contrast:exp} times as stiff and {radius} in radius lies at x {x}, y {y}, height {z}",
    )
    source: ClassVar[str] = "a field of stiffness, as in elastography"
    amplitudes: ClassVar[tuple[str, ...]] = ("contrast",)
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {"radius": (3e-3, 5e-3, 8e-3)}

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """See `Effect.in_probings`."""
        round_ = ("contrast", "x", "y", "z", "radius")
        flat = Form("flat", (*round_, "flatness"), nominated=False, placed=under_sites)
        return Offer(cls(), (Form("round", round_, {"radius": (6e-3,)}, placed=under_sites), flat))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        place = [Parameter(c, "m", 0.0, -0.5, 0.5, f"{c} of its centre", scale=5e-3) for c in "xy"]
        return (
            Parameter("contrast", "1", 0.0, -4.0, 4.0, "logarithm of its stiffness over the rest", scale=0.5),
            *place,
            Parameter("z", "m", 0.01, 0.0, 0.5, "height of its centre over the support", scale=5e-3),
            Parameter("radius", "m", 5e-3, 5e-4, 0.1, "half its width"),
            Parameter("flatness", "1", 1.0, 0.2, 5.0, "half its width over half its height", frozen=True),
        )

    def scene(self, p: Mapping[str, Array], test: ProbingTest, scene: Scene) -> Scene:
        centre = jnp.stack([jnp.asarray(p[c], test.centres.dtype) for c in "xyz"])
        away = (test.centres - centre) * jnp.stack([jnp.ones_like(centre[0]), jnp.ones_like(centre[0]), p["flatness"]])
        s2 = jnp.sum(away**2, axis=1) / p["radius"] ** 2
        factor = jnp.exp(p["contrast"] * jnp.exp(-(s2**2)))
        return scene.put({"tissue.stiffness": scene.stiffness * factor}).put(_mass(scene, test, factor))


def under_sites(sites: Mapping[str, Float[np.ndarray, "2"]], height: Mapping[str, float]) -> list[dict[str, float]]:
    """Where it is looked for: under the place of every recording, at three shares of the tissue's height, m."""
    found = []
    for name, (x, y) in sites.items():
        for share in DEPTHS:
            radius = float(np.clip(0.25 * height[name], 3e-3, 1e-2))
            found.append({"x": float(x), "y": float(y), "z": float(height[name] * (1 - share)), "radius": radius})
    return found


def _mass(scene: Scene, test: ProbingTest, factor: Array) -> dict[str, Array]:
    """Extra mass of the nodes of stiffened elements, so that their wave speed stays."""
    extra = test.mass * jnp.maximum(factor - 1.0, 0.0)
    cells = scene.body.cells
    extra = jnp.repeat(extra, cells.shape[1]).astype(scene.pressed.mass.dtype)
    mass = scene.pressed.mass.at[cells.ravel()].add(extra)
    return {"probe.mass": mass}
