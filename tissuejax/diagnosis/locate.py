"""Where the misfit is: recording, channel, phase, time window, stretch or depth, period, and whether history matters.

All shares are shares of the excess, the sum of squared residuals over noise beyond what noise alone would give, so they
say where the physics is missing and not where the signal is large. Shares of one kind add up to one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.periodogram import periodogram
from tissuejax.estimation.series import Segment

CYCLES_SHOWN = 2.0  # fewer periods in a recording are no period: any single press looks like one
PHASES = ("rest", "loading", "hold", "unloading")


@dataclass(frozen=True)
class Located:
    """One place of the misfit, as in `result.json`.

    Attributes:
        channel, recording: where; "all" for a statement about all of them.
        what: in words, with numbers.
        share: of the misfit, 0 to 1.
        kind: "recording", "phase", "window", "period", "drive", "history", "marker" or "region".
        details: numbers behind the words, SI.
    """

    channel: str
    recording: str
    what: str
    share: float
    kind: str
    details: dict

    def as_dict(self) -> dict:
        """As in `result.json`."""
        return {
            "channel": self.channel,
            "recording": self.recording,
            "what": self.what,
            "share": round(float(self.share), 4),
            "kind": self.kind,
            **self.details,
        }


def rest_value(segment: Segment) -> float:
    """The drive of the untouched specimen: stretch 1, otherwise 0."""
    return 1.0 if segment.drive_name == "stretch" else 0.0


def phases(segment: Segment) -> np.ndarray:
    """Index into PHASES for every sample, from the rate of the drive (smoothed over five samples)."""
    x = segment.drive - rest_value(segment)
    span = np.max(np.abs(x)) or 1.0
    rate = np.gradient(uniform_filter1d(x, 5, mode="nearest"), segment.time)
    quick = np.quantile(np.abs(rate), 0.9) or 1.0
    moving = np.abs(rate) > 0.08 * quick
    away = np.abs(x) > 0.03 * span
    out = np.where(moving & (rate * x > 0), 1, np.where(moving & away, 3, np.where(away, 2, 0)))
    return np.where(moving & ~away & (rate * x <= 0), 0, out)


def excess(z: Float[np.ndarray, " n"], expected: float = 1.0) -> float:
    """Sum of squares beyond what noise gives, not below zero."""
    return max(float(np.sum(z**2 - expected)), 0.0)


def locate(bench: Bench, prediction: Float[np.ndarray, " N"], recordings: Sequence[str] | None = None) -> list[Located]:
    """Statements about where `prediction` misses, largest share first within each kind."""
    names = recordings or (*bench.fitted, *bench.held_out)
    z = (bench.y - prediction) / bench.sigma
    segments = [s for s in bench.segments if s.recording in names]
    total = sum(excess(z[s.rows]) for s in segments) or 1.0
    out: list[Located] = []
    out += _where(segments, z, total)
    out += _markers(segments, z, total)
    scalar = [s for s in segments if not s.component.startswith("marker")]
    for channel in dict.fromkeys(s.channel for s in scalar):
        own = [s for s in scalar if s.channel == channel]
        out += _phases(own, z)
        out += _drive(own, z)
        out += _history(own, z)
    out += [w for s in scalar for w in _window(s, z, total)]
    for channel in dict.fromkeys(s.channel for s in segments):
        out += _period([s for s in segments if s.channel == channel], z)
    return out


def _where(segments: list[Segment], z: np.ndarray, total: float) -> Iterable[Located]:
    sums: dict[tuple[str, str], float] = {}
    for s in segments:
        name = s.channel if s.component.startswith("marker") else s.label
        sums[name, s.recording] = sums.get((name, s.recording), 0.0) + excess(z[s.rows])
    for (channel, recording), e in sorted(sums.items(), key=lambda kv: -kv[1]):
        yield Located(channel, recording, f"{e / total:.0%} of the misfit", e / total, "recording", {})


def _markers(segments: list[Segment], z: np.ndarray, total: float) -> Iterable[Located]:
    sums: dict[str, float] = {}
    for s in segments:
        if s.component.startswith("marker"):
            name = " ".join(s.component.split()[:2])
            sums[name] = sums.get(name, 0.0) + excess(z[s.rows])
    for name, e in sorted(sums.items(), key=lambda kv: -kv[1])[:3]:
        if e / total > 0.02:
            yield Located("markers", "all", name, e / total, "marker", {"marker": int(name.split()[1])})


def _phases(segments: list[Segment], z: np.ndarray) -> Iterable[Located]:
    sums, counts = np.zeros(4), np.zeros(4)
    for s in segments:
        p = phases(s)
        for i in range(4):
            sums[i] += np.sum(z[s.rows][p == i] ** 2 - 1)
            counts[i] += np.sum(p == i)
    sums = np.maximum(sums, 0)
    if sums.sum() <= 0:
        return
    for i in np.argsort(-sums):
        if counts[i]:
            share = float(sums[i] / sums.sum())
            ratio = share / float(counts[i] / counts.sum())
            what = f"{PHASES[i]}: {ratio:.1f} times its share of the samples"
            yield Located(segments[0].channel, "all", what, share, "phase", {"phase": PHASES[i], "density": ratio})


def _drive(segments: list[Segment], z: np.ndarray) -> Iterable[Located]:
    x = np.concatenate([s.drive - rest_value(s) for s in segments])
    e = np.concatenate([z[s.rows] ** 2 - 1 for s in segments])
    edges = np.linspace(x.min(), x.max(), 7)
    which = np.clip(np.digitize(x, edges) - 1, 0, 5)
    sums = np.maximum(np.bincount(which, e, 6), 0)
    if sums.sum() <= 0:
        return
    first = segments[0]
    for i in np.argsort(-sums)[:2]:
        low, high = edges[i] + rest_value(first), edges[i + 1] + rest_value(first)
        what = f"{first.drive_name} {low:.4g} to {high:.4g} {first.drive_unit}".removesuffix(" 1")
        details = {"from": float(low), "to": float(high), "unit": first.drive_unit}
        yield Located(first.channel, "all", what, sums[i] / sums.sum(), "drive", details)


def _history(segments: list[Segment], z: np.ndarray) -> Iterable[Located]:
    """Share of the misfit that is a function of the drive alone, the same on loading and unloading."""
    inside = whole = 0.0
    for s in segments:
        r = z[s.rows]
        edges = np.quantile(s.drive, np.linspace(0, 1, 26)[1:-1])
        which = np.digitize(s.drive, np.unique(edges))
        count = np.bincount(which)
        means = np.bincount(which, r) / np.maximum(count, 1)
        inside += max(float(np.sum(means[which] ** 2)) - np.sum(count > 0), 0.0)
        whole += excess(r)
    if whole > 0:
        share = min(inside / whole, 1.0)
        what = f"{share:.0%} is a function of {segments[0].drive_name} alone (the same on loading and unloading)"
        yield Located(segments[0].channel, "all", what, share, "history", {})


def _window(s: Segment, z: np.ndarray, total: float) -> Iterable[Located]:
    """The shortest stretch of time that holds half of the series' excess, where it is concentrated."""
    e = np.maximum(uniform_filter1d(z[s.rows] ** 2 - 1, max(len(s.time) // 60, 3), mode="nearest"), 0)
    if excess(z[s.rows]) < 0.05 * total or e.sum() <= 0:
        return
    c = np.concatenate([[0.0], np.cumsum(e) / e.sum()])
    stop = np.searchsorted(c, c[:-1] + 0.5)
    stop = np.where(stop < len(c), stop, 10 * len(c))
    i = int(np.argmin(stop - np.arange(len(stop))))
    j = min(int(stop[i]), len(s.time)) - 1
    if (s.time[j] - s.time[i]) < 0.4 * (s.time[-1] - s.time[0]):
        p = PHASES[int(np.bincount(phases(s)[i : j + 1], minlength=4).argmax())]
        what = f"half of it between {s.time[i]:.4g} and {s.time[j]:.4g} s (mostly {p})"
        share = 0.5 * excess(z[s.rows]) / total
        details = {"from": float(s.time[i]), "to": float(s.time[j]), "unit": "s", "phase": p}
        yield Located(s.label, s.recording, what, share, "window", details)


def _period(segments: list[Segment], z: np.ndarray) -> Iterable[Located]:
    """A period common to all series, phases free, that explains most of what is left after slow trends."""
    if not segments:
        return
    frequencies, power, whole = periodogram([(s.time - s.time[0], z[s.rows]) for s in segments])
    n = sum(len(s.time) for s in segments)
    if whole <= 1.05 * n or not len(frequencies):
        return
    best = int(np.argmax(power))
    share = float((power[best] - 2 * len(segments)) / (whole - n))
    cycles = frequencies[best] * max(s.time[-1] - s.time[0] for s in segments)
    if share > 0.5 and cycles >= CYCLES_SHOWN:
        period = 1 / frequencies[best]
        what = f"a period of {period:.3g} s ({frequencies[best]:.3g} Hz)"
        details = {"period": float(period), "frequency": float(frequencies[best]), "unit": "s"}
        yield Located(segments[0].channel, "all", what, min(share, 1.0), "period", details)
