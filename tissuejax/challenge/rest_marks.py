"""One answer to a case with a rest held against its key: effects named in spite of it, its size, its place."""

import math
from dataclasses import dataclass

from tissuejax.challenge.places import agreement, channels_found, stated
from tissuejax.challenge.verdicts import SETTLED, names_in, tried

NO_PROCESS = ("energy-form", "specimen-scatter")  # claim no process in tissue or rig; reported apart on a rest alone
FACTOR = 1.5  # within which the size of a rest counts as right


@dataclass(frozen=True)
class RestMark:
    """How one case with a rest was answered.

    Attributes:
        name, category: the case ("one", "two", "rest").
        truth: effects in it.
        laws: of the rest.
        ratio: rest over the weakest effect, or over the size that an effect would have had.
        alike: two effects that look alike.
        verdict, named: the answer.
        best: names of the best attempt, given or not.
        wrong: names neither of an effect in it nor true of a law of its rest.
        right: all effects named and no wrong name; on a rest alone no wrong physical name.
        apt: whether the answer as such is true: for "ambiguous" the truth is among those offered, for "unexplained" and
            "nothing-missing" no effect of the catalogue acts, for a name given it is true; what confidence is about.
        tried: whether a set with exactly these effects was fitted; None where the result doesn't list its sets.
        rest_over_true: stated size of the rest over the true one, rms; nan where none is stated. What of the rest has
            been given a name, true as it may be, is not in what is stated.
        beside_true: the same of what was weighed beside exactly the true effects, whatever the answer; nan where that
            set was not weighed.
        where: (right, false, missed) places, recordings and phases together.
        channels: the same of a probing's channels; None where the key names none.
        confidence: as stated, or nan.
        kept_ratio: rms error on the recording that nothing read over the rms of the true rest there; nan if unknown,
            or where a case keeps none back (probings).
        seconds: wall time.
    """

    name: str
    category: str
    truth: tuple[str, ...]
    laws: tuple[str, ...]
    ratio: float
    alike: bool
    verdict: str
    named: tuple[str, ...]
    best: tuple[str, ...]
    wrong: tuple[str, ...]
    right: bool
    apt: bool
    tried: bool | None
    rest_over_true: float
    beside_true: float
    where: tuple[int, int, int]
    channels: tuple[int, int, int] | None
    confidence: float
    kept_ratio: float
    seconds: float


def rest_size(result: dict) -> float:
    """Rms of the rest that a result states, in the unit of what was measured; nan where it states none, or one over
    forces and markers together, which no key has."""
    rest = result.get("rest")
    if isinstance(rest, dict) and rest.get("unit") == "1":
        return math.nan
    value = rest.get("rms") if isinstance(rest, dict) else None
    return float(value) if isinstance(value, int | float) else math.nan


def rest_beside(truth: tuple[str, ...], result: dict, evidence: dict | None) -> float:
    """Rms of the rest that was weighed beside exactly these effects, in the likeliest of their forms, in the unit of
    what was measured; nan where that set was not weighed, or its unit can't be known."""
    said, size = result.get("rest"), rest_size(result)
    share = said.get("share_of_peak") if isinstance(said, dict) else None
    sets = [s for s in (evidence or {}).get("sets", ()) if set(s["names"]) == set(truth) and _known(s["log_evidence"])]
    if not sets or not share or not math.isfinite(size):
        return math.nan
    likeliest = max(sets, key=lambda s: s["log_evidence"])
    return math.sqrt(max(likeliest["rest"][0], 0.0)) * size / share


def _known(x: object) -> bool:
    return isinstance(x, int | float) and math.isfinite(x)


def true_size(key: dict) -> float:
    """Rms of the true rest beyond what the told energy can swallow, over all samples in the file, Pa."""
    squares = sum(key["rest"]["beyond_rms"][n] ** 2 * k for n, k in key["samples"].items())
    return math.sqrt(squares / sum(key["samples"].values()))


def mark_rest(
    name: str,
    key: dict,
    result: dict,
    seconds: float = math.nan,
    kept: float = math.nan,
    evidence: dict | None = None,
) -> RestMark:
    """Compare an answer with the key.

    Args:
        kept: rms error of the prediction of the recording kept back, Pa.
        evidence: of all sets that were weighed, as a result keeps it; None where it doesn't.
    """
    truth, verdict = tuple(key["effects"]), str(result.get("verdict"))
    named = names_in(result.get("effects")) if verdict in SETTLED else ()
    best = named or names_in(result.get("best_attempt"))
    allowed = set(truth) | set(key["tolerated"]) | (set() if truth else set(NO_PROCESS))
    wrong = tuple(n for n in named if n not in allowed)
    recordings, phases = stated(result.get("located") or ())
    a, b = agreement(key["where"]["recordings"], recordings), agreement(key["where"]["phases"], phases)
    confidence, there = result.get("confidence"), key["kept_rms"]["rest"]
    offered = set(named) | set(names_in(result.get("alternatives"))) | set(best)
    if verdict == "ambiguous":
        apt = bool(truth) and set(truth) <= offered
    elif verdict in SETTLED:
        apt = bool(named) and not wrong and (verdict != "found" or set(truth) <= set(named))
    else:
        apt = not truth and verdict != "failed"
    return RestMark(
        name=name,
        category=key["category"],
        truth=truth,
        laws=tuple(key["rest"]["laws"]),
        ratio=key["rest"]["ratio"],
        alike=bool(key["alike"]),
        verdict=verdict,
        named=named,
        best=best,
        wrong=wrong,
        right=verdict != "failed" and not wrong and set(truth) <= set(named),
        apt=apt,
        tried=tried(truth, result),
        rest_over_true=rest_size(result) / true_size(key),
        beside_true=rest_beside(truth, result, evidence) / true_size(key),
        where=(a[0] + b[0], a[1] + b[1], a[2] + b[2]),
        channels=channels_found(key, result),
        confidence=float(confidence) if isinstance(confidence, int | float) else math.nan,
        kept_ratio=math.nan if there is None else kept / there,
        seconds=seconds,
    )
