"""When the probe first touched: from the contact circuit's voltage, and from the force where there is none."""

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError


def from_voltage(time: Float[np.ndarray, " c"], voltage: Float[np.ndarray, " c"]) -> float:
    """Time at which the voltage crosses half-way between its open and its closed level, interpolated, s.

    The circuit may rise or fall on contact; the first sample is taken as open. The levels are the 5th and the 95th
    percentile, so a spike does not set them, and the crossing counts only if the voltage stays beyond it for three
    samples.

    Raises:
        InputError: the voltage never leaves its first level (by 5 times its scatter), so nothing was touched.
    """
    time, voltage = np.asarray(time, float), np.asarray(voltage, float)
    low, high = np.percentile(voltage, [5, 95])
    head = voltage[: max(3, len(voltage) // 50)]
    if high - low < max(5 * head.std(), 1e-9):
        raise InputError(
            f"the contact voltage stays between {voltage.min():.3g} and {voltage.max():.3g} V: no contact in it; "
            "take the contact time from the force"
        )
    level = (low + high) / 2
    beyond = (voltage > level) != (np.median(head) > level)
    runs = beyond[:-2] & beyond[1:-1] & beyond[2:]
    if not runs.any():
        raise InputError(
            "the contact voltage never stays closed for three samples; take the contact time from the force"
        )
    i = int(runs.argmax())
    if i == 0:
        raise InputError("the probe touches in the first voltage sample already; the start of contact was not recorded")
    a, b = voltage[i - 1], voltage[i]
    return float(time[i - 1] + (level - a) / (b - a) * (time[i] - time[i - 1])) if a != b else float(time[i])


def from_force(
    time: Float[np.ndarray, " n"],
    force: Float[np.ndarray, "n 3"],
    position: Float[np.ndarray, "n 3"],
    noise_std: float | None = None,
    exponent: float = 1.5,
) -> float:
    """Time of first touch by extrapolating the rise of the force back to zero, s.

    A threshold alone comes late by the depth it takes to reach it. Close to first touch F^(1 / exponent) is linear in
    depth (Hertz: 3/2), so the force between 6 times its noise (or 1 % of its peak) and a quarter of its peak is raised
    to that power, a line is fitted against the probe's height, and its root is the height of first touch.

    Args:
        time, force: of the tissue on the probe, N.
        position: of the tip's centre at the same times, m.
        noise_std: N per axis; estimated from the first tenth if None.
        exponent: of the law of the rise.

    Raises:
        InputError: no rise above the noise, or a record that starts in contact.
    """
    time, force, position = (np.asarray(v, float) for v in (time, force, position))
    size = np.linalg.norm(force - np.median(force[: max(3, len(force) // 50)], axis=0), axis=1)
    noise = noise_std if noise_std else max(size[: max(5, len(size) // 10)].std(), 1e-12)
    peak = size.max()
    floor = max(6 * noise, 0.01 * peak)
    if peak < 4 * floor:
        raise InputError(
            f"the force peaks at {peak:.3g} N over a noise of {noise:.3g} N: no contact can be found in it"
        )
    top = int((size > 0.25 * peak).argmax())
    below = np.flatnonzero(size[:top] < floor)
    if not len(below):
        raise InputError("the force is above the noise from the first sample on; the start of contact was not recorded")
    rise = np.arange(below[-1] + 1, top + 1)
    if len(rise) < 4:
        rise = np.arange(max(0, top - 4), top + 1)
    slope, offset = np.polyfit(size[rise] ** (1 / exponent), position[rise, 2], 1)
    if slope >= 0:
        raise InputError("the force does not rise while the probe goes down; check the sign of position and force")
    before = position[: top + 1, 2]
    reached = np.flatnonzero(before > offset)
    return float(time[reached[-1]]) if len(reached) else float(time[0])
