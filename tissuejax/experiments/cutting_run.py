"""A cut simulated: a plane slice of the tissue with cohesive faces on the path, whose force per depth counts.

The slice holds what the energy balance has not: the law of parting, so strength and entry. The cut is run at
`SPEED`, whatever its own pace was (inertia is small at both; a rate effect acts through the toughness), by running time
faster. Depth multiplies the slice's force; a blade that does not cut all the way through shears the tissue below it,
which a slice leaves out (`tled` has the whole, see docs/cutting.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given
from tissuejax.effects.effect import Effect
from tissuejax.errors import InputError
from tissuejax.experiments.cutting import met
from tissuejax.experiments.cutting_record import Path
from tissuejax.experiments.probing import Added
from tissuejax.mesh.slab import plane_slice, slice_held
from tissuejax.model import Model
from tissuejax.parameters import Constants, under
from tissuejax.tled import build, seam
from tissuejax.tled.blade import Wedge
from tissuejax.tled.scene import Scene
from tissuejax.tled.simulate import simulate

SPEED = 0.05  # m/s
FEW = 8
CALM_CUT = 0.5  # friction excites that mode, the more the longer the blade is in contact: at 0.25 it still grows


@dataclass(frozen=True)
class CuttingSettings:
    """Numerical choices of a simulated cut.

    Attributes:
        h: size of the elements along the path, m; None: the half thickness of the blade, and at least `FEW` along
            it.
        growth: of elements away from the path, from one to the next.
        reach: of the path that is simulated, m; the whole by default.
        rounding: radius of the shoulder, m; None: what elements of this size can feel (`seam.shoulder`).
        damping: mass damping, 1/s; None: `CALM_CUT` of the lowest shear frequency of a half, pi/2 c_s / W.
        strongest: strength that the faces' stiffness must allow, over the start's.
    """

    h: float | None = None
    growth: float = 1.25
    reach: float | None = None
    rounding: float | None = None
    damping: float | None = None
    strongest: float = 3.0

    def finer(self, path: Path, factor: float = 2.0) -> "CuttingSettings":
        """Smaller elements."""
        return replace(self, h=element_size(self, path) / factor)


class Slice(NamedTuple):
    """A scene made ready for many values, the stations of its faces, the way that the blade goes in each frame, and
    the run's time over the record's while the blade moves (relaxation times shrink by it)."""

    scene: Scene
    at: Float[Given, " P"]
    pace: Float[Given, " P"]
    elapsed: Float[Given, " P"]
    width: float
    pathtime: Float[Given, " n"]
    runtime: Float[Given, " n"]
    heading: Float[Given, " m"]
    faster: float


class Ran(eqx.Module):
    """A simulated cut: force per depth and depth at the path's times, failure code, worst error of the balance."""

    force: Float[Array, " n"]
    failed: Array
    element: Array
    imbalance: Array
    parted: Array


def element_size(settings: CuttingSettings, path: Path) -> float:
    """Size of the elements along the path, m."""
    return settings.h or float(min(0.5 * path.thickness, path.length / FEW))


def prepare(model: Model, values: Constants, density: float, path: Path, settings: CuttingSettings) -> Slice:
    """The slice that `run_slice` simulates.

    Raises:
        InputError: no cohesive law or volumetric energy in the model; see `tled.seam` for blade and faces.
    """
    law, volumetric = model.cohesion, model.volumetric
    if law is None or volumetric is None:
        raise InputError("a cut needs a cohesive law and a volumetric energy in its model, e.g. bilinear and quadratic")
    h = element_size(settings, path)
    far = float(min(path.x.max(), settings.reach or np.inf))
    used = path.x <= far + 1e-12
    last = len(used) if used.all() else int(np.argmin(used))
    x = path.x[:last]
    half, thickness = float(path.half), float(path.thickness)
    length = min(float(path.length), far + 4 * thickness)
    made = plane_slice(round(length / h) * h, half, h, settings.growth)
    # the run's clock: same places in the same order, at SPEED; rests pass in no time
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(x)))])
    keep = np.concatenate([[True], np.diff(way) > 1e-9])
    runtime, end = way / SPEED, way[-1] / SPEED
    frames = max(20, int(np.ceil(way[-1] / (0.25 * h))))  # a turn of the blade takes less than an element
    times = (np.arange(frames) + 0.5) * end / frames
    damping = settings.damping
    if damping is None:
        shear = float(model.energy.initial_shear_modulus(under("energy", values)))
        damping = CALM_CUT * 0.5 * np.pi * np.sqrt(shear / density) / half
    scene = build.scene(
        made.geometry,
        build.Tissue(model.energy, volumetric, under("energy", values), under("volumetric", values), density),
        times,
        numerics=build.Numerics(mass_damping=damping, hourglass=seam.HOURGLASS),
        held=slice_held(np.asarray(made.geometry.points), half),
        joined=seam.pairs(made),
    )
    middle = np.asarray(made.geometry.points)[made.minus].mean(1)[:, 0]
    cohesive = under("cohesion", values)
    strong = cohesive | {"strength": cohesive["strength"] * settings.strongest}
    faces = len(middle)
    scene = seam.joined(scene, made, law, strong, notch=(middle < path.notch).astype(float))
    slope = float(np.tan(path.angle / 2))
    blade = Wedge(thickness, slope, settings.rounding or seam.shoulder(thickness, slope, h))
    tip = np.stack([x[keep], np.zeros(keep.sum()), np.zeros(keep.sum())], 1)
    scene = seam.armed(scene, made, blade, runtime[keep], tip, friction=0.0)
    spread = {k: jnp.full(faces, float(v)) for k, v in cohesive.items()}
    scene = scene.put({"faces.values": spread})
    passing = np.maximum.accumulate(path.x)
    first = np.searchsorted(passing, middle).clip(0, len(path.x) - 1)
    begun = path.time[int((path.x > 0).argmax())]
    clock = np.interp(path.time, path.time[:last], runtime)
    heading = np.sign(np.diff(np.interp(SPEED * end * np.arange(frames + 1) / frames, way, x)))
    moving = float(np.sum(np.diff(path.time[:last])[np.diff(way) > 1e-9]))
    faster = end / max(moving, 1e-9)
    return Slice(scene, middle, path.speed[first], path.time[first] - begun, h, path.time, clock, heading, faster)


def run_slice(model: Model, values: Mapping[str, Array], ready: Slice, path: Path) -> Ran:
    """Force against the motion at the path's times, N. Pure JAX."""
    scene, faces = ready.scene, ready.scene.faces
    assert faces is not None  # on the path of the cut, and with them the run keeps its balance
    depth = jnp.interp(jnp.asarray(ready.at), jnp.asarray(path.front), jnp.asarray(path.depth))
    cut = met(model, values, path, ready.at, ready.pace, ready.elapsed, depth)
    fields = {**faces.values, "energy": cut.energy, "strength": cut.strength}
    changes = {
        "tissue.energy_values": {k: jnp.asarray(v, float) for k, v in under("energy", values).items()},
        "tissue.volumetric_values": {k: jnp.asarray(v, float) for k, v in under("volumetric", values).items()},
        "faces.values": fields,
        "probe.friction": cut.friction,
    }
    scene = scene.put(changes)
    for effect in model.ordered:
        p = under(f"effects.{effect.name}", values)
        if type(effect).energy is not Effect.energy:
            scene = scene.put({"tissue.added": (*scene.tissue.added, Added(effect, p))})
        scene = effect.scene(p, None, scene)
    if cut.compliance is not None:  # of the slice: the rig feels the force of all the depth
        share = jnp.max(jnp.asarray(path.depth)) / ready.width
        # along the cut alone: across it the faces are far stiffer than the rig, and the loop would not be stable
        scene = scene.put({"probe.compliance": cut.compliance * share * jnp.array([1.0, 0.0, 0.0])})
    if scene.tissue.prony is not None:
        scene = scene.put({"tissue.prony.tau": scene.tissue.prony.tau * ready.faster})
    out = simulate(scene)
    balance = out.balance
    assert balance is not None
    # what mass damping took is none of a slow cut's: there is nothing to shake there
    shaken = jnp.diff(balance.damping, prepend=0.0) / (SPEED * scene.clock.interval)
    force = (-out.force[:, 0] - jnp.asarray(ready.heading) * shaken) / ready.width
    at = jnp.interp(jnp.asarray(ready.runtime), out.time, force)
    deep = met(model, values, path, path.front, path.speed, path.time - path.time[0], path.depth).depth
    work = jnp.abs(balance.work)
    late = work > 0.05 * work[-1]
    poison = jnp.where(out.failed >= 0, jnp.nan, 0.0)
    worst = jnp.max(jnp.where(late, jnp.abs(balance.error), 0.0))
    return Ran(at * deep + poison, out.failed, out.element, worst, balance.area[-1] / ready.width)
