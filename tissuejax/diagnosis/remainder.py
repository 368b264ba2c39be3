"""What is still missing, described as data: the remainder as a smooth function of drive, rate, time and place.

    residual(t) = constant + a(drive) + b(signed root of the rate) + c(time in the recording) + noise,

each a cubic spline with a ridge on its bends, all fitted together, the ridge chosen by generalised cross-validation; a
and b have no mean over the samples, c has one of its own in every recording and none over all. Where markers lie on a
surface, their remainder under the deepest probe is a smooth function of their place at rest, bells with a ridge.
No physics: something for a researcher to look at, with the size of each part saying where to look first.

Source: Hastie and Tibshirani 1990, Generalized Additive Models; Golub, Heath and Wahba 1979, Technometrics 21 (GCV).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import BSpline

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.locate import rest_value
from tissuejax.estimation.series import Segment


@dataclass(frozen=True)
class Remainder:
    """The smooth part of what a prediction leaves, for one channel.

    Attributes:
        channel, unit: which series.
        constant: mean of the smooth part, in `unit`.
        curves: {"drive" | "rate" | "time/RECORDING": {"x", "value"}}, in order of x; x in SI.
        share: fraction of the residual's sum of squares that each part accounts for, "noise" what none does.
        series: {recording: {"time", "drive", "rate", "remainder", "smooth"}}.
    """

    channel: str
    unit: str
    constant: float
    curves: dict[str, dict[str, list[float]]]
    share: dict[str, float]
    series: dict[str, dict[str, list[float]]]

    def as_dict(self) -> dict:
        """Plain lists, SI."""
        return {
            "channel": self.channel,
            "unit": self.unit,
            "constant": self.constant,
            "share_of_squares": self.share,
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
    # stretch and shear of several kinds of test meet as strains
    mixed = len({s.drive_name for s in segments}) > 1
    drive = np.concatenate([s.drive - (rest_value(s) if mixed else 0.0) for s in segments])
    rate = np.concatenate([_rate(s) for s in segments])
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
    parts, at = {}, 0
    for name, b in blocks.items():
        parts[name] = b @ coefficients[at : at + b.shape[1]]
        at += b.shape[1]
    smooth = sum(parts.values())
    timed = sum(v for n, v in parts.items() if "/" in n)
    whole_parts = {"drive": parts["drive"], "rate": parts["rate"], "time": timed}
    constant = float(sum(v.mean() for v in whole_parts.values()))
    squares = float(np.sum(r**2)) or 1.0
    # covariance with the whole smooth part: shares of parts that overlap then add up
    centred = smooth - smooth.mean()
    share = {name: float((v - v.mean()) @ centred) / squares for name, v in whole_parts.items()}
    share |= {"constant": len(r) * constant**2 / squares, "noise": float(np.sum((r - smooth) ** 2)) / squares}
    curves = {}
    for name, x in (("drive", drive), ("rate", np.sign(rate) * rate**2)):
        order = np.argsort(x, kind="stable")[:: max(len(x) // 100, 1)]
        curves[name] = {"x": x[order].tolist(), "value": (parts[name] - parts[name].mean())[order].tolist()}
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
        part = (timed - timed.mean())[rows]
        every = max(len(part) // 100, 1)
        curves[f"time/{s.recording}"] = {"x": s.time[::every].tolist(), "value": part[::every].tolist()}
    return Remainder(f"{channel} {component}".strip(), segments[0].unit, constant, curves, share, series)


@dataclass(frozen=True)
class PlaceRemainder:
    """What a prediction leaves of markers on a surface, under the deepest probe of one recording.

    Attributes:
        recording: which.
        markers: their numbers.
        place: where they lie at rest, m, one row a marker.
        remainder, smooth: measured - predicted displacement, m, and its smooth part.
        share: of the squares of the remainder that is smooth in place.
    """

    recording: str
    markers: tuple[int, ...]
    place: Float[np.ndarray, "k 3"]
    remainder: Float[np.ndarray, "k 3"]
    smooth: Float[np.ndarray, "k 3"]
    share: float

    def as_dict(self) -> dict:
        """Plain lists, SI."""
        return {
            "channel": "markers",
            "unit": "m",
            "recording": self.recording,
            "markers": list(self.markers),
            "place": self.place.tolist(),
            "remainder": self.remainder.tolist(),
            "smooth": self.smooth.tolist(),
            "share_of_squares": self.share,
        }


def over_places(bench: Bench, prediction: Float[np.ndarray, " N"], recording: str) -> PlaceRemainder | None:
    """The remainder of a recording's markers as a smooth function of their place; None without markers.

    The mean over the samples whose depth is at least 0.8 of the largest; the place is the marker's first sample.
    """
    found: dict[int, dict[str, Segment]] = {}
    for s in bench.segments:
        if s.recording == recording and s.component.startswith("marker"):
            number, axis = s.component.split()[1:]
            found.setdefault(int(number), {})[axis] = s
    found = {k: v for k, v in found.items() if set(v) == {"x", "y", "z"}}
    if len(found) < 4:
        return None

    def mean(s: Segment) -> float:
        deep = s.drive >= 0.8 * np.max(s.drive)
        return float(np.mean((bench.y - prediction)[s.rows][deep]))

    place = np.array([[bench.y[v[a].rows][0] for a in "xyz"] for v in found.values()])
    left = np.array([[mean(v[a]) for a in "xyz"] for v in found.values()])
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    width = 2 * float(np.median(np.sort(apart, axis=1)[:, 1]))
    bells = np.column_stack([np.ones(len(place)), np.exp(-0.5 * (apart / width) ** 2)])
    ridge = np.diag([1e-9, *np.ones(len(place))])
    smooth = np.column_stack([bells @ _gcv(bells, left[:, i], ridge) for i in range(3)])
    share = 1 - float(np.sum((left - smooth) ** 2)) / (float(np.sum(left**2)) or 1.0)
    return PlaceRemainder(recording, tuple(found), place, left, smooth, share)


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
