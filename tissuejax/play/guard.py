"""Limits on what a device is told; the same as `tj_safe` in the C header."""

import numpy as np
from jaxtyping import Float

STALE = 0.01  # s


class Guard:
    """Force limit (N), slew limit (N/s), ramp-in (s); nothing for stale or non-finite positions."""

    def __init__(self, most: float = 3.0, slew: float = 300.0, ramp: float = 0.5):
        self.most, self.slew, self.ramp = most, slew, ramp
        self.last, self.since = np.zeros(3), 0.0

    def safe(self, p, age: float, dt: float, force) -> Float[np.ndarray, "3"]:
        """The force that may be told."""
        force = np.asarray(force, float)
        if not (0 <= age <= STALE and dt >= 0 and np.isfinite(p).all() and np.isfinite(force).all()):
            self.last, self.since = np.zeros(3), 0.0
            return self.last
        self.since += dt
        share = self.since / self.ramp if self.ramp > 0 and self.since < self.ramp else 1.0
        size = share * float(np.linalg.norm(force))
        share = share * self.most / size if size > self.most else share
        step = share * force - self.last
        change = float(np.linalg.norm(step))
        if change > self.slew * dt:
            step = step * self.slew * dt / change
        self.last = self.last + step
        return self.last
