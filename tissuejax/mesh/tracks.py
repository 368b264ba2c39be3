"""Marker tracks from unordered detections of a stereo camera, with gaps kept as NaN; smoothing by local polynomials."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from tissuejax.errors import InputError

MASK = 6e-3  # m, radius of the spherical mask around the last position (Lister 2012, 2.2.3.1)
FEWEST = 25  # frames below which a track is dropped (same place)


def tracks(
    detections: Sequence[Float[np.ndarray, "d 3"]], mask: float = MASK, fewest: int = FEWEST
) -> Float[np.ndarray, "m k 3"]:
    """Tracks of the markers through frames of unordered detections.

    A detection continues the track whose last seen position is nearest, within `mask`; pairs are chosen together so
    that the total distance is least. What continues nothing starts a track; one seen in fewer than `fewest` frames is
    dropped.
    Source: Lister 2012, 2.2.3.1.

    Returns:
        positions, NaN where a marker was not seen; tracks in the order of their first frame.

    Raises:
        InputError: no track lasts `fewest` frames.
    """
    last = np.zeros((0, 3))
    rows: list[list[tuple[int, np.ndarray]]] = []
    for frame, found in enumerate(detections):
        found = np.asarray(found, float).reshape(-1, 3)
        found = found[np.isfinite(found).all(1)]
        free = np.ones(len(found), bool)
        if len(last) and len(found):
            distance = np.linalg.norm(last[:, None] - found[None], axis=2)
            for i, j in zip(*linear_sum_assignment(np.where(distance <= mask, distance, 1e3 + distance))):
                if distance[i, j] <= mask:
                    rows[i].append((frame, found[j]))
                    last[i] = found[j]
                    free[j] = False
        for x in found[free]:
            rows.append([(frame, x)])
            last = np.vstack([last, x])
    kept = [row for row in rows if len(row) >= fewest]
    if not kept:
        longest = max(map(len, rows), default=0)
        raise InputError(
            f"no marker is seen in {fewest} of {len(detections)} frames (longest {longest}); widen the mask"
        )
    out = np.full((len(detections), len(kept), 3), np.nan)
    for k, row in enumerate(kept):
        for frame, x in row:
            out[frame, k] = x
    return out


def smooth(
    time: Float[np.ndarray, " n"], values: Float[np.ndarray, "n ..."], window: float, degree: int = 2
) -> Float[np.ndarray, "n ..."]:
    """Local polynomial least squares over a centred time window (uneven samples and NaN gaps allowed).

    Args:
        time, values: the series; a NaN takes no part and stays NaN.
        window: full width, s.
        degree: of the polynomial; lowered where a window holds too few samples.

    Raises:
        InputError: a window that is not positive.
    """
    if window <= 0:
        raise InputError(f"smoothing window {window} s: give a positive width")
    time, values = np.asarray(time, float), np.asarray(values, float)
    flat = values.reshape(len(time), -1)
    out = np.full_like(flat, np.nan)
    begin, end = np.searchsorted(time, time - window / 2), np.searchsorted(time, time + window / 2, side="right")
    for i, (a, b) in enumerate(zip(begin, end)):
        for c in range(flat.shape[1]):
            y = flat[a:b, c]
            seen = np.isfinite(y)
            if not np.isfinite(flat[i, c]):
                continue
            x = (time[a:b][seen] - time[i]) / window
            powers = np.vander(x, min(degree, seen.sum() - 1) + 1, increasing=True)
            out[i, c] = np.linalg.lstsq(powers, y[seen], rcond=None)[0][0]
    return out.reshape(values.shape)
