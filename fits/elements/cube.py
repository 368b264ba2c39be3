"""A cube squashed to 0.7 between bonded plates: how fast does each element converge, by hourglass control?

An eighth of the cube, by symmetry. The reference is felupe's mixed hexahedron (displacement, pressure and volume apart;
no code in common), on meshes of up to 24 elements along an edge of the whole cube, extrapolated.
"""

import felupe
import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.recordings.recording import Geometry
from tissuejax.tled import build, internal, statics

HALF, MU, SQUASHED = 0.01, 1000.0, 0.7
STRETCHES = (0.95, 0.9, 0.85, 0.8, 0.75, SQUASHED)
RATIOS = (20, 1000)  # K over mu
ALONG = (4, 8, 16)  # elements along an edge of the whole cube
REFERENCE = (8, 16, 24)
SHARES = (0.05, 0.1, 0.3, 1.0)


def reference(along: int, ratio: float) -> float:
    """Force on a plate over mu times its area, by felupe's mixed hexahedra."""
    n = along // 2
    mesh = felupe.Cube(b=(1, 1, 1), n=n + 1)
    field = felupe.FieldsMixed(felupe.RegionHexahedron(mesh), n=3)
    law = felupe.ThreeFieldVariation(felupe.NeoHooke(mu=1.0, bulk=ratio))
    body = felupe.SolidBody(law, field)
    bounds = {axis: felupe.Boundary(field[0], **{f"f{axis}": 0, "skip": _but(axis)}) for axis in "xyz"}
    bounds["plate"] = felupe.Boundary(field[0], fz=1, skip=(0, 0, 1))
    bounds["move"] = felupe.Boundary(field[0], fz=1, skip=(1, 1, 0))
    for stretch in STRETCHES:
        bounds["move"].update(stretch - 1)
        dof0, dof1 = felupe.dof.partition(field, bounds)
        outer = felupe.dof.apply(field, bounds, dof0)
        felupe.newtonrhapson(items=[body], dof0=dof0, dof1=dof1, ext0=outer, verbose=0, tol=1e-8)
    force = felupe.tools.force(field, body.results.force, bounds["move"])
    return float(-force[2])


def _but(axis: str) -> tuple[int, ...]:
    return tuple(int(a != axis) for a in "xyz")


def force(element: str | None, along: int, share: float | None, ratio: float) -> float:
    """The same by an element of ours, static equilibrium."""
    n = along // 2
    g = box((HALF, HALF, HALF), (n, n, n))
    x = np.asarray(g.points) - np.min(g.points, axis=0)
    low, top = x < 1e-9, x[:, 2] > HALF - 1e-9
    ends = np.flatnonzero(low.any(1) | top)
    held = (low | top[:, None])[ends].astype(float)
    pattern = np.zeros((len(ends), 3))
    pattern[top[ends], 2] = 1.0
    scene = build.scene(
        Geometry(x, g.cells, g.cell_type, ends),
        build.Tissue(ReducedPolynomial(order=1), Quadratic(), {"C10": MU / 2}, {"K": ratio * MU}, 1000.0),
        np.arange(2.0),
        numerics=build.Numerics(element=element, hourglass=share),
        held=held,
    )
    u, before = jnp.zeros_like(jnp.asarray(x)), 1.0
    for stretch in STRETCHES:
        down = np.tile([0.0, 0.0, (stretch - 1) * HALF], (2, 1))
        scene = scene.put(
            {
                "support.time": jnp.arange(2.0),
                "support.displacement": jnp.asarray(down),
                "support.pattern": jnp.asarray(pattern),
                "body.settled": u.at[:, 2].add((stretch - before) * jnp.asarray(x[:, 2])),
            }
        )
        u, before = statics.checked(statics.compiled(scene, tolerance=1e-5, margin=4.0)).displacement, stretch
    mesh = internal.mesh(scene)
    f = internal.forces(scene, mesh, u.T, internal.rest(scene, mesh), 0.0)[0]
    return float(-np.asarray(f)[2, top].sum() / (MU * HALF**2))


def extrapolated(found: dict[int, float]) -> tuple[float, float]:
    """Limit and order of three meshes: f = limit + c n^-order; low, since the edges of the plates are singular."""
    (a, fa), (b, fb), (c, fc) = sorted(found.items())
    seen = (fa - fb) / (fb - fc)
    order = float(brentq(lambda p: (a**-p - b**-p) / (b**-p - c**-p) - seen, 0.1, 4.0))
    return fc - (fb - fc) * c**-order / (b**-order - c**-order), order


def squashed() -> dict:
    """Errors in per cent by ratio, element and share, and elements along an edge."""
    out = {}
    for ratio in RATIOS:
        known = {n: reference(n, ratio) for n in REFERENCE}
        limit, order = extrapolated(known)
        kinds = {f"hexahedron, share {s:g}": (None, s) for s in SHARES}
        kinds |= {"hexahedron-bending": ("hexahedron-bending", None)}
        errors = {"felupe, mixed hexahedron": {str(n): 100 * (f / limit - 1) for n, f in known.items()}}
        for name, (element, share) in kinds.items():
            errors[name] = {str(n): 100 * (force(element, n, share, ratio) / limit - 1) for n in ALONG}
        out[f"K/mu {ratio}"] = {"limit, force over mu and area": limit, "order": order, "error_percent": errors}
    return out
