"""Where a whole top is worst, and what of it is sideways: places near the rim of the source's block, held out.

python fits/play-lobe/rim.py [MESH ...]   16x16x6 (what `--all` takes) by default, 40 s of CPU; adds to rim.json
"""

import json
import sys
from pathlib import Path

import jax
import numpy as np

from tissuejax.commands.precompute import counts_of
from tissuejax.energies import catalogue
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.storage import write_json
from tissuejax.surrogate import error
from tissuejax.surrogate.places import Box, first_contact
from tissuejax.surrogate.precompute import LEVELS
from tissuejax.surrogate.ramp import Matter, ramp
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.surrogate.tabulate import surrogate

jax.config.update("jax_enable_x64", True)

RADIUS, HERE = 4.75e-3, Path(__file__).parent
EDGE, ASIDE = -0.09, 3.3e-3  # x of the rim, y of the places, m
PLACES = Box(np.array([EDGE + 9e-3, 0.0]), np.array([EDGE + 27e-3, 6e-3]), 7e-3, (4, 2), 8)  # as `--all` has them there
HELD_OUT = (10.6e-3, 13.7e-3, 18.0e-3)  # m from the rim; the first two are as near as those of the whole top


def matter() -> Matter:
    """The source's lobe as a block, elastic."""
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"), ())
    values = model.defaults | {"energy.C10": 645.0, "energy.C20": 500.0, "volumetric.K": 20e3}
    return Matter(model, values, lobe_of_mesh(box((0.18, 0.115, 0.04), (4, 4, 2))), RADIUS, 1060.0)


def main(mesh: str) -> dict:
    """Errors at the held-out places, and the force there, vertical and away from the rim, of model and tables, N."""
    tissue, grid = matter(), Grid(counts_of(mesh), RADIUS)
    contact, levels = first_contact(tissue.lobe, PLACES, RADIUS), PLACES.depth * np.asarray(LEVELS)

    def at(place, depths):
        return ramp(tissue, grid, place, float(contact.sample(np.asarray(place)[None])[0, 0]), depths)

    tests = [at(np.array([EDGE + room, ASIDE]), levels) for room in HELD_OUT]
    made = surrogate(tissue, PLACES, grid, [at(p, PLACES.levels) for p in PLACES.sites().reshape(-1, 2)], None)
    found = {"errors": error.held_out(made, tests), "forces_N": {}}
    for room, r in zip(HELD_OUT, tests):
        top = float(contact.sample(r.place[None])[0, 0])
        told = np.array([made.elastic(np.array([*r.place, top - d])) for d in r.depth])
        found["forces_N"][f"{1e3 * room:g} mm from the rim"] = [
            {"depth_m": float(d), "model": [float(a[2]), float(a[0])], "tables": [float(b[2]), float(b[0])]}
            for d, a, b in zip(r.depth, r.force, told)
        ]
    return found


if __name__ == "__main__":
    kept = HERE / "rim.json"
    for name in sys.argv[1:] or ["16x16x6"]:
        before = json.loads(kept.read_text()) if kept.is_file() else {}
        write_json(kept, before | {name: main(name)})
        print(name, json.loads(kept.read_text())[name]["errors"])
