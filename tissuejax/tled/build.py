"""From a mesh, a material and a probe path to a `Scene`: the choices that are made once, on the host.

Step: `SAFETY` times the critical step at the given parameters (give the stiffest ones that a fit may visit), and no
longer than the tissue allows once the probe has pressed it (`pressed`). Penalty: see `automatic_penalty`. Patch: facets
that the probe can come near. What can't work is refused here, once, with a sentence.
"""

import math
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tissuejax import elements
from tissuejax.elements.hex8 import Hex8, straight
from tissuejax.elements.hex8_bending import Hex8Bending
from tissuejax.errors import InputError
from tissuejax.families import lookup, members
from tissuejax.mesh.facets import area_vectors, boundary
from tissuejax.mesh.quality import refuse_bad
from tissuejax.parameters import Constants
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import pressed
from tissuejax.tled.contact import quadrature
from tissuejax.tled.scene import Body, Clock, Markers, Probe, Scene, Settings, Support, Tissue
from tissuejax.tled.shapes import Hemisphere, Platen, Punch, Shape, Sphere
from tissuejax.tled.stable import critical_steps

SAFETY = 0.7
SQUEEZED = 0.9  # the same for elements as short as the probe will make them: few are, and waves need several
YIELD = 500.0  # a pressure of one shear modulus pushes the surface into the probe by at most its radius over this
ONSET = 0.1  # softness of contact over that penetration
PATCH = 16  # patches are padded to a multiple of this, so that scenes of one mesh share a program


def element(cell_type: str):
    """The element of a name: a meshio cell type, or one that shares its cells ("hexahedron-bending").

    Raises:
        InputError: no such element; the known ones are offered.
    """
    from tissuejax.elements.element import Element

    return lookup("element", cell_type, members(elements, Element))()


@dataclass(frozen=True)
class ProbePath:
    """A probe and the way it goes.

    Attributes:
        time: s; position: m; straight between.
        shape: of the tip; a number is the radius of a ball, m.
    """

    time: Float[np.ndarray, " m"]
    position: Float[np.ndarray, "m 3"]
    shape: Shape | float


@dataclass(frozen=True)
class Numerics:
    """How a scene is computed; what is None is chosen.

    Attributes:
        step: s on the simulated clock; None is `SAFETY` times the critical one, less where the probe goes deep.
        compression: factor f by which slow motion is run faster.
        penalty: Pa/m; None is automatic. softness: m; None is a tenth of the penetration (`automatic_penalty`).
        patch: nodes of the facets that may touch (automatic).
        hourglass: in units of the shear modulus; None is the element's own (0.3 for the plain hex; 0.1 to 0.5).
        mass_damping: 1/s; None is half the lowest shear frequency pi/2 c_s / height.
        stiffness_damping: beta, s; 5e-5 s for forward tangents of slow runs.
        element: None is the plain one for the cells; "hexahedron-bending" where elements are long or bend.
    """

    step: float | None = None
    compression: float = 1.0
    penalty: float | None = None
    softness: float | None = None
    patch: Float[np.ndarray, "P v"] | None = None
    hourglass: float | None = None
    mass_damping: float | None = None
    stiffness_damping: float = 0.0
    element: str | None = None


def scene(
    geometry: Geometry,
    tissue: Tissue,
    times: Float[np.ndarray, " n"],
    probe_path: ProbePath | None = None,
    numerics: Numerics | None = None,
    *,
    gravity: tuple[float, float, float] | None = None,
    markers: Markers | None = None,
    held: Float[np.ndarray, "F 3"] | None = None,
    joined: Int[np.ndarray, "J 2"] | None = None,
    settled: Float[np.ndarray, "N 3"] | None = None,
) -> Scene:
    """A scene with every optional slot empty.

    Args:
        geometry: stress-free mesh (m), support nodes in `fixed`.
        tissue: energies, their values by their own names (`C10`, `K`), density (kg/m^3).
        times: uniform output times (middles of the frames), real time, s.
        probe_path: None for no probe.
        gravity: m/s^2. markers: points to follow. held: which axes of the fixed nodes are held (all).
        joined: pairs of nodes that cohesive faces hold together, so that both halves count as one body.
        settled: displacement at time zero, m, for example under gravity: where the probe finds the tissue.

    Raises:
        InputError: a bad mesh, a step above the critical one, a probe that starts inside the tissue or never comes
            near, output times that are not uniform, a radius or other values that are not positive.
    """
    numerics = numerics or Numerics()
    refuse_bad(geometry, joined=joined)
    times = np.asarray(times, float)
    interval = _interval(times)
    density = float(tissue.density)
    if not density > 0:
        raise InputError(f"density {density} kg/m^3: mass is needed by the explicit solver; tissue has about 1000")
    tissue = replace(
        tissue,
        energy_values=_floats(tissue.energy_values),
        volumetric_values=_floats(tissue.volumetric_values),
        density=jnp.asarray(density),
    )
    facets = boundary(geometry.cells, geometry.cell_type)
    made = _element(geometry, numerics.element, tissue)
    body = Body(
        jnp.asarray(geometry.points), jnp.asarray(geometry.cells, jnp.int32), jnp.asarray(geometry.fixed, jnp.int32),
        jnp.ones((len(geometry.fixed), 3)) if held is None else jnp.asarray(held, float),
        jnp.asarray(facets.nodes, jnp.int32), made,
        None if settled is None else jnp.asarray(settled, float),
    )  # fmt: skip
    hourglass = made.natural_hourglass if numerics.hourglass is None else numerics.hourglass
    damping = numerics.mass_damping
    if damping is None:
        height = float(np.ptp(np.asarray(geometry.points)[:, 2]))
        speed = math.sqrt(float(tissue.energy.initial_shear_modulus(tissue.energy_values)) / density)
        damping = 0.5 * (math.pi / 2) * speed / height
    began, numbers = times[0] - interval / 2, (hourglass, damping, numerics.stiffness_damping)
    settings = Settings(*_scalars(*numbers))
    clock = Clock(*_scalars(began, interval, numerics.compression), len(times), 1)
    g = None if gravity is None else jnp.asarray(gravity, float)
    bare = Scene(body, tissue, clock, settings, Support(), None, markers, g)
    if probe_path is None:
        return bare.put({"clock.steps": steps(bare, numerics.step)})
    shape, position = _shape(probe_path.shape), probe_path.position
    bare = bare.put({"clock.steps": steps(bare, numerics.step, shape, position)})
    patch = numerics.patch
    if patch is None:
        patch = _patch(facets.nodes, _now(bare), geometry.fixed, shape, position)
    facets = np.asarray(patch)
    made = probe(bare, shape, probe_path.time, position, facets, numerics.penalty, numerics.softness)
    return bare.put({"probe": made})


def steps(
    bare: Scene, step: float | None, shape: Shape | None = None, position: Float[np.ndarray, "n 3"] | None = None
) -> int:
    """Steps a frame: the given step, or the greatest that is safe, also where a probe of that `shape` will have pressed
    the tissue on its way through `position` (n, 3).

    Raises:
        InputError: a step above the critical one.
    """
    bounds = np.asarray(critical_steps(bare))
    critical = float(bounds.min())
    if step is not None and step > critical:
        raise InputError(
            f"step {step * 1e3:.4g} ms: the critical step is {critical * 1e3:.4g} ms (element {int(bounds.argmin())}); "
            "take a smaller step, less stiffness damping, or leave it to the program"
        )
    if step is None:
        step = SAFETY * critical
        if shape is not None and position is not None:
            points = _now(bare)
            stretch = pressed.spread(bare, pressed.shortest_stretch(points, shape, position))
            under = bounds[pressed.near(points, bare.body.cells, shape, position)].min()
            step = min(step, SQUEEZED * float(under) / pressed.quickening(bare, stretch))
    return max(1, math.ceil(float(bare.clock.interval / bare.clock.compression) / step - 1e-9))


def probe(bare: Scene, shape: Shape, time, position, facets, penalty=None, softness=None, rule: int = 0) -> Probe:
    """The probe over its contact patch, with penalty, softness and the static mass of the patch chosen.

    Args:
        rule: contact points of a quadrilateral (`contact.quadrature`).
    """
    time, position = np.asarray(time, float), np.asarray(position, float)
    points = np.asarray(bare.body.points)
    if penalty is None:
        penalty = automatic_penalty(bare, shape, facets, position)
    if softness is None:
        softness = ONSET * _shear_modulus(bare) / penalty
    area = _areas(points, facets, rule)
    weights, _ = quadrature(facets.shape[1], rule)
    nodal = np.zeros(len(points))
    np.add.at(nodal, facets.T, np.einsum("qv,qp->vp", weights, area))
    mass = penalty * nodal * float(bare.clock.step) ** 2 / 4
    spare = -len(facets) % PATCH
    facets = np.concatenate([facets, np.repeat(facets[-1:], spare, 0)])
    area = np.concatenate([area, np.zeros((len(area), spare))], 1)
    made = Probe(
        jnp.asarray(time), jnp.asarray(position), shape, jnp.asarray(facets, jnp.int32), jnp.asarray(area),
        jnp.asarray(mass), jnp.asarray(float(penalty)), jnp.asarray(float(softness)),
    )  # fmt: skip
    _refuse_inside(made, _now(bare), float(bare.clock.start))
    return made


def automatic_penalty(bare: Scene, shape: Shape, facets, position=None) -> float:
    """Pressure per penetration, Pa/m: mu / min(h^2 / (4 R), R / YIELD), mu the shear modulus, h the finest facets.

    Along a path through `position`, mu is that of the tissue as it is compressed where the path is deepest
    (`pressed.stiffening`): the modulus at rest for laws that do not stiffen under compression.

    The pressure under a probe is of the order of mu. A facet of size h is flat where the probe, of radius R, curves by
    h^2 / (4 R) from its corners to its middle. A penalty that allows less penetration than that holds nine points of a
    flat facet off a round probe, and the force comes out too high; one that allows more than some thousandths of R
    makes it too low. So penetration is the sag of the facets on fine meshes, where both errors fall with h^2, and a
    500th of R on coarse ones. A flat platen has no sag: a 500th of the facet size.
    """
    shear, points, reach = _shear_modulus(bare), np.asarray(bare.body.points), float(shape.reach())
    if not shear > 0:
        raise InputError(f"shear modulus at rest {shear:.4g} Pa: no penalty follows from it; give `penalty` in Pa/m")
    size = math.sqrt(np.quantile(np.linalg.norm(area_vectors(points, facets), axis=1), 0.1))
    allowed = min(size**2 / (4 * reach), reach / YIELD) if math.isfinite(reach) else size / YIELD
    if position is not None:
        shear *= pressed.stiffening(bare, pressed.typical_stretch(_now(bare), shape, position))
    return shear / allowed


def _shear_modulus(bare: Scene) -> float:
    return float(bare.tissue.energy.initial_shear_modulus(bare.tissue.energy_values))


def _element(geometry: Geometry, name: str | None, tissue: Tissue):
    made = element(geometry.cell_type if name is None else name)
    if made.cells != geometry.cell_type:
        raise InputError(f"element {name!r} has cells of type {made.cells!r}, but the mesh {geometry.cell_type!r}")
    if isinstance(made, Hex8):
        return Hex8(straight(geometry.points, geometry.cells))
    if isinstance(made, Hex8Bending):
        bulk = float(tissue.volumetric.bulk_modulus(tissue.volumetric_values))
        shear = float(tissue.energy.initial_shear_modulus(tissue.energy_values))
        poisson = (3 * bulk - 2 * shear) / (2 * (3 * bulk + shear))
        return Hex8Bending(round(min(max(poisson, 0.0), 0.5), 2))
    return made


def _floats(values: Constants) -> dict[str, Array]:
    return {name: jnp.asarray(value, float) for name, value in values.items()}


def _scalars(a: float, b: float, c: float) -> tuple[Array, Array, Array]:
    return jnp.asarray(float(a)), jnp.asarray(float(b)), jnp.asarray(float(c))


def _interval(times):
    gaps = np.diff(times)
    if len(times) < 2 or not (gaps > 0).all() or np.ptp(gaps) > 1e-3 * gaps.mean():
        raise InputError(
            f"output times: {len(times)} values with gaps from {gaps.min() if len(gaps) else 0:.3g} to "
            f"{gaps.max() if len(gaps) else 0:.3g} s; at least two uniform, increasing times are needed (take a "
            "uniform grid and `sample` the result at the sensor's own times)"
        )
    return (times[-1] - times[0]) / (len(times) - 1)


def _shape(shape: Shape | float) -> Shape:
    if isinstance(shape, Shape):
        return shape
    if shape is None or not shape > 0:
        raise InputError(f"probe radius {shape}: a spherical tip needs its radius in m, for example 0.00475")
    return Sphere(jnp.asarray(float(shape)))


def _distance(shape, x):
    gap, _ = shape.distance(tuple(jnp.asarray(x[..., i]) for i in range(3)))
    return np.asarray(gap)


def _now(bare: Scene) -> np.ndarray:
    """Where the nodes are when the clock starts."""
    points, settled = np.asarray(bare.body.points), bare.body.settled
    return points if settled is None else points + np.asarray(settled)


def _patch(nodes, points, fixed, shape, position):
    """Facets some node of which comes within half a radius and a facet of the probe's path."""
    free = ~np.isin(nodes, fixed).all(1)
    vectors = area_vectors(points, nodes)
    if isinstance(shape, Platen):
        keep = free & (vectors[:, 2] > 0.2 * np.linalg.norm(vectors, axis=1))
        return nodes[keep]
    size = math.sqrt(np.linalg.norm(vectors, axis=1).mean())
    some = np.asarray(position)[:: max(1, len(position) // 200)]
    some = np.concatenate([some, np.asarray(position)[np.argmin(np.asarray(position)[:, 2])][None]])
    nearest = np.min([_distance(shape, points - c) for c in some], axis=0)
    keep = free & (nearest[nodes].min(1) < 0.5 * float(shape.reach()) + size)
    if not keep.any():
        raise InputError(
            f"the probe stays {1e3 * nearest.min():.1f} mm or more off the tissue; check frame, units and registration"
        )
    return nodes[keep]


def _areas(points, facets, count=0):
    """Reference area of each contact point, (q, P)."""
    _, weight = quadrature(facets.shape[1], count)
    x = points[facets]
    if facets.shape[1] == 3:
        return weight[:, None] * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    place = np.polynomial.legendre.leggauss(3)[0]
    a, b = (g.ravel() for g in np.meshgrid(place, [0.0] if count == 3 else place))
    da = np.stack([-(1 - b), 1 - b, 1 + b, -(1 + b)], -1) / 4
    db = np.stack([-(1 - a), -(1 + a), 1 + a, 1 - a], -1) / 4
    normal = np.cross(np.einsum("qv,pvi->qpi", da, x), np.einsum("qv,pvi->qpi", db, x))
    return weight[:, None] * np.linalg.norm(normal, axis=-1)


def _refuse_inside(made: Probe, points, start):
    position = np.array([np.interp(start, made.time, made.position[:, i]) for i in range(3)])
    weights, _ = quadrature(made.patch.shape[1], len(made.area))
    x = np.einsum("qv,pvi->qpi", weights, points[np.asarray(made.patch)])
    deep = -_distance(made.shape, x - position).min()
    reach = float(made.shape.reach())
    if deep > max(20 * float(made.softness), 0.02 * reach if math.isfinite(reach) else 0.0):
        raise InputError(
            f"the probe starts {1e3 * deep:.2f} mm inside the tissue at t = {start:.4g} s; start the path out of "
            "contact, or check mesh, offset and units"
        )


__all__ = [
    "Hemisphere", "Numerics", "Platen", "ProbePath", "Punch", "Sphere", "Tissue", "element", "probe", "scene", "steps",
]  # fmt: skip
