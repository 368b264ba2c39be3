"""Writes the tables of the pressing example, `data/press`, as a lab would have them: a layer pressed by a ball.

    python data/make_press.py FOLDER

A ball of 8 mm radius is pressed 3 mm into a layer of 15 mm, held, and taken back beyond the surface; a force sensor at
25 Hz and three markers on the surface at 15 frames a second. Both are this project's own simulation on a finer mesh
than the notebooks' (reduced polynomial: C10 500 Pa, C20 300 Pa, bulk modulus 10 kPa) with white noise of 3 mN and
0.06 mm: an example of files, not a test of the solver.
"""

import sys
from pathlib import Path

import jax
import numpy as np

TRUTH = {"energy.C10": 500.0, "energy.C20": 300.0, "volumetric.K": 10e3}  # Pa
HEIGHT, RADIUS = 15.0, 8.0  # mm
SPOTS = np.array([[12.0, 3.0, HEIGHT], [-7.0, 11.0, HEIGHT], [1.0, -12.0, HEIGHT]])  # mm
FORCE_NOISE, MARKER_NOISE = 3e-3, 0.06  # N, mm


def table(where: Path, names: str, *columns: np.ndarray) -> None:
    """A CSV of columns."""
    rows = np.concatenate([c.reshape(len(c), -1) for c in columns], axis=1)
    where.write_text(names + "\n" + "".join(",".join(f"{v:.5f}" for v in row) + "\n" for row in rows))


def main(out: Path) -> None:
    """Simulate and write probe.csv, force.csv and markers.csv."""
    jax.config.update("jax_enable_x64", True)
    from tissuejax.energies import catalogue
    from tissuejax.experiments.predictor import predictor
    from tissuejax.experiments.probing_settings import ProbingSettings
    from tissuejax.mesh.columns import box
    from tissuejax.model import Model
    from tissuejax.recordings.recording import Channel, Recording, Sample

    time = np.arange(0, 2.41, 0.02)
    z = HEIGHT + RADIUS + np.interp(time, [0, 0.2, 1.0, 1.6, 2.2, 2.4], [0.5, 0.5, -3, -3, 1, 1])
    path = np.stack([np.full_like(time, 2.0), np.full_like(time, -1.0), z], 1)
    at, frames = np.arange(0.02, 2.4, 0.04), np.arange(0.02, 2.4, 0.0667)
    channels = {
        "force": Channel(at, np.zeros((len(at), 3)), "N", FORCE_NOISE),
        "markers": Channel(frames, np.tile(1e-3 * SPOTS, (len(frames), 1, 1)), "m", 1e-3 * MARKER_NOISE),
    }
    inputs = {"probe/time": time, "probe/position": 1e-3 * path}
    press = Recording("press", "probing", inputs, channels, {"probe/radius": 1e-3 * RADIUS})
    body = box((0.04, 0.04, 1e-3 * HEIGHT), (8, 8, 3))
    fine = ProbingSettings(counts=(10, 10, 4), ratio=1.5, compression=3.0, interval=0.04, step=4e-4)
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"))
    made = predictor(model, Sample("layer", {"press": press}, body, 1000.0), settings=fine).predict(TRUTH)["press"]
    rng = np.random.default_rng(1)
    force = np.asarray(made.channels["force"].values) + FORCE_NOISE * rng.standard_normal((len(at), 3))
    seen = 1e3 * np.asarray(made.channels["markers"].values) + MARKER_NOISE * rng.standard_normal((len(frames), 3, 3))
    out.mkdir(parents=True, exist_ok=True)
    table(out / "probe.csv", "time (s),x (mm),y (mm),z (mm)", time[:, None], path)
    table(out / "force.csv", "time (s),Fx (N),Fy (N),Fz (N)", at[:, None], force)
    names = ",".join(f"m{k}_{a} (mm)" for k in (1, 2, 3) for a in "xyz")
    table(out / "markers.csv", f"time (s),{names}", frames[:, None], seen)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
