"""The source's stop at 3 N (2.2.2): the three synthetic sites of fits/in-vivo-liver pressed until the force is there.

Each site is pressed twice on one mesh along one path, with the law in vivo that stands for the tissue and with the ex
vivo law; their differences are what the source compares in 2.2.5, without noise. The study's press of 4 mm is the
beginning of the same path.
"""

import jax.numpy as jnp
import numpy as np

from tissuejax.energies.published import published
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import columns
from tissuejax.mesh.facets import boundary, facing_up
from tissuejax.mesh.markers import attach
from tissuejax.tled import build
from tissuejax.tled.scene import Markers
from tissuejax.tled.shapes import Hemisphere
from tissuejax.tled.simulate import run

STOP = 3.0  # N
DEEPEST = {"site 1": 15e-3, "site 2": 16e-3, "site 3": 15e-3}  # m, of 20 to 21 mm of tissue
BOTH = 12e-3  # m: further down elements under the probe fold up with the ex vivo law
START, GAP = 0.4, 5e-4  # s and m: when the probe has come down to the surface, and from how high
INTERVAL = 0.064  # s, of a frame
COMPRESSION = 32.0
UPWARD = 1.8  # layers thinner towards the probed top
# In units of the moduli at rest, 70, 1823, 525 and 782 Pa: with less the elements under the probe fold up
HOURGLASS = {"ex-vivo-ogden": 10.0, "in-vivo-1": 2.0, "in-vivo-2": 4.0, "in-vivo-3": 2.0}


def pressed(study: dict, name: str, law: str, counts: tuple[int, int, int], deepest: float) -> dict:
    """Depth, m, force of the probe, N, and motion of the markers, m, (n, K, 3), at each frame's end since touch."""
    body, place, radius = study["lobe"](), np.array(study["SITES"][name][1]), study["RADIUS"]
    dots = study["rig"](body, name, tuple(place)).channels["markers"].values[0]
    geometry, entry = columns(body, counts, [place], upward=UPWARD), published(law)
    upper = facing_up(geometry.points, boundary(geometry.cells, geometry.cell_type))
    on = attach(dots, geometry.points, upper)
    tip = float(body.top.ev(*body.parameters_of(place))) + radius
    time = np.array([0.0, START, START + deepest / study["SPEED"]])
    path = np.stack([*np.tile(place[:, None], 3), tip + np.array([GAP, 0.0, -deepest])], 1)
    scene = build.scene(
        geometry,
        build.Tissue(entry.energy, Quadratic(), entry.constants, dict(K=study["K"]), 1060.0),
        (np.arange(round(time[-1] / INTERVAL)) + 0.5) * INTERVAL,
        build.ProbePath(time, path, Hemisphere(radius)),
        numerics=build.Numerics(compression=COMPRESSION, hourglass=HOURGLASS[law]),
        markers=Markers(on.nodes, on.weights, on.rest),
    )
    out = run(scene.cast(jnp.float32))
    ends = np.asarray(out.end_time)
    down = ends > START
    return {
        "depth": (ends[down] - START) * study["SPEED"],
        "force": np.interp(ends, np.asarray(out.time), np.asarray(out.force)[:, 2])[down],
        "moved": np.asarray(out.markers)[down] - np.asarray(on.rest),
        "hourglass": float(out.hourglass),
        "inertia": float(out.inertia),
        "hexes": len(geometry.cells),
    }


def site(study: dict, name: str, counts: tuple[int, int, int]) -> dict:
    """The law in vivo until 3 N, the ex vivo law down to `BOTH`, and their differences over 4 mm and down to there.

    Without 3 N the end is where the force is greatest: beyond it elements have folded up.
    """
    real = pressed(study, name, study["SITES"][name][0], counts, DEEPEST[name])
    told = pressed(study, name, study["START"], counts, BOTH)
    over = np.flatnonzero(real["force"] >= STOP)
    end = int(over[0]) if len(over) else int(real["force"].argmax())
    nearest = np.linalg.norm(real["moved"], axis=2).max(1)
    return {
        "depth_mm": (1e3 * real["depth"]).tolist(),
        "force_N": real["force"].tolist(),
        "ex_vivo_N": told["force"].tolist(),
        "reached": bool(len(over)),
        "end_depth_mm": 1e3 * float(real["depth"][end]),
        "end_force_N": float(real["force"][end]),
        "end_marker_mm": 1e3 * float(nearest[end]),
        "at 4 mm": differences(real, told, np.searchsorted(real["depth"], study["DEPTH"]) + 1),
        "at 12 mm": differences(real, told, len(told["depth"])),
        "hourglass": [real["hourglass"], told["hourglass"]],
        "inertia": [real["inertia"], told["inertia"]],
        "hexes": real["hexes"],
    }


def differences(real: dict, told: dict, n: int) -> dict:
    """Over the first n frames: RMSE and greatest error of the force, N; RMSE of each marker (eq. 2.2), their mean
    (eq. 2.3) and the mean displacement of all markers, mm, as lengths of vectors."""
    force = told["force"][:n] - real["force"][:n]
    apart = np.linalg.norm(told["moved"][:n] - real["moved"][:n], axis=2)
    marker = 1e3 * np.sqrt((apart**2).mean(0))
    return {
        "depth_mm": 1e3 * float(real["depth"][n - 1]),
        "force_N": float(real["force"][n - 1]),
        "force_rmse_N": float(np.sqrt((force**2).mean())),
        "greatest_error_N": float(np.abs(force).max()),
        "marker_rmse_mm": marker.tolist(),
        "marker_mean_mm": float(marker.mean()),
        "displacement_mm": 1e3 * float(np.linalg.norm(real["moved"][:n], axis=2).mean()),
    }
