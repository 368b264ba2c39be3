"""How far a probing case is from the same body on a finer mesh: its force by depth, its markers.

    python fits/challenge/mesh.py        a quarter of an hour of one core; writes mesh.json beside it

One press of 7 mm with a hold, nothing concealed, no noise: on the mesh of the sets up to probing-fourth, on that now,
and on the finest, which the two are held against.
"""

import json
from pathlib import Path
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from tissuejax.challenge import probing_bench
from tissuejax.challenge.lobe import Lobe
from tissuejax.challenge.probe_paths import Path as Way
from tissuejax.challenge.probe_paths import over
from tissuejax.challenge.probing_cases import markers
from tissuejax.challenge.solid import Tissue
from tissuejax.storage import write_json

LOBE = Lobe(0.031, 0.0275, 0.09, 0.02, 0.5, 0.9, (0.01, -0.02))
SITE, RADIUS, DEPTH = (-8.8e-3, -5e-4), 0.0095, 7e-3
MESHES = {  # hexes, spacing under the probe over that far away
    "up to probing-fourth": ((16, 16, 6), 0.14),
    "now": (probing_bench.MESH, probing_bench.FINE),
    "finest": ((28, 28, 11), 0.22),
}
SHARES = (0.02, 0.1, 0.3, 0.6, 1.0)  # of the largest force


def pressed(mesh: tuple[int, int, int], fine: float) -> probing_bench.Record:
    """The press on one mesh."""
    probing_bench.FINE = fine
    top = over(LOBE, SITE, RADIUS)
    heights = np.array([top + 5e-4, top - DEPTH, top - DEPTH, top + 5e-4])
    path = Way(np.array([0.0, 2.5, 4.5, 7.0]), np.stack([0 * heights + SITE[0], 0 * heights + SITE[1], heights], 1))
    places = markers(np.random.default_rng(0), LOBE, [SITE], 11)
    setup = probing_bench.Setup(LOBE, Tissue(463.0, 337.0, 2e4), [SITE], RADIUS, places, mesh)
    return probing_bench.record(setup, probing_bench.Visit(0, path, (0.0, 0.0)), [])


def main() -> None:
    records = {}
    with threadpool_limits(1):
        for name, (mesh, fine) in MESHES.items():
            begun = perf_counter()
            records[name] = pressed(mesh, fine)
            print(name, f"{perf_counter() - begun:.0f} s", flush=True)
    last = records["finest"]
    share = last.force[:, 2] / last.force[:, 2].max()
    moved = last.markers - last.markers[0]
    found = {}
    for name in list(MESHES)[:-1]:
        force, off = records[name].force, records[name].markers - last.markers
        each = np.sqrt(np.mean(off**2, axis=(0, 2)))
        found[name] = {
            "hexes": MESHES[name][0],
            "vertical force, %, by share of the largest": {
                f"{a:g} to {b:g}": 100 * float(np.mean(force[inside, 2] / last.force[inside, 2]) - 1)
                for a, b in zip(SHARES, SHARES[1:])
                for inside in [(share > a) & (share <= b)]
            },
            "markers, um rms": 1e6 * float(np.sqrt(np.mean(off**2))),
            "worst marker, um rms, and what it moves": [
                1e6 * float(each.max()),
                1e6 * float(np.sqrt(np.mean(moved[:, np.argmax(each)] ** 2))),
            ],
        }
    write_json(Path(__file__).with_suffix(".json"), found)
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
