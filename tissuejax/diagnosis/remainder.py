"""What is still missing, described as data: the remainder as a smooth function of drive, rate and time.

    residual(t) = a(drive) + b(signed root of the rate) + c(time in the recording) + noise,

each a cubic spline with a ridge on its bends, all fitted together, the ridge chosen by generalised cross-validation. No
physics: something for a researcher to look at, with the size of each part saying where to look first.

Source: Hastie and Tibshirani 1990, Generalized Additive Models; Golub, Heath and Wahba 1979, Technometrics 21 (GCV).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from tissuejax.diagnosis.bench import Bench, Segment


@dataclass(frozen=True)
class Remainder:
    """The smooth part of what a prediction leaves, for one channel.

    Attributes:
        channel, unit: which series.
        curves: {"drive" | "rate" | "time": {"x", "value"}}; time has one curve a recording under "time/NAME".
        share: fraction of the residual's variance that each part holds.
        series: {recording: {"time", "drive", "rate", "remainder", "smooth"}}.
    """

    channel: str
    unit: str
    curves: dict[str, dict[str, list[float]]]
    share: dict[str, float]
    series: dict[str, dict[str, list[float]]]

    def as_dict(self) -> dict:
        """Plain lists, SI."""
        return {
            "channel": self.channel,
            "unit": self.unit,
            "share_of_variance": self.share,
            "curves": self.curves,
            "series": self.series,
        }


def _basis(x: Float[np.ndarray, " n"], low: float, high: float, k: int) -> Float[np.ndarray, "n k"]:
    """Cubic B-splines on k - 3 equal intervals."""
    knots = np.concatenate([[low] * 3, np.linspace(low, high, k - 2), [high] * 3])
    return BSpline.design_matrix(np.clip(x, low, high), knots, 3).toarray()


def _rate(s: Segment) -> np.ndarray:
    rate = np.gradient(s.drive, s.time)
    return np.sign(rate) * np.sqrt(np.abs(rate))


def remainder(bench: Bench, prediction: Float[np.ndarray, " N"], channel: str, component: str = "") -> Remainder:
    """Additive smooth description of measured - predicted over all recordings of one channel."""
    segments = [s for s in bench.segments if s.channel == channel and s.component == component]
    r = np.concatenate([(bench.y - prediction)[s.rows] for s in segments])
    sigma = np.concatenate([bench.sigma[s.rows] for s in segments])
    drive, rate = np.concatenate([s.drive for s in segments]), np.concatenate([_rate(s) for s in segments])
    blocks = {"drive": _basis(drive, drive.min(), drive.max() + 1e-12, 12)}
    blocks["rate"] = _basis(rate, rate.min(), rate.max() + 1e-12, 9)
    at = 0
    for s in segments:
        block = np.zeros((len(r), 16))
        block[at : at + len(s.time)] = _basis(s.time, s.time[0], s.time[-1] + 1e-12, 16)
        blocks[f"time/{s.recording}"] = block
        at += len(s.time)
    whole = np.concatenate([b / sigma[:, None] for b in blocks.values()], axis=1)
    bends = []
    for b in blocks.values():
        d = np.diff(np.eye(b.shape[1]), 2, axis=0)
        bends.append(d.T @ d + 1e-3 * np.eye(b.shape[1]))
    ridge = np.zeros((whole.shape[1],) * 2)
    at = 0
    for p in bends:
        ridge[at : at + len(p), at : at + len(p)] = p
        at += len(p)
    coefficients = _gcv(whole, r / sigma, ridge)
    parts, curves, at = {}, {}, 0
    for name, b in blocks.items():
        parts[name] = b @ coefficients[at : at + b.shape[1]]
        at += b.shape[1]
        if "/" not in name:
            x = {"drive": drive, "rate": np.sign(rate) * rate**2}[name]
            order = np.argsort(x)[:: max(len(x) // 100, 1)]
            curves[name] = {"x": x[order].tolist(), "value": parts[name][order].tolist()}
    smooth = sum(parts.values())
    variance = float(np.sum(r**2)) or 1.0
    share = {
        "drive": float(np.sum(parts["drive"] ** 2)) / variance,
        "rate": float(np.sum(parts["rate"] ** 2)) / variance,
    }
    share["time"] = float(np.sum(sum(v for n, v in parts.items() if "/" in n) ** 2)) / variance
    series, at = {}, 0
    for s in segments:
        rows = slice(at, at + len(s.time))
        at = rows.stop
        series[s.recording] = {
            "time": s.time.tolist(),
            "drive": s.drive.tolist(),
            "rate": (np.sign(rate[rows]) * rate[rows] ** 2).tolist(),
            "remainder": r[rows].tolist(),
            "smooth": smooth[rows].tolist(),
        }
        part = parts[f"time/{s.recording}"][rows]
        curves[f"time/{s.recording}"] = {"x": s.time[::5].tolist(), "value": part[::5].tolist()}
    return Remainder(f"{channel} {component}".strip(), segments[0].unit, curves, share, series)


def _gcv(a: np.ndarray, r: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Ridge solution with the strength that generalised cross-validation likes best."""
    gram, right, n = a.T @ a, a.T @ r, len(r)
    best, answer = np.inf, np.zeros(a.shape[1])
    for strength in np.geomspace(1e-2, 1e5, 15):
        inverse = np.linalg.inv(gram + strength * ridge)
        c = inverse @ right
        left = r - a @ c
        value = n * float(left @ left) / max(n - float(np.sum(inverse * gram)), 1.0) ** 2
        if value < best:
            best, answer = value, c
    return answer
