"""The full model under the pages' hands."""

import numpy as np

from tissuejax.errors import UnstableSimulation
from tissuejax.play.blob import coded, skins
from tissuejax.play.session import LONGEST, Session
from tissuejax.surrogate.live.direct import Direct, Pace

FASTEST = 0.2  # m/s that the ball follows: a mouse jumps, a hand does not


class DirectSession(Session):
    """TLED at the speed of life; when the machine is held up, life waits, and the page says so."""

    nodes = True

    def __init__(self, direct: Direct, pace: Pace, place, depth: float, title: str, what: str):
        self.direct, self.pace, self.behind = direct, pace, 0.0
        scene = direct.scene
        points, cells = (np.asarray(x) for x in (scene.body.points, scene.body.cells))
        radius, reach = float(scene.probe.shape.radius), np.full(2, 8e-3)
        super().__init__({
            "kind": "direct", "title": title, "what": what, "radius": radius, "points": coded(points),
            "wrong": [f"the full model itself, {len(cells)} elements; its mesh's error is not measured here",
                      f"{pace.times_life:.1f} times life on this machine"],
            "low": (np.asarray(place) - reach).tolist(), "high": (np.asarray(place) + reach).tolist(), "depth": depth,
            "start": direct.at.tolist(), "high_z": float(direct.at[2]) - 1e-3,
            "middle": [*points[:, :2].mean(0).tolist(), float(points[:, 2].max()) * 0.7],
            "span": float(np.ptp(points[:, :2], axis=0).max()), **skins(points, cells, float(place[1])),
        })  # fmt: skip

    def advance(self, seconds: float) -> None:
        calls = max(1, round(min(seconds, LONGEST) / self.direct.call))
        self.behind += max(0.0, seconds - LONGEST)
        for _ in range(calls):
            step = self.probe - self.direct.at
            far = float(np.linalg.norm(step))
            step = step if far <= FASTEST * self.direct.call else step * FASTEST * self.direct.call / far
            try:
                self.force = self.direct.move(self.direct.at + step)
            except UnstableSimulation as fault:
                self.error, self.probe = str(fault), np.array(self.model["start"])
                break
        self.position = self.direct.at
        self.depth = float(self.model["high_z"] - self.position[2])

    def body(self) -> np.ndarray:
        return self.direct.displacement

    def rest(self) -> None:
        self.direct.rest()

    def remark(self) -> str:
        late = f"; {self.behind:.1f} s of life were left out" if self.behind > 0.5 else ""
        return f"full model, {self.pace.times_life:.1f} times life{late}"
