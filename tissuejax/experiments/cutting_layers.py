"""The two layers that a blade leaves squeezed beside it: their energy, their pressure, and how both relax.

Elastic layers of height W (half the tissue's width) pressed together by half the thickness b hold 2 W psi(1 - b / 2W)
per area of cut and press on the flats with p. Where the isochoric stress relaxes (shares g, times tau), what the bevel
pays for squeezing them in T = b / (2 t v) lies between the long-term and the instantaneous energy, for a pressure that
grows evenly

    1 - sum g (1 - phi(T / tau)),   phi(r) = 2 / r (1 - (1 - exp(-r)) / r),

and what is left of the pressure behind it at age a (time since the edge passed) is

    1 - sum g (1 - (1 - exp(-r)) / r exp(-a / tau)).

Both are exact for a layer whose pressure is linear in what it is squeezed by (hereditary integral over a ramp and a
hold; Fung 1993, 7.6), and act on its isochoric part alone.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.energies.strain import Strain
from tissuejax.experiments.cutting_record import Path
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.tensors import Sym

STATIONS = 24  # along the blade's contact at which its age is taken
SHORT, LONG = 1e-4, 1e9  # times of relaxation that a blade takes over its own bevel: at rest it never comes over it


class Layers(NamedTuple):
    """Energy of both layers per area of cut, J/m^2, pressure on a flat, Pa, and the isochoric part of each."""

    energy: Array
    pressure: Array
    isochoric: tuple[Array, Array]


def layer(model: Model, values: Mapping[str, Array], half: Float[Given, ""], thickness: Float[Given, ""]) -> Layers:
    """The squeezed layers, elastic."""
    energy, bulk = under("energy", values), under("volumetric", values)

    def strain(stretch):
        one, none = jnp.ones_like(stretch), jnp.zeros_like(stretch)
        return Strain.of(Sym(one, stretch**2, one, none, none, none))

    def shape(stretch):
        return model.energy.isochoric(energy, strain(stretch))

    def psi(stretch):
        total = shape(stretch)
        return total if model.volumetric is None else total + model.volumetric.energy(bulk, strain(stretch).J)

    stretch = 1 - 0.5 * jnp.asarray(thickness) / half
    value, slope = jax.value_and_grad(psi)(stretch)
    own, steep = jax.value_and_grad(shape)(stretch)
    return Layers(2 * half * value, -slope, (2 * half * own, -steep))


def relaxed(layers: Layers, relaxing, path: Path, since: Float[Given, "n s"] | None = None) -> tuple[Array, Array]:
    """Energy paid for a layer and mean pressure on the flats at every time of a path, relaxed; `since`: its `ages`."""
    g, tau = (jnp.asarray(x)[:, None] for x in relaxing)
    bevel = 0.5 * path.thickness / jnp.tan(0.5 * path.angle)
    r = jnp.clip(bevel / jnp.maximum(jnp.abs(path.speed), 1e-9) / tau, SHORT, LONG)
    ramp = -jnp.expm1(-r) / r  # of the pressure, at the bevel's end
    paid = jnp.sum(g * (1 - 2 / r * (1 - ramp)), 0)
    age = jnp.asarray(ages(path) if since is None else since)
    kept = ramp[:, :, None] * jnp.exp(-age / tau[:, :, None])
    gone = jnp.sum(g * (1 - jnp.mean(kept, -1)), 0)
    back = jnp.sum(g * (1 - kept[:, :, -1]), 0)  # the layer that is let go now has been squeezed since the edge passed
    way = path.speed < 0
    energy, pressure = layers.isochoric
    return layers.energy - energy * jnp.where(way, back, paid), layers.pressure - pressure * gone


def ages(path: Path) -> Float[np.ndarray, "n s"]:
    """How long ago the edge last passed forward over `STATIONS` places from the entry to where it stands, s."""
    share = (np.arange(STATIONS) + 0.5) / STATIONS
    path = Path(*(np.asarray(x) for x in path))
    out = np.zeros((len(path.time), STATIONS))
    for i in range(1, len(path.time)):
        place = share * max(float(path.x[i]), 0.0)
        x, t = path.x[: i + 1], path.time[: i + 1]
        onward = (x[:-1, None] <= place) & (x[1:, None] > place)
        seen = onward.any(0)
        last = len(x) - 2 - np.argmax(onward[::-1], axis=0)
        step = np.where(x[last + 1] > x[last], x[last + 1] - x[last], 1.0)
        passed = t[last] + (place - x[last]) / step * (t[last + 1] - t[last])
        out[i] = np.where(seen, t[i] - passed, 0.0)
    return out
