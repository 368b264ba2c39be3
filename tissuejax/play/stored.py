"""A stored run played back: its states and its force, interpolated, so that neither jumps from one to the next."""

from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.play.blob import coded, skins
from tissuejax.play.session import Session


class Run:
    """Times and displacements of a run's states, and its force.

    Attributes:
        points, cells: mesh, m. times: of the states, s. states: displacement, m. force_times, force: s, N.
        radius, path_times, path: of the probe, m and s; 0 and none where the file tells nothing of a round one.
    """

    def __init__(self, path: str | Path):
        """Read a run of `tissuejax simulate` or `stream.run_to_file`.

        Raises:
            InputError: no such run, or one without states.
        """
        try:
            with h5py.File(path) as file:
                self.points, self.cells = file["points"][...], file["cells"][...]
                self.times = file["states/time"][...]
                stored = file["states/displacement"]
                self.states = np.array([stored[str(k)][...] for k in range(len(stored))])
                self.force_times, self.force = file["channels/time"][...], file["channels/force"][...]
                self.radius, self.path_times, self.path = 0.0, np.zeros(1), np.zeros((1, 3))
                if "probe" in file:
                    self.radius = float(file["probe/radius"][()])
                    self.path_times, self.path = file["probe/time"][...], file["probe/position"][...]
        except (OSError, KeyError) as fault:
            raise InputError(
                f"{path}: not a stored run ({fault}); wanted are points, cells, states and channels"
            ) from fault
        if len(self.times) < 2 or len(self.states) != len(self.times):
            raise InputError(f"{path}: {len(self.states)} states at {len(self.times)} times; at least two are needed")

    def shape(self, t: float) -> Float[np.ndarray, "N 3"]:
        """Displacement at t, linear between states (nothing before the first)."""
        k = int(np.clip(np.searchsorted(self.times, t) - 1, 0, len(self.times) - 2))
        share = float(np.clip((t - self.times[k]) / (self.times[k + 1] - self.times[k]), 0, 1))
        return (1 - share) * self.states[k] + share * self.states[k + 1]

    def force_at(self, t: float) -> Float[np.ndarray, "3"]:
        """Force at t, linear between frames."""
        return np.array([np.interp(t, self.force_times, column) for column in self.force.T])

    def probe_at(self, t: float) -> Float[np.ndarray, "3"]:
        """Centre of the probe at t, m."""
        return np.array([np.interp(t, self.path_times, column) for column in self.path.T])


class RunSession(Session):
    """A stored run, over and over."""

    nodes = True

    def __init__(self, run: Run, name: str):
        self.run, self.clock = run, float(run.times[0])
        span = float(np.ptp(run.points[:, :2], axis=0).max())
        middle = run.points.mean(0)
        largest = float(np.abs(run.states).max()) or 1e-3
        super().__init__({
            "kind": "run", "title": name, "what": f"a stored run of {len(run.cells)} elements, {len(run.times)} states",
            "wrong": ["as it was simulated; between states linear"], "playback": True, "radius": run.radius,
            "low": (middle[:2] - span / 2).tolist(), "high": (middle[:2] + span / 2).tolist(), "depth": largest,
            "start": [*middle[:2].tolist(), float(run.points[:, 2].max())], "high_z": float(run.points[:, 2].max()),
            "middle": middle.tolist(), "span": span, "points": coded(run.points),
            **skins(run.points, run.cells, float(middle[1])),
        })  # fmt: skip

    def advance(self, seconds: float) -> None:
        first, last = float(self.run.times[0]), float(self.run.times[-1])
        self.clock = first + (self.clock - first + seconds) % (last - first)
        self.force, self.depth = self.run.force_at(self.clock), -1.0
        self.position = self.run.probe_at(self.clock)

    def body(self) -> np.ndarray:
        return self.run.shape(self.clock)

    def remark(self) -> str:
        return f"stored run at {self.clock:.2f} s"
