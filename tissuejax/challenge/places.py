"""Where a sample's law falls short, by recording, phase and channel: truly, and as a diagnosis says."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from jaxtyping import Int

from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strengths import columns

PHASES = ("rest", "loading", "hold", "unloading")
MOST = 0.8  # "where" is the smallest set of places that holds this share of what is missing


def missing(
    energy: str,
    fitted: list[Trial],
    stresses: list[np.ndarray],
    seen: list[Trial],
    rows: list[Int[np.ndarray, " k"]],
) -> list[np.ndarray]:
    """What the told energy leaves of noise-free stresses, fitted by least squares to the fitted recordings.

    Args:
        fitted: the fitted recordings as they were driven, before the recorder left rows out.
        stresses: of all recordings in the file, at the rows kept, Pa.
        seen, rows: all recordings of the file, and which rows of the drive they are.
    """
    every = [columns(energy, [t]) for t in seen]
    A = [np.stack(c, -1) for c in every]
    n = len(fitted)
    flat = [s.ravel() for s in stresses]
    best, *_ = np.linalg.lstsq(np.concatenate(A[:n]), np.concatenate(flat[:n]), rcond=None)
    return [(f - a @ best).reshape(s.shape) for f, a, s in zip(flat, A, stresses)]


def phases(trial: Trial) -> Int[np.ndarray, " n"]:
    """Index into PHASES for every sample: still or moving, away from rest or towards it."""
    x = trial.strain if trial.strain.ndim == 1 else trial.strain[:, 0]
    step = np.gradient(x, trial.time)
    moving = np.abs(step) > 0.05 * np.abs(step).max()
    away = np.abs(x) > 0.03 * np.abs(x).max()
    return np.where(moving, np.where(step * x >= 0, 1, 3), np.where(away, 2, 0))


def shares(seen: list[Trial], left: list[np.ndarray]) -> dict[str, dict[str, float]]:
    """Shares of the squares of `left` by recording and by phase; each adds up to one."""
    squares = [np.sum(x.reshape(len(t.time), -1) ** 2, -1) for t, x in zip(seen, left)]
    total = sum(float(s.sum()) for s in squares) or 1.0
    kinds = [phases(t) for t in seen]
    by_phase = {p: sum(float(s[k == i].sum()) for s, k in zip(squares, kinds)) / total for i, p in enumerate(PHASES)}
    return {"recordings": {t.name: float(s.sum()) / total for t, s in zip(seen, squares)}, "phases": by_phase}


def most_of(shares: Mapping[str, float]) -> list[str]:
    """The fewest places that hold MOST of the whole."""
    found, held, total = [], 0.0, sum(shares.values())
    for name, share in sorted(shares.items(), key=lambda kv: -kv[1]):
        if held >= MOST * total:
            break
        found.append(name)
        held += share
    return sorted(found)


def _share(x: Mapping) -> float:
    """Of the misfit; nothing where a result has none, because what it would be a share of broke down."""
    return float(x["share"] or 0.0)


def stated(located: Iterable[Mapping]) -> tuple[list[str], list[str]]:
    """(recordings, phases) that a result's `located` says hold most of the misfit."""
    recordings, kinds = {}, {}
    for x in located:
        if x.get("kind") == "recording":
            recordings[x["recording"]] = recordings.get(x["recording"], 0.0) + _share(x)
        elif x.get("kind") == "phase":
            name = x.get("phase") or next((p for p in PHASES if p in str(x.get("what")).split()), "")
            kinds[name] = kinds.get(name, 0.0) + _share(x)
    return most_of(recordings), most_of(kinds)


def stated_channels(located: Iterable[Mapping]) -> list[str]:
    """Channels ("force x", ..., "markers") that a result's `located` says hold most of the misfit."""
    channels: dict[str, float] = {}
    for x in located:
        if x.get("kind") == "recording":
            channels[str(x.get("channel"))] = channels.get(str(x.get("channel")), 0.0) + _share(x)
    return most_of(channels)


def channels_found(key: Mapping, result: Mapping) -> tuple[int, int, int] | None:
    """(right, false, missed) channels of a probing; None where the key names none."""
    true = key.get("where", {}).get("channels")
    return agreement(true, stated_channels(result.get("located") or ())) if true else None


def f1(counts: Iterable[tuple[int, int, int] | None]) -> float | None:
    """2 right / (2 right + false + missed) of all counts that are there (van Rijsbergen 1979); None without any."""
    right, false, missed = np.sum([c for c in counts if c is not None] or [(0, 0, 0)], axis=0)
    return float(2 * right / (2 * right + false + missed)) if right + false + missed else None


def channel_f1(counts: Sequence[tuple[int, int, int] | None]) -> dict:
    """F1 of the channels that show the misfit, over the cases whose key names any."""
    return {"f1": f1(counts), "of": sum(c is not None for c in counts)}


def agreement(true: Iterable[str], said: Iterable[str]) -> tuple[int, int, int]:
    """(right, said and not true, true and not said)."""
    a, b = set(true), set(said)
    return len(a & b), len(b - a), len(a - b)
