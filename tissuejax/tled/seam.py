"""From a split mesh, a law and a blade to a cutting scene: stiffness, static mass and penalty, chosen once on the host.

Stiffness of unbroken faces: `STIFF` M / W, M the wave modulus and W the half thickness of the body across the cut, so
that the faces give way by a few per cent of the body; and no less than `LAW` tau^2 / G, so that softening begins at a
small part of the opening at which the law ends. Alone it would ask for steps of sqrt(rho h / K); static mass
K A dt^2 / 4 on the faces' nodes, K counting both sides, leaves the step as it was. Pushing the halves apart by the
blade's half thickness takes a pressure of about M b / (2 W): the penalty lets the blade sink in by a hundredth of b
then, and by a fiftieth under the strength of the faces, and it is stiffer than they are: a blade that sinks in where it
should part them opens nothing.
"""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.cohesion.law import Law
from tissuejax.errors import InputError
from tissuejax.mesh.facets import area_vectors, boundary
from tissuejax.mesh.split import Split
from tissuejax.parameters import Constants
from tissuejax.tled import build
from tissuejax.tled.blade import Wedge
from tissuejax.tled.faces import Faces, local, quadrature
from tissuejax.tled.scene import Scene
from tissuejax.tled.shapes import Shape
from tissuejax.tled.stable import wave_modulus

STIFF, LAW = 11.0, 4.0
LIPS = 1.5  # surface beside the cut that may touch the blade, in its thickness
UPRIGHT = 0.7  # a lip's normal goes along the cut (x, as the blade's) by at least this share
ARC, SHARP = 4.0, 0.2  # radius of a shoulder in facets, and at least in thicknesses
ALONG, BESIDE = 2, 3  # points of a face and of a blade's facet in a plane slice, in which nothing changes across it
PRESSED = 50.0  # penalty in M / W
HOURGLASS = 1.0  # in shear moduli: at 0.3 the corner where a blade enters soft tissue folds over in hourglass modes


def areas(points: Float[np.ndarray, "N 3"], nodes, rule: int = 0) -> Float[np.ndarray, "q P"]:
    """Reference area of each integration point of the faces, m^2; `rule`: see `faces.quadrature`."""
    x = np.asarray(points)[nodes]
    shape, weight = quadrature(nodes.shape[1], rule)
    if nodes.shape[1] == 3:
        return weight[:, None] * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    a, b = local(rule)
    da = np.stack([-(1 - b), 1 - b, 1 + b, -(1 + b)], -1) / 4
    db = np.stack([-(1 - a), -(1 + a), 1 + a, 1 - a], -1) / 4
    normal = np.cross(np.einsum("qv,pvi->qpi", da, x), np.einsum("qv,pvi->qpi", db, x))
    return weight[:, None] * np.linalg.norm(normal, axis=-1)


def half_width(split: Split) -> float:
    """Least extent of the body on either side of the cut, along its mean normal, m."""
    points = np.asarray(split.geometry.points)
    x = points[split.minus]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]).sum(0)
    off = (points - x.mean((0, 1))) @ (normal / np.linalg.norm(normal))
    return float(min(off.max(), -off.min()))


def stiffness(modulus: float, width: float, strength: float, energy: float) -> float:
    """Automatic stiffness of unbroken faces, Pa/m."""
    needed = LAW * strength**2 / energy if math.isfinite(energy) else 0.0
    return max(STIFF * modulus / width, needed)


def joined(
    scene: Scene,
    split: Split,
    law: Law,
    values: Constants,
    stiff: float | None = None,
    along: tuple[float, float, float] = (1.0, 0.0, 0.0),
    notch: Float[np.ndarray, " P"] | None = None,
) -> Scene:
    """The scene with the two sides of the split held together by `law`.

    Args:
        scene: of `split.geometry` (built with `joined=pairs(split)`), its step chosen.
        values: strength Pa, energy J/m^2, shape and ratios; numbers or one a face. An infinite energy never parts.
        stiff: of unbroken faces, Pa/m; automatic by default.
        along: direction in which the front is measured. notch: 1 where a face is parted from the start.

    Raises:
        InputError: strength or energy that is not positive, or faces too soft for the law.
    """
    for name in ("strength", "energy"):
        if not np.all(np.asarray(values[name]) > 0):
            raise InputError(f"cohesion.{name} {values[name]}: it must be positive; an infinite energy never parts")
    strength, energy = float(np.max(values["strength"])), float(np.min(values["energy"]))
    K = stiffness(float(wave_modulus(scene)), half_width(split), strength, energy) if stiff is None else float(stiff)
    if math.isfinite(energy) and strength**2 / energy > K:
        raise InputError(
            f"faces of stiffness {K:.3g} Pa/m reach the strength {strength:.4g} Pa only at an opening that has used up "
            f"the energy {energy:.4g} J/m^2; above {strength**2 / energy:.3g} Pa/m is needed: leave it to the program"
        )
    minus, plus, rule = split.minus, split.plus, 0
    if sliced(scene):
        rule, turns = ALONG, upright(split.geometry.points, minus)
        minus, plus = turned(minus, turns), turned(plus, turns)
    area = areas(split.geometry.points, minus, rule)
    initial = K if not math.isfinite(energy) else float(jnp.max(law.initial(_arrays(values), jnp.asarray(K))))
    nodal = np.zeros(len(split.geometry.points))
    shape, _ = quadrature(minus.shape[1], rule)
    for side in (minus, plus):
        np.add.at(nodal, side.T, np.einsum("qv,qp->vp", shape, area))
    mass = 2 * max(K, initial) * nodal * float(scene.clock.step) ** 2 / 4
    made = Faces(
        law, _arrays(values), jnp.asarray(minus, jnp.int32), jnp.asarray(plus, jnp.int32),
        jnp.asarray(area), jnp.asarray(K), jnp.asarray(K), jnp.asarray(mass), jnp.asarray(along, float),
        None if notch is None else jnp.asarray(notch, float),
    )  # fmt: skip
    return scene.put({"faces": made})


def sliced(scene: Scene) -> bool:
    """Whether the body is a plane slice: one layer of hexes that can not move along z."""
    points, held = np.asarray(scene.body.points), np.zeros(len(scene.body.points), bool)
    held[np.asarray(scene.body.fixed)] = np.asarray(scene.body.held)[:, 2] > 0
    z = points[:, 2]
    flat = np.isclose(z, z.min()) | np.isclose(z, z.max())
    return scene.body.cells.shape[1] == 8 and bool(held.all() and flat.all())


def upright(points: Float[np.ndarray, "N 3"], nodes) -> np.ndarray:
    """Facets (P,) of a plane slice whose first edge leads across it."""
    z = np.asarray(points)[nodes][:, :, 2]
    return np.abs(z[:, 1] - z[:, 0]) > np.abs(z[:, 2] - z[:, 1])


def turned(nodes, turns) -> np.ndarray:
    """Facets whose nodes are numbered from the second on where `turns` says so."""
    return np.where(turns[:, None], np.roll(nodes, -1, 1), nodes)


def pairs(split: Split):
    """Nodes that the faces hold together: `build.scene(..., joined=pairs(split))`."""
    return np.stack([split.minus.ravel(), split.plus.ravel()], 1)


def armed(
    scene: Scene,
    split: Split,
    blade: Wedge,
    time: Float[np.ndarray, " n"],
    tip: Float[np.ndarray, "n 3"],
    penalty: float | None = None,
    friction: float | None = None,
) -> Scene:
    """The scene with a blade that follows `tip` (m, at real `time`); its patch are the faces of the cut, both
    sides, and the lips where it goes in and out.

    Raises:
        InputError: a blade that starts inside the tissue, a bevel that is not between 0 and 90 degrees, a shoulder
            rounded by more than the blade has room for.
    """
    refuse_blade(blade)
    modulus, width = float(wave_modulus(scene)), half_width(split)
    if penalty is None:
        penalty = PRESSED * modulus / width
        if scene.faces is not None:
            strongest = float(jnp.max(scene.faces.values["strength"]))
            penalty = max(penalty, 2 * float(scene.faces.stiffness), 50 * strongest / float(blade.thickness))
    lip, beside = lips(split, LIPS * float(blade.thickness))
    nodes = np.concatenate([split.minus, split.plus[:, ::-1], lip])
    rule = 0
    if sliced(scene):
        rule, nodes = BESIDE, turned(nodes, upright(split.geometry.points, nodes))
    side = np.concatenate([np.repeat([-1.0, 1.0], len(split.minus)), beside])
    spare = -len(nodes) % build.PATCH
    sided = Wedge(**{**vars(blade), "side": jnp.asarray(np.concatenate([side, np.ones(spare)]))})
    softness = build.ONSET * modulus * float(blade.thickness) / (2 * width) / penalty / 10
    tip = np.asarray(tip, float)
    _refuse_inside(blade, split, tip, np.interp(float(scene.clock.start), time, np.arange(len(time))))
    made = build.probe(scene, _Outside(), time, tip, nodes, penalty, softness, rule)
    scene = scene.put({"probe": made}).put({"probe.shape": sided})
    return scene if friction is None else scene.put({"probe.friction": jnp.asarray(float(friction))})


def lips(split: Split, reach: float) -> tuple[np.ndarray, Float[np.ndarray, " L"]]:
    """Facets of the surface beside the cut, up to `reach` (m) from it and standing across its direction; their sides.

    A blade that goes in drags the edge of the tissue along; where only the faces of the cut may touch, the surface
    beside them turns into the blade and the elements at the corner fold.
    """
    points, geometry = np.asarray(split.geometry.points), split.geometry
    facets = boundary(geometry.cells, geometry.cell_type).nodes
    area = area_vectors(points, facets)
    x = points[split.minus]
    across = np.cross(x[:, 1] - x[:, 0], x[:, -1] - x[:, 0]).sum(0)
    across /= np.linalg.norm(across)
    middle, size = points[facets].mean(1), np.linalg.norm(area, axis=1)
    off = (middle - x.mean((0, 1))) @ across
    cut = np.isin(facets, np.unique(np.concatenate([split.minus, split.plus]))).all(1)
    kept = ~cut & (np.abs(off) < reach) & (np.abs(area[:, 0]) > UPRIGHT * size)
    return facets[kept], np.sign(off[kept])


class _Outside(Shape):
    """Stands in for the blade while its patch is made: touches nothing."""

    def distance(self, x):
        """Far off."""
        return jnp.ones_like(x[0]), x


def shoulder(thickness: float, slope: float, h: float) -> float:
    """Radius of the shoulder for facets of size h, m: `ARC` of them, or `SHARP` of the thickness where they are finer.

    A flat facet that comes over a sharper edge sinks in by its own sag, once an element: the tissue is shaken at that
    pace, and damping takes up to a tenth of the force (h half the thickness). The edge that a radius R cuts off is
    R (1 / cos(half the bevel's angle) - 1) high, 0.9 % of R at 15 degrees.
    """
    return min(max(ARC * h, SHARP * thickness), widest(thickness, slope))


def widest(thickness: float, slope: float) -> float:
    """Greatest radius of a shoulder, m: its arc takes up the whole bevel."""
    angle = math.atan(slope)
    return 0.5 * thickness / math.sin(angle) / math.tan(angle / 2)


def refuse_blade(blade: Wedge) -> None:
    """Raise on a shape that no blade has."""
    b, slope, R = float(blade.thickness), float(blade.slope), float(blade.rounding)
    if not b > 0 or not slope > 0 or not math.isfinite(slope):
        raise InputError(
            f"blade of thickness {1e3 * b:.4g} mm and bevel slope {slope:.3g}: both must be positive (slope is the "
            "tangent of half the bevel's angle: 0.25 for 28 degrees)"
        )
    most = widest(b, slope)
    if not 0 < R <= most:
        raise InputError(
            f"blade rounding {1e3 * R:.4g} mm: more than 0 and at most {1e3 * most:.4g} mm, where the bevel has no "
            "room for the arc; a sharp shoulder has a normal that jumps, and derivatives would miss its force"
        )


def _refuse_inside(blade: Wedge, split: Split, tip, at: float) -> None:
    place = np.array([np.interp(at, np.arange(len(tip)), tip[:, i]) for i in range(3)])
    x = np.asarray(split.geometry.points)[split.minus].mean(1) - place
    gap, _ = blade.distance((jnp.asarray(x[:, 0]), jnp.asarray(x[:, 1]), jnp.asarray(x[:, 2])))
    deep = -float(np.min(np.asarray(gap)))
    if deep > 0.1 * float(blade.thickness):
        raise InputError(
            f"the blade starts inside: at the first output time it lies {1e3 * deep:.2f} mm in the tissue, tip at "
            f"({', '.join(f'{1e3 * p:.1f}' for p in place)}) mm. The record must begin before the cut: start the "
            "path in "
            "front of the tissue, or check frame, profile and units"
        )


def _arrays(values):
    return {name: jnp.asarray(value, float) for name, value in values.items()}
