"""A probing scene: everything the explicit simulation needs, as one frozen tree of arrays and static choices.

A `Scene` is what an effect changes (`scene.put({"probe.friction": mu})`) and what `simulate.simulate` takes. Arrays,
parameters and time series are traced, so one compiled program serves every scene of the same shapes; energies, the
element and the counts of frames and steps are static. Each optional piece of physics is a slot that is either None
(absent: costs nothing) or holds values; at its neutral value (named below) a filled slot gives the result of the
empty one to the last bit, and its derivative there exists.

Lengths of the model: m, s, kg, N, Pa. Frame: z up, the support below, a probe presses along -z.
`build.scene` makes a Scene from a mesh, a material and a probe path, with step, penalty and contact patch chosen.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from tissuejax.arrays import Given
from tissuejax.elements.element import Element
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Volumetric
from tissuejax.errors import InputError, unknown
from tissuejax.parameters import Constants
from tissuejax.tled.faces import Faces
from tissuejax.tled.history import Damage, Prony
from tissuejax.tled.shapes import Shape

Content = TypeVar("Content")


def filled(slot: Content | None) -> Content:
    """The content of a slot that is filled in every scene that comes here, as the caller has made sure."""
    assert slot is not None, "an empty slot"
    return slot


class Body(eqx.Module):
    """The mesh in its stress-free shape, its support nodes and its surface.

    Attributes:
        points: stress-free node positions, m.
        cells: nodes of each element, meshio order.
        fixed: nodes held by the support.
        held: 1 where a fixed node is held along an axis, 0 where it is free to move.
        facets: nodes of the boundary facets (for the capsule), outward.
        element: the element type.
        settled: displacement at time zero (prestress: the settled shape under gravity); None is the stress-free shape.
    """

    points: Float[Given, "N 3"]
    cells: Int[Given, "E k"]
    fixed: Int[Given, " F"]
    held: Float[Given, "F 3"]
    facets: Int[Given, "S v"]
    element: Element = eqx.field(static=True)
    settled: Float[Given, "N 3"] | None = None


class Tissue(eqx.Module):
    """Material.

    Attributes:
        energy, volumetric: static; their parameters by name in `energy_values`, `volumetric_values`.
        density: kg/m^3.
        stiffness: factor on the whole strain energy of each element; neutral 1.
        added: further energies, callables `Strain -> psi (E,)` (eqx.Modules whose leaves are traced), e.g. a fibre
            family; neutral: amplitude 0.
        prony: relaxing part of the isochoric stress; neutral g = 0.
        drain: relaxing part of the volumetric stress (fluid that leaves; hexes only); neutral g = 0.
        damage: softening by the greatest energy so far; neutral amount 0.
        capsule: shear modulus times thickness of a membrane on all boundary facets, N/m; neutral 0.
    """

    energy: Energy = eqx.field(static=True)
    volumetric: Volumetric = eqx.field(static=True)
    energy_values: Constants
    volumetric_values: Constants
    density: Float[Given, ""]
    stiffness: Float[Given, " E"] | None = None
    added: tuple[Any, ...] = ()
    prony: Prony | None = None
    drain: Prony | None = None
    damage: Damage | None = None
    capsule: Float[Given, ""] | None = None


class Probe(eqx.Module):
    """A rigid probe that follows a path, and its contact with the tissue.

    Attributes:
        time, position: path of the probe's reference point (centre of a ball), real time; held before and after.
        shape: its surface by signed distance.
        patch: nodes of the facets it may touch.
        area: reference area of each quadrature point of the patch, m^2 (0 for padding).
        mass: static extra mass of the patch's nodes, kg, (N,), so that the penalty never limits the step.
        penalty: pressure per penetration, Pa/m.
        softness: length over which contact sets in, m (softplus).
        friction: Coulomb coefficient; neutral 0.
        give: tangential way a sticking point moves per traction before it slides, m/Pa, beside the penalty's own.
        adhesion: greatest pull at separation, Pa; neutral 0.
        reach: gap at which the pull is greatest, m; bonds are gone at five times that.
        offset: shift of the whole path (mounting), m; neutral 0.
        compliance: of the machine: the probe gives way by compliance * force, m/N, one number or one an axis;
            neutral 0.
    """

    time: Float[Given, " n"]
    position: Float[Given, "n 3"]
    shape: Shape
    patch: Int[Given, "P v"]
    area: Float[Given, "q P"]
    mass: Float[Given, " N"]
    penalty: Float[Given, ""]
    softness: Float[Given, ""]
    friction: Float[Given, ""] | None = None
    give: Float[Given, ""] = 0.0
    adhesion: Float[Given, ""] | None = None
    reach: Float[Given, ""] = 2e-4
    offset: Float[Given, " 3"] | None = None
    compliance: Float[Given, ""] | None = None


class Support(eqx.Module):
    """What the fixed nodes do: u = displacement(t) * pattern + slip.

    Attributes:
        time, displacement: motion of the support, real time, m; None is at rest.
        pattern: factor on the motion by node and axis; None is 1 everywhere.
        compliance: of a tangential bedding: slip per traction, m/Pa; neutral 0 (bonded).
        fluidity: viscous slip: rate of slip per traction, m/(s Pa); neutral 0 (bonded). Neither has a Coulomb limit.
    """

    time: Float[Given, " n"] | None = None
    displacement: Float[Given, "n 3"] | None = None
    pattern: Float[Given, "F 3"] | None = None
    compliance: Float[Given, ""] | None = None
    fluidity: Float[Given, ""] | None = None


class Markers(eqx.Module):
    """Points of the surface: position = rest + sum_v weights u[nodes]."""

    nodes: Int[Given, "K v"]
    weights: Float[Given, "K v"]
    rest: Float[Given, "K 3"]


class Clock(eqx.Module):
    """When is simulated and how finely.

    Frame k covers real time start + k * interval to start + (k + 1) * interval in `steps` steps; force, torque and
    reaction are means over a frame (time of its middle), markers are taken at its end. `compression` f runs the probe,
    the support and every relaxation f times as fast, which is right as long as inertia does not matter.

    With `needed`, blocks of frames from that number on are left out and their series are zero: recordings of unlike
    length share one program, and a short one does not pay for a long one.
    """

    start: Float[Given, ""]
    interval: Float[Given, ""]
    compression: Float[Given, ""]
    frames: int = eqx.field(static=True)
    steps: int = eqx.field(static=True)
    needed: Int[Given, ""] | None = None

    @property
    def step(self) -> Float[Array, ""]:
        """Time step of the integrator, s (simulated clock)."""
        return self.interval / self.compression / self.steps

    @property
    def middles(self) -> Float[Array, " frames"]:
        """Real time of the middle of each frame, s."""
        return self.start + self.interval * (jnp.arange(self.frames) + 0.5)

    @property
    def ends(self) -> Float[Array, " frames"]:
        """Real time of the end of each frame, s."""
        return self.start + self.interval * (jnp.arange(self.frames) + 1.0)


class Settings(eqx.Module):
    """Numerical settings.

    Attributes:
        hourglass: hourglass stiffness in units of the shear modulus.
        mass_damping: a in f = -a m v, 1/s on the simulated clock.
        stiffness_damping: internal forces are taken at u + beta v, s on the simulated clock; damps the pressure waves
            that make forward tangents ring though the run is quiet.
        memory: bytes that a reverse pass may use for stored states before it recomputes blocks of frames.
    """

    hourglass: Float[Given, ""]
    mass_damping: Float[Given, ""]
    stiffness_damping: Float[Given, ""]
    memory: int = eqx.field(static=True, default=64 * 2**20)


class Scene(eqx.Module):
    """The whole set-up; see the parts. `gravity` (m/s^2) acts on the mass of the tissue; None is none.

    `faces` holds the two sides of a split body together; with them the run keeps its energy balance. `loads`
    (`loads.Loads`) are nodal forces, tractions and pressures; neutral factor 0.
    """

    body: Body
    tissue: Tissue
    clock: Clock
    settings: Settings
    support: Support
    probe: Probe | None = None
    markers: Markers | None = None
    gravity: Float[Given, " 3"] | None = None
    faces: Faces | None = None
    loads: Any = None  # loads.Loads, one floor up

    def put(self, changes: Mapping[str, Any]) -> "Scene":
        """A copy with slots replaced, by dotted path: `scene.put({"tissue.stiffness": s, "probe.friction": 0.2})`.

        Raises:
            InputError: an unknown part or slot (the nearest are offered).
        """
        scene = self
        for path, value in changes.items():
            scene = _put(scene, path.split("."), value, path)
        return scene

    @property
    def pressed(self) -> Probe:
        """The probe of a scene that has one: a probing's effects act on it.

        Raises:
            InputError: nothing touches this tissue.
        """
        if self.probe is None:
            raise InputError("this scene has no probe: effects of a probing need one")
        return self.probe

    @property
    def stiffness(self) -> Float[Array, " E"]:
        """Stiffness factor of each element, ones if the slot is empty."""
        given = self.tissue.stiffness
        return jnp.ones(len(self.body.cells), self.body.points.dtype) if given is None else given

    def cast(self, dtype: Any) -> "Scene":
        """All floating-point leaves in one precision."""

        def one(x):
            return jnp.asarray(x, dtype) if jnp.issubdtype(jnp.result_type(x), jnp.inexact) else x

        return jax.tree.map(one, self)


def _put(part: Any, keys: list[str], value: Any, path: str) -> Any:
    if isinstance(part, Mapping):
        return {**part, keys[0]: value}
    if keys[0] not in _names(part):
        raise unknown("slot of a scene", path, _paths(part, path[: -len(".".join(keys))]))
    if len(keys) > 1:
        value = _put(getattr(part, keys[0]), keys[1:], value, path)
    return dataclasses.replace(part, **{keys[0]: value})


def _names(part: Any) -> list[str]:
    return [f.name for f in dataclasses.fields(part)] if dataclasses.is_dataclass(part) else []


def _paths(part: Any, prefix: str) -> list[str]:
    return [prefix + name for name in _names(part) or ["(none)"]]
