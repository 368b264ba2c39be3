"""Writes the files of the probing example, `data/probing`, as a lab would have them: a surface and tables of text.

    python data/make_probing.py FOLDER

The surface is half an ellipsoid of 80 x 60 x 30 mm standing on its flat side. The path presses a ball of 8 mm radius
5 mm into its middle and takes it back, in the robot's own frame, which is turned by 90 degrees and shifted against the
surface's; three points known in both frames are in the side file. Force and markers are this project's own simulation
(neo-Hookean, shear modulus 2 kPa, bulk modulus 40 kPa) with white noise of 3 mN and 0.1 mm: an example of files, not a
test of the solver. Without a simulation the probe feels nothing; with its recording file the tables are written anew:

    python data/make_probing.py FOLDER simulated.h5
"""

import sys
from pathlib import Path

import h5py
import numpy as np
import trimesh

RADIUS, TOP, DEPTH = 8.0, 30.0, 5.0  # mm
# The robot's frame: x along the surface's y, y against its x, shifted.
TURN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
SHIFT = np.array([300.0, 120.0, 50.0])


def dome() -> trimesh.Trimesh:
    """The closed surface, mm: an ellipsoid whose lower half is flattened onto z = 0."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=1.0)
    points = ball.vertices * [40.0, 30.0, 30.0]
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    return trimesh.Trimesh(points, ball.faces)


def path() -> tuple[np.ndarray, np.ndarray]:
    """Times, s, and the centre of the ball in the surface's frame, mm."""
    time = np.linspace(0.0, 8.0, 161)
    depth = np.interp(time, [0, 1, 5, 6, 8], [-2.0, -2.0, DEPTH, DEPTH, -2.0])
    return time, np.stack([0 * time, 0 * time, TOP + RADIUS - depth], axis=1)


def markers() -> np.ndarray:
    """Places of twelve markers on the surface, mm, around the site."""
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    reach = np.where(np.arange(12) % 2, 14.0, 20.0)
    x, y = reach * np.cos(angle), 0.8 * reach * np.sin(angle)
    return np.stack([x, y, 30 * np.sqrt(1 - (x / 40) ** 2 - (y / 30) ** 2)], axis=1)


def table(where: Path, names: str, *columns: np.ndarray) -> None:
    """A CSV of columns."""
    rows = np.concatenate([c.reshape(len(c), -1) for c in columns], axis=1)
    where.write_text(names + "\n" + "".join(",".join(f"{v:.5f}" for v in row) + "\n" for row in rows))


def main(out: Path, simulated: Path | None) -> None:
    """Write surface and path, and force and markers where a simulation is given."""
    out.mkdir(parents=True, exist_ok=True)
    dome().export(out / "phantom.stl")
    time, centre = path()
    robot = lambda x: x @ TURN.T + SHIFT  # noqa: E731
    table(out / "probe.csv", "time (s),x (mm),y (mm),z (mm)", time, robot(centre))
    marks = ",".join(f"m{k + 1}_{a} (mm)" for k in range(12) for a in "xyz")
    rng = np.random.default_rng(1)
    if simulated is None:
        table(out / "force.csv", "time (s),Fx (N),Fy (N),Fz (N)", time, rng.normal(0, 0.003, (161, 3)))
        still = robot(markers())[None] + rng.normal(0, 0.1, (81, 12, 3))
        table(out / "markers.csv", f"time (s),{marks}", time[::2], still)
        return
    with h5py.File(simulated) as file:
        group = next(iter(file["recordings"].values()))
        t, force = group["force/time"][()], group["force/value"][()]
        tm, places = group["markers/time"][()], 1e3 * group["markers/position"][()]
    table(out / "force.csv", "time (s),Fx (N),Fy (N),Fz (N)", t, (force + rng.normal(0, 0.003, force.shape)) @ TURN.T)
    table(out / "markers.csv", f"time (s),{marks}", tm, robot(places + rng.normal(0, 0.1, places.shape)))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
