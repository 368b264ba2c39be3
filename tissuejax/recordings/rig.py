"""From a test rig's raw signals to stretch and nominal stress, as in the source's ex vivo work (Lister 2012, 2.1.3).

A frozen cylinder of tissue thaws, settles under its own weight, and is compressed between plates while a camera
watches its side; a load cell gives force, a circuit the moment of contact. SI throughout.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.errors import InputError
from tissuejax.recordings.checks import increasing

Series = Float[np.ndarray, " n"]


def thawed_area(frozen_radius: float, frozen_height: float, thawed_height: float) -> float:
    """Area of the thawed specimen, m^2: A = V/h with the volume V = pi r_f^2 h_f kept through thawing.

    Source: Lister 2012, section 2.1.3 (compression test).
    """
    for name, value in (("frozen_radius", frozen_radius), ("frozen_height", frozen_height)):
        if not value > 0:
            raise InputError(f"{name} = {value} m; expected a length above zero")
    if not thawed_height > 0:
        raise InputError(f"thawed_height = {thawed_height} m; expected a length above zero")
    return np.pi * frozen_radius**2 * frozen_height / thawed_height


def settled_stretch(
    stretch: Float[np.ndarray, "..."], frozen_height: float, thawed_height: float
) -> Float[np.ndarray, "..."]:
    """Stretch from the height before settling: stretch (from the thawed height) times h_thawed / h_frozen.

    The thawed specimen is already shortened by its weight, so the curve moves to the left. Nominal stress for
    the same reference state is force over `thawed_area(r_f, h_f, h_f)` = pi r_f^2; the source kept V/h_thawed.

    Source: Lister 2012, section 2.1.3 (correction of figure 2.16).
    """
    return stretch * (thawed_height / frozen_height)


def compression_stretch(radial_stretch: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Axial stretch l1 = 1/l2^2 of an incompressible cylinder from the radial stretch l2.

    Source: Lister 2012, section 2.1.3: l2 = l3 = l1^-1/2 (its eq. 2.1 prints 1/l2, a slip).
    """
    return 1.0 / np.square(radial_stretch)


def lowpass(
    time: Series, values: Float[np.ndarray, "n ..."], cutoff: float, order: int = 4
) -> Float[np.ndarray, "n ..."]:
    """Butterworth low-pass run forwards and backwards (`sosfiltfilt`): no delay, -3 dB at `cutoff` in Hz.

    Two passes would halve the amplitude at the cutoff, so each pass has its corner at a higher frequency
    (tan(pi f/fs) / (2^(1/2) - 1)^(1/(2 order))). Samples at uneven times are put on an even grid and back.

    Raises:
        InputError: times that don't increase, a cutoff at or above half the sampling rate, too few samples.
    """
    increasing(time, "lowpass", "time")
    step = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    rate = 1.0 / step
    if not 0 < cutoff < rate / 2:
        raise InputError(
            f"lowpass: cutoff {cutoff:g} Hz at {rate:g} samples a second; expected above 0, below {rate / 2:g} Hz"
        )
    corner = np.tan(np.pi * cutoff / rate) / (np.sqrt(2.0) - 1.0) ** (1.0 / (2 * order))
    from scipy import signal  # half of what importing this room would cost

    sos = signal.butter(order, np.arctan(corner) / np.pi * 2, output="sos")
    pad = 3 * (2 * ((order + 1) // 2) + 1)  # a section is of second order
    even = np.allclose(np.diff(time), step, rtol=1e-3)
    grid = time if even else np.linspace(time[0], time[-1], int(np.ceil((time[-1] - time[0]) / step)) + 1)
    if len(grid) <= pad:
        raise InputError(f"lowpass: {len(grid)} samples; expected more than {pad} for order {order}")
    flat = values.reshape(len(values), -1)
    if not even:
        flat = np.stack([np.interp(grid, time, column) for column in flat.T], axis=1)
    smooth = signal.sosfiltfilt(sos, flat, axis=0)
    if not even:
        smooth = np.stack([np.interp(time, grid, column) for column in smooth.T], axis=1)
    return smooth.reshape(values.shape)


def polynomial(
    x: Series, y: Series, degree: int, through: tuple[float, float] | None = None
) -> np.polynomial.Polynomial:
    """Least-squares polynomial of `degree`, exactly through one point if asked (e.g. (1, 0): no stress, no stretch).

    Raises:
        InputError: fewer distinct x than coefficients.
    """
    needed = degree + (through is None)
    distinct = len(np.unique(x if through is None else x[x != through[0]]))
    if distinct < needed:
        raise InputError(f"polynomial of degree {degree}: {distinct} distinct x; expected at least {needed}")
    if through is None:
        return np.polynomial.Polynomial.fit(x, y, degree).convert()
    # y = y0 + (x - x0) q(x) with q of one degree less, fitted with weights (x - x0).
    x0, y0 = through
    away = x != x0
    if degree < 1:
        raise InputError("polynomial through a point: degree 0; expected at least 1")
    ratio, weight = (y[away] - y0) / (x[away] - x0), np.abs(x[away] - x0)
    q = np.polynomial.Polynomial.fit(x[away], ratio, degree - 1, w=weight).convert()
    return np.polynomial.Polynomial([-x0, 1.0]) * q + y0


def contact_time(time: Series, voltage: Series, threshold: float | None = None, hold: int = 3) -> float:
    """When the circuit closed, s: the first sample beyond `threshold` that stays there for `hold` samples.

    The signal starts open; it may jump up or down. Without a threshold, half-way between the level at the start
    (median of the first 5 %, at least 3 samples) and the level farthest from it that 2 % of the samples reach.

    Source: Lister 2012, section 2.2.3 and figure 2.30.

    Raises:
        InputError: no jump: never beyond the threshold, or a level no farther off than the noise at the start.
    """
    first = voltage[: max(3, len(voltage) // 20)]
    start = float(np.median(first))
    low, high = np.quantile(voltage, [0.02, 0.98])
    closed = high if high - start >= start - low else low
    if threshold is None:
        spread = 1.4826 * float(np.median(np.abs(first - start)))
        if abs(closed - start) <= max(8 * spread, 1e-12):
            raise InputError(
                f"contact voltage stays within {abs(closed - start):.3g} V of its start; expected a jump at contact. "
                "Give a threshold, or the recording never touched"
            )
        threshold = 0.5 * (start + closed)
    beyond = (voltage > threshold) if closed >= start else (voltage < threshold)
    held = np.convolve(beyond, np.ones(hold), "valid") == hold
    if not held.any():
        raise InputError(f"contact voltage never stays beyond {threshold:.4g} V for {hold} samples; expected a jump")
    return float(time[int(np.argmax(held))])
