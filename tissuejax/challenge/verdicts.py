"""One case's answer held against its key: what was right, what was wrong, and the error on the held-out recording."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tissuejax.challenge.places import channels_found

SETTLED = ("found", "found-in-part", "ambiguous")  # verdicts that name something


@dataclass(frozen=True)
class Mark:
    """How one case was answered.

    Attributes:
        name, category: the case.
        truth: effects in it (outside the catalogue for "unknown").
        verdict, named: the answer and the effects it added, in order.
        alternatives: names offered instead.
        size: of the weakest effect, rms over noise after a refit of the base; nan for none.
        plain: all laws like the catalogue's.
        member: all laws exact members of its forms; None where the key does not say.
        correlated: serially correlated noise.
        first: the first named effect is in it.
        exact: all effects named and no other (effects said to be tolerated aside).
        all_named: all effects named, whatever else.
        open_right: exact, or ambiguous with the truth among what was offered.
        right: what this category asks for: nothing, the exact set, or abstention.
        apt: whether the answer as such is true, which is what its stated probability is of: "found-in-part" of some of
            the effects, or of all where the laws are others than the catalogue's; "ambiguous" with the truth offered.
        tried: whether a set with exactly these effects was fitted; None where none act, or no sets are listed.
        held_out_ratio: rms error on the held-out recording over that of the truth itself; nan if not reported.
        confidence: as stated, or nan.
        seconds: wall time.
        channels: (right, false, missed) channels of a probing's misfit; None where the key names none.
    """

    name: str
    category: str
    truth: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    alternatives: tuple[str, ...]
    size: float
    plain: bool
    member: bool | None
    correlated: bool
    first: bool
    exact: bool
    all_named: bool
    open_right: bool
    right: bool
    apt: bool
    tried: bool | None
    held_out_ratio: float
    confidence: float
    seconds: float
    channels: tuple[int, int, int] | None


# One law of the challenge is another effect in a probing or a cut than in a material test; sealed keys have its name.
ALIKE = {"force-drift": "drift", "cutting-drift": "drift", "support-motion": "periodic"}


def names_in(found: object) -> tuple[str, ...]:
    """Effect names in a list of names, of {"name": ...} or of lists of either, flattened in order, each once."""
    if isinstance(found, str):
        return tuple(ALIKE.get(p.strip(), p.strip()) for p in found.split("+"))
    if isinstance(found, dict):
        inner = found.get("name", found.get("effects", found.get("names", ())))
        return names_in(inner)
    flat = [name for item in (found or ()) for name in names_in(item)]
    return tuple(dict.fromkeys(flat))


def tried(truth: Sequence[str], result: dict) -> bool | None:
    """Whether a set with exactly these effects was fitted; None where the result doesn't list its sets."""
    if not isinstance(result.get("sets"), list):
        return None
    fitted = ({ALIKE.get(n, n) for n in (k.split("/")[0] for k in s["effects"])} for s in result["sets"])
    return any(names == set(truth) for names in fitted)


def held_out_ratio(key: dict, result: dict) -> float:
    """Rms error of the repaired model on the held-out recording over that of the model that is the truth.

    Channels are pooled in units of their noise, by `chi2_per_sample` of the result's "after".
    """
    name = key["held_out"]
    after = (result.get("after") or {}).get(name) or {}
    truth = key["truth_error_over_noise"][name]
    pairs = []
    for channel, numbers in after.items():
        if not isinstance(numbers, dict) or numbers.get("chi2_per_sample") is None:
            continue
        known = truth.get(channel) if isinstance(truth, dict) else truth
        if known:
            pairs.append((numbers["chi2_per_sample"], known**2))
    if not pairs:
        return math.nan
    return float(np.sqrt(sum(a for a, _ in pairs) / sum(b for _, b in pairs)))


def mark(name: str, key: dict, result: dict, seconds: float = math.nan) -> Mark:
    """Compare an answer with the key."""
    category, truth = key["category"], tuple(key["effects"])
    named = names_in(result.get("effects"))
    offered = names_in(result.get("alternatives"))
    verdict = str(result.get("verdict"))
    tolerated = set(key.get("tolerated", ()))
    counted = set(named) - (tolerated - set(truth))
    settled = verdict in SETTLED
    exact = settled and counted == set(truth) and bool(truth)
    ambiguous = verdict == "ambiguous" and bool(truth) and set(truth) <= counted | set(offered)
    if category == "none":
        right = verdict == "nothing-missing"
    elif category == "unknown":
        right = verdict == "unexplained"
    else:
        right = exact
    plain = all(key.get("plain", {}).values())
    in_part = bool(counted) and (counted < set(truth) or (exact and not plain))
    apt = {
        "nothing-missing": category == "none",
        "found": exact,
        "found-in-part": in_part and category != "unknown",
        "ambiguous": ambiguous,
        "unexplained": category == "unknown",
    }.get(verdict, False)
    sizes = [s for s in key["size_over_noise"].values() if s is not None]
    return Mark(
        name=name,
        category=category,
        truth=truth,
        verdict=verdict,
        named=named,
        alternatives=offered,
        size=min(sizes) if sizes else math.nan,
        plain=plain,
        member=all(key["member"].values()) if "member" in key else None,
        correlated=any(key.get("noise", {}).get(k, 0.0) > 0 for k in ("correlation", "corner")),
        first=settled and bool(named) and named[0] in truth,
        exact=exact,
        all_named=settled and bool(truth) and set(truth) <= set(named),
        open_right=exact or ambiguous,
        right=right,
        apt=apt,
        tried=tried(truth, result) if truth and category != "unknown" else None,
        held_out_ratio=held_out_ratio(key, result),
        confidence=_number(result.get("confidence")),
        seconds=seconds,
        channels=channels_found(key, result),
    )


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
