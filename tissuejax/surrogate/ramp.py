"""The states of one site: static equilibria of the full model while the ball goes down, in small steps.

Each step starts from the last two equilibria, drawn on; large steps burst. Gravity acts from the start: the organ is
settled before it is touched, and displacements are counted from there.
"""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.effects.probing_test import ProbingTest
from tissuejax.elements.hex8 import Hex8, straight
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import NotConverged
from tissuejax.experiments.probing import assembled
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.experiments.probing_setup import DENSITY, Setup
from tissuejax.mesh.columns import Lobe
from tissuejax.mesh.facets import boundary
from tissuejax.mesh.quality import cell_volumes
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.recordings.recording import Geometry
from tissuejax.surrogate.site_mesh import Grid, geometry, topology
from tissuejax.tled import build, internal, statics
from tissuejax.tled import contact as touching
from tissuejax.tled.scene import Body, Clock, Scene, Settings, Support, Tissue
from tissuejax.tled.shapes import Sphere
from tissuejax.tled.simulate import COMPILER_OPTIONS

STEP = 6e-4  # m between two equilibria; 1.5 mm was seen to burst
TOLERANCE = 2e-6  # of the greatest force: 0.01 % of the probe's
FIRST = 0.05  # of a step is the first one, from a surface that is not yet touched
MOST_STEPS = 20_000


class Matter(NamedTuple):
    """What is tabulated: the model with its values, the organ, the ball, and the numerical choices."""

    model: Model
    values: Mapping[str, float]
    lobe: Lobe
    radius: float
    density: float | None = None
    settings: ProbingSettings = ProbingSettings()


class Ramp(NamedTuple):
    """One site at its depths.

    Attributes:
        place: in plan, m. depth: below first contact, m.
        force: of the tissue on the ball, N. displacement: of the nodes from the settled shape, m.
        rest: nodes of the settled shape, m.
        slip: sum of the normal contact forces times the surface's stretch along the way, over the vertical force: how
            much more friction takes than the coefficient times that force.
        strain, stress: Green strain and isochoric second Piola-Kirchhoff stress at element centres, beyond those of
            the settled shape (xx, yy, zz, xy, xz, yz), Pa; empty where not wanted.
    """

    place: Float[np.ndarray, "2"]
    depth: Float[np.ndarray, " k"]
    force: Float[np.ndarray, "k 3"]
    displacement: Float[np.ndarray, "k N 3"]
    rest: Float[np.ndarray, "N 3"]
    slip: Float[np.ndarray, " k"]
    strain: Float[np.ndarray, "k E 6"]
    stress: Float[np.ndarray, "k E 6"]


def bare_setup(matter: Matter, body: Geometry, patch, place, height: float) -> Setup:
    """A probing made ready without a recording: the ball above `place`, its centre at `height`, m."""
    model, values, settings = matter.model, matter.values, matter.settings
    density = matter.density or DENSITY
    volumetric = model.volumetric if model.volumetric is not None else Quadratic()
    bulk = under("volumetric", values) or {p.name: p.default for p in volumetric.parameters}
    facets = boundary(body.cells, body.cell_type)
    held = np.ones((len(body.fixed), 3))
    kind = Hex8(straight(body.points, body.cells)) if body.cell_type == "hexahedron" else build.element(body.cell_type)
    floats = lambda given: {k: jnp.asarray(v, float) for k, v in given.items()}  # noqa: E731
    bare = Scene(
        Body(jnp.asarray(body.points), jnp.asarray(body.cells), jnp.asarray(body.fixed), held, facets.nodes, kind),
        Tissue(model.energy, volumetric, floats(under("energy", values)), floats(bulk), np.asarray(density, float)),
        Clock(np.asarray(0.0), np.asarray(1e-3), np.asarray(1.0), 1, 1),
        Settings(np.asarray(settings.hourglass), np.asarray(0.0), np.asarray(settings.stiffness_damping)),
        Support(),
    )
    bare = bare.put({"clock.steps": build.steps(bare, None)})
    above = np.array([*place, height + 1e-3])
    probe = build.probe(
        bare, Sphere(np.asarray(matter.radius)), [0.0, 1.0], [above, above], patch, settings.penalty, settings.softness
    )
    volumes = cell_volumes(body.points, body.cells, body.cell_type)
    top = float(body.points[:, 2].max())
    upper = np.full(len(body.points), top)
    test = ProbingTest(
        start=np.asarray(0.0), centres=body.points[body.cells].mean(1), mass=density * volumes / body.cells.shape[1],
        below_top=np.maximum(upper - body.points[:, 2], 0.0), height=np.asarray(top),
        first_touch=np.asarray(0.0), rest=np.zeros((0, 3)),
    )  # fmt: skip
    damping = np.asarray(settings.damping * np.pi / 2 / top / np.sqrt(density))
    return Setup(
        eqx.tree_at(lambda s: s.probe, bare, probe, is_leaf=lambda x: x is None),
        test,
        np.zeros(0),
        np.zeros(0),
        np.zeros(1),
        damping,
    )


def scene_at(matter: Matter, grid: Grid, place, height: float, whole: bool = False) -> Scene:
    """The scene of a site with every effect of the model in it, its ball where the mesh expects it.

    The relaxing part of the stress is taken out: what is tabulated is instantaneous. A mounting offset is taken out
    too, since the table goes over true places. `whole` leaves everything in.
    """
    body = geometry(matter.lobe, place, grid)
    setup = bare_setup(matter, body, topology(grid)[2], place, height)
    scene, _ = assembled(matter.model, {k: jnp.asarray(float(v)) for k, v in matter.values.items()}, setup)
    if whole:
        return scene
    return scene.put({"tissue.prony": None, "probe.offset": None, "probe.mass": setup.scene.probe.mass})


@eqx.filter_jit
def _fields(scene: Scene, u: Float[Array, "N 3"]):
    mesh = internal.mesh(scene)
    F, _ = scene.body.element.gradient(mesh.reference, internal.take(u.T, mesh.cells))
    C = internal.cauchy_green(F)
    _, S = internal.isochoric(scene, mesh, C)
    E = [(c - d) / 2 for c, d in zip(C, (1, 1, 1, 0, 0, 0))]
    count = len(scene.body.cells)
    return jnp.stack(E, -1)[:count], jnp.stack(S, -1)[:count]


@jax.jit
def slip(scene: Scene, u: Float[Array, "N 3"], centre: Float[Array, "3"]) -> Float[Array, ""]:
    """sum_i f_i (|F_i e_x| + |F_i e_y|) / 2 over the contact's vertical force on the ball; F_i maps the surface."""
    patch = touching.patch(scene)
    shape, _ = touching.quadrature(4)
    gap, normal = scene.probe.shape.distance(touching.places(patch, u.T, centre, shape))
    probe = scene.probe
    f = probe.penalty * probe.softness * jax.nn.softplus(-gap / probe.softness) * probe.area
    place = np.polynomial.legendre.leggauss(3)[0]
    a, b = (g.ravel() for g in np.meshgrid(place, place))
    slopes = (
        np.stack([-(1 - b), 1 - b, 1 + b, -(1 + b)], -1) / 4,
        np.stack([-(1 - a), -(1 + a), 1 + a, 1 - a], -1) / 4,
    )
    deformed = patch.x + u.T[:, patch.nodes]
    before = jnp.stack([jnp.einsum("qv,ivp->qpi", w, patch.x[:2]) for w in slopes], -1)
    after = jnp.stack([jnp.einsum("qv,ivp->qpi", w, deformed) for w in slopes], -1)
    stretch = jnp.linalg.norm(after @ jnp.linalg.inv(before), axis=-2).mean(-1)
    return jnp.sum(f * stretch) / jnp.maximum(-jnp.sum(f * normal[2]), 1e-300)


_equilibrium = jax.jit(statics.equilibrium, compiler_options=COMPILER_OPTIONS, static_argnames=("most",))


def ramp(
    matter: Matter, grid: Grid, place, contact: float, depths: Float[np.ndarray, " k"], fields: bool = False
) -> Ramp:
    """The equilibria of one site.

    Args:
        contact: height of the ball's centre at first contact, m.
        depths: increasing, m.
        fields: whether stress and strain are wanted.

    Raises:
        NotConverged: no equilibrium at some depth, also in smaller steps.
    """
    place, depths = np.asarray(place, float), np.asarray(depths, float)
    scene = scene_at(matter, grid, place, contact).cast(jnp.float64)
    settled = internal.settled(scene).T
    rest = np.asarray(scene.body.points + settled)
    zero = _fields(scene, settled) if fields else None
    force, displacement, slips, strain, stress = [], [], [], [], []
    last, before, at, earlier = settled, settled, 0.0, -1.0
    for depth in depths:
        count = max(1, int(np.ceil((depth - at) / STEP - 1e-9)))
        for target in at + (depth - at) * np.arange(1, count + 1) / count:
            found = None
            for share in (1.0, 0.0):
                guess = last + share * (last - before) * ((target - at) / (at - earlier) if at > 0 else 0.0)
                found = _solve(scene, place, contact - target, guess)
                if bool(jnp.isfinite(found.displacement).all()):
                    break
            else:
                x, y = 1e3 * place
                raise NotConverged(
                    f"no equilibrium at place ({x:.1f}, {y:.1f}) mm, depth {1e3 * target:.2f} mm (residual "
                    f"{float(found.residual):.1e}); take a smaller --depth, or a stiffer or less compressible model"
                )
            before, last, earlier, at = last, found.displacement, at, target
        force.append(np.asarray(found.force))
        displacement.append(np.asarray(last - settled))
        slips.append(float(slip(scene, last, jnp.asarray([*place, contact - depth]))))
        if fields:
            E, S = _fields(scene, last)
            strain.append(np.asarray(E - zero[0]))
            stress.append(np.asarray(S - zero[1]))
    none = np.zeros((len(depths), 0, 6))
    return Ramp(
        place, depths, np.array(force), np.array(displacement), rest, np.array(slips),
        np.array(strain) if fields else none, np.array(stress) if fields else none,
    )  # fmt: skip


def _solve(scene: Scene, place, height: float, guess):
    position = jnp.asarray(np.tile([*place, height], (2, 1)))
    return _equilibrium(scene.put({"probe.position": position, "body.settled": guess}), 0.0, TOLERANCE, MOST_STEPS, 2.5)
