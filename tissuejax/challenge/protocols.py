"""What is done to a challenge specimen: ramps, holds, cycles and rates drawn at random, the last recording a hold-out.

The practice cases have four recordings of 25 s at 25 Hz (pull with a hold, two pushes, planar with a hold, and a
mixed one held out); these vary number, length, rate, depth, direction and order of such pieces.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.specimen import Trial

AREA, HEIGHT, DIAMETER = 5.067e-4, 0.025, 0.0254
FACES = np.eye(3)


def path(
    levels: list[float], rate: float, holds: list[float], dt: float, rest: float
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Time and drive: one second at rest, then level after level at `rate` (1/s), each held for its hold, back to rest.

    Args:
        levels: drive at the corners, `rest` among them where wanted.
        holds: seconds at each level.
        dt: sampling interval, s.
    """
    corners, at = [0.0, 1.0], [rest, rest]
    for level, hold in zip([*levels, rest], [*holds, 2.0]):
        corners.append(corners[-1] + max(abs(level - at[-1]) / rate, dt))
        at.append(level)
        if hold > 0:
            corners.append(corners[-1] + hold)
            at.append(level)
    time = np.arange(0.0, corners[-1], dt)
    return time, np.interp(time, corners, at)


def _levels(rng: np.random.Generator, style: str, pull: float, push: float) -> tuple[list[float], list[float]]:
    """Corner levels (stretches) and their holds for a style of loading."""
    wait = float(rng.uniform(3.0, 8.0)) if rng.random() < 0.75 else 0.0
    part = float(rng.uniform(0.4, 0.65))
    up, down = 1 + pull, 1 - push
    if style == "pull":
        return [up], [max(wait, 2.0)]
    if style == "push":
        return [1 - part * push, 1.0, down], [0.0, 0.0, wait]
    if style == "pull twice":
        return [1 + part * pull, 1.0, up], [0.0, 0.0, wait]
    if style == "cycles":
        return [1 + part * pull, 1.0, up, 1.0, up, 1 + part * pull], [0.0, 0.0, 0.0, 0.0, wait, 0.0]
    if style == "push cycles":
        return [1 - part * push, 1.0, down, 1.0, down], [0.0, 0.0, wait, 0.0, 0.0]
    return [1 + part * pull, down, up], [0.0, wait, float(rng.uniform(1.0, 4.0))]


def trials(rng: np.random.Generator, rare: bool) -> list[Trial]:
    """Four or five recordings: pull, push, planar or equibiaxial, and a mixed hold-out in another direction or style.

    Args:
        rare: allow biaxial and simple shear among the fitted ones.
    """
    pull, push = rng.uniform(0.2, 0.42), rng.uniform(0.2, 0.34)
    second = rng.choice(["planar", "equibiaxial"] + (["biaxial", "simple-shear"] if rare else []))
    plan = [
        ("uniaxial", str(rng.choice(["pull", "pull twice", "cycles"]))),
        ("uniaxial", str(rng.choice(["push", "push cycles"]))),
        (str(second), "pull twice"),
    ]
    if rng.random() < 0.35:
        plan.insert(2, ("uniaxial", str(rng.choice(["pull twice", "mixed"]))))
    plan.append(("uniaxial", "mixed") if rng.random() < 0.75 else ("planar", "cycles"))
    start, gap = 0.0, float(rng.choice([120.0, 300.0, 600.0, 900.0]))
    order = [FACES[i] for i in rng.permutation(3)]
    rate = np.exp(rng.uniform(np.log(0.025), np.log(0.06)))
    found = []
    for i, (kind, style) in enumerate(plan):
        held_out = i == len(plan) - 1
        direction = FACES[0] if i == 0 else order[i % 3]
        if rng.random() < 0.15:
            angle = rng.uniform(0, np.pi)
            direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        shrink = 0.7 if kind in ("equibiaxial", "biaxial") else 1.0
        reach = shrink * rng.uniform(0.9, 1.1)
        levels, holds = _levels(rng, style, reach * pull, reach * push * (0.75 if held_out else 1.0))
        fast = rate * np.exp(rng.uniform(-0.7, 0.7) + (rng.choice([0.0, 0.9]) if held_out else 0.0))
        time, drive = path(levels, fast, holds, 0.04, 1.0)
        if len(time) > 1000:
            time, drive = path(levels, fast, holds, 0.1, 1.0)
        if kind == "biaxial":
            drive = np.stack([drive, 1 + rng.uniform(0.3, 0.7) * (drive - 1)], -1)
        elif kind == "simple-shear":
            drive = 1.3 * (drive - 1)
        round_one = kind == "uniaxial"
        area, height = (AREA, HEIGHT) if round_one else (5.04e-4, 0.014)
        found.append(Trial(f"r{i + 1}", kind, time, drive, direction, start, area, height, DIAMETER))
        start += gap * float(np.round(rng.uniform(0.8, 1.3), 2))
    return found
