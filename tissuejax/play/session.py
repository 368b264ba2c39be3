"""What is played: one state that every open page sees, moved on by time and by what the pages command."""

import abc
import math
import time

import numpy as np
from jaxtyping import Float

from tissuejax.surrogate.live.ask import Asker

TICK = 2e-3  # s between two evaluations while a surrogate is served
LONGEST = 0.1  # s that a session is moved on at once: after a pause of the machine it does not race


class Session(abc.ABC):
    """One thing that is played.

    Attributes:
        probe: where the pages want the ball's centre, m. position, force, depth: where it is, N and m.
        nodes: whether a frame carries node displacements (else coefficients of modes).
    """

    nodes: bool = False

    def __init__(self, model: dict):
        self.model = model
        self.probe = np.array(model["start"], float)
        self.position, self.force, self.depth = self.probe.copy(), np.zeros(3), -1.0
        self.error: str | None = None

    @abc.abstractmethod
    def advance(self, seconds: float) -> None:
        """Move time on."""

    @abc.abstractmethod
    def body(self) -> Float[np.ndarray, " n"]:
        """What a frame carries beside place and force."""

    def remark(self) -> str:
        """A word on pace, shown in the page."""
        return ""

    def command(self, message: dict) -> None:
        """Take a command of a page; what makes no sense is passed over."""
        wanted = message.get("probe")
        if isinstance(wanted, list) and len(wanted) == 3 and all(_number(x) for x in wanted):
            self.probe = np.array(wanted, float)
        if message.get("rest"):
            self.rest()

    def rest(self) -> None:  # noqa: B027 - a stored run has no memory to empty
        """Rested tissue again."""

    def frame(self, number: int) -> bytes:
        """Number, place, force, depth, kind, count and the body, single precision, little-endian."""
        body = np.asarray(self.body(), np.float32).ravel()
        head = [number, *self.position, *self.force, self.depth, float(self.nodes), len(body)]
        return np.concatenate([np.array(head, np.float32), body]).astype("<f4").tobytes()


class SurrogateSession(Session):
    """A surrogate under the pages' hands."""

    def __init__(self, model: dict, asker: Asker):
        super().__init__(model)
        self.asker, self.spent, self.count = asker, 0.0, 0

    def advance(self, seconds: float) -> None:
        seconds = min(seconds, LONGEST)
        steps = max(1, math.ceil(seconds / TICK))
        begin, before = self.position.copy(), time.perf_counter()
        for k in range(1, steps + 1):
            self.position = begin + (self.probe - begin) * k / steps
            self.force = self.asker.tick(self.position, seconds / steps)
        self.depth = self.asker.depth
        self.spent, self.count = self.spent + time.perf_counter() - before, self.count + steps

    def body(self) -> np.ndarray:
        return self.asker.shape()

    def rest(self) -> None:
        self.asker.rest()

    def remark(self) -> str:
        return f"computed by the server, {1e6 * self.spent / max(self.count, 1):.0f} us a force"


def _number(x) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)
