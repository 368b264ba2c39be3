"""How wrong a surrogate is: against the full model at places and depths it was not made from, and beside that how wrong
the full model's own mesh is. Both belong to the file and are never left out."""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.surrogate.ramp import Matter, Ramp, ramp
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.surrogate.surrogate import Surrogate

FELT = 0.05  # N: below it a relative error says nothing; a hand notices 0.1 N
FINER = 1.35  # refinement of the mesh whose difference is given as the numerical error


def _forces(made: Surrogate, p):
    return jax.vmap(made.elastic)(p)


def _shapes(made: Surrogate, p):
    return jax.vmap(made.shape)(p)


def held_out(made: Surrogate, ramps: Sequence[Ramp]) -> dict[str, object]:
    """Errors at states that took no part: force (share of the full force, where it is over `FELT`), its vertical part
    alone, where the force is worst, lateral force, N, and displacement of all nodes, m."""
    force_at, shape_at = eqx.filter_jit(_forces), eqx.filter_jit(_shapes)
    share, upright, at, lateral, apart = [], [], [], [], []
    for r in ramps:
        xy = np.tile(r.place, (len(r.depth), 1))
        z = np.asarray(made.touch(jnp.asarray(r.place)))[0] - r.depth
        p = jnp.asarray(np.column_stack([xy, z]))
        force = np.asarray(force_at(made, p))
        size = np.linalg.norm(r.force, axis=1)
        felt = size > FELT
        share += list(np.linalg.norm(force - r.force, axis=1)[felt] / size[felt])
        upright += list(np.abs(force - r.force)[felt, 2] / size[felt])
        at += [(*map(float, r.place), float(d)) for d in r.depth[felt]]
        lateral += list(np.linalg.norm((force - r.force)[:, :2], axis=1))
        moved = np.tensordot(np.asarray(shape_at(made, p)), made.surface.modes, 1)
        apart.append(np.linalg.norm(moved - r.displacement, axis=2))
    apart, share = np.array(apart), np.array(share if share else [np.nan])
    upright = np.array(upright if upright else [np.nan])
    return {
        "states": int(sum(len(r.depth) for r in ramps)),
        "felt": int(np.isfinite(share).sum()),
        "force_median": float(np.median(share)),
        "force_p95": float(np.quantile(share, 0.95)),
        "force_worst": float(share.max()),
        "worst_at_m": list(at[int(share.argmax())]) if at else None,
        "vertical_median": float(np.median(upright)),
        "vertical_worst": float(upright.max()),
        "lateral_rms_N": float(np.sqrt(np.mean(np.square(lateral)))),
        "lateral_worst_N": float(np.max(lateral)),
        "surface_worst_m": float(apart.max()),
        "surface_rms_m": float(np.sqrt((apart**2).mean())),
    }


def numerical(matter: Matter, grid: Grid, place, contact: float, depths) -> Mapping[str, object]:
    """The full model's own error at one place: what elements smaller by `FINER` say, over what these say."""
    here = ramp(matter, grid, place, contact, depths)
    fine = ramp(matter, grid.refined(FINER), place, contact, depths)
    felt = here.force[:, 2] > FELT
    share = fine.force[felt, 2] / here.force[felt, 2] - 1
    return {
        "elements": int(np.prod(grid.counts)),
        "elements_refined": int(np.prod(grid.refined(FINER).counts)),
        "depths_m": [float(d) for d in here.depth[felt]],
        "force_change": [float(x) for x in share],
        "force_worst": float(np.abs(share).max()) if felt.any() else None,
    }
