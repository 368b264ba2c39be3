"""Many specimens diagnosed one by one: what was found in how many of them, as data for a table and a figure."""

from dataclasses import dataclass, field

import numpy as np

from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.result import Diagnosis


def brief(found: Diagnosis) -> dict:
    """The verdict of one specimen in a few numbers, SI.

    Returns:
        `verdict`, `confidence`, `effects` (names in the order found), `parameters` (path: value, standard error, unit),
        `or` (sets that can't be told apart), `explained` (shares of the misfit removed: fitted, held out),
        `rmse_over_peak` (before and after, fitted and held out), `sets` (the best few), `seconds`.
    """
    v, bench, candidates = found.verdict, found.search.bench, found.search.bench.candidates
    named, said = v.kind.speaks, found.answered.judgement.names
    names = dict.fromkeys(candidates[k].name for k in v.chosen.keys)
    roles = {"fitted": bench.mask(bench.fitted), "held_out": bench.mask(bench.held_out)}

    def rmse(prediction: np.ndarray) -> dict[str, float]:
        left, peak = bench.y - prediction, float(np.max(np.abs(bench.y)))
        return {k: float(np.sqrt(np.mean(left[m] ** 2))) / peak for k, m in roles.items() if m.any()}

    return {
        "verdict": v.kind,
        "confidence": v.confidence,
        "effects": [n for n in names if v.kind is Kind.AMBIGUOUS or n in said] if named else [],
        "best_attempt": [] if named else list(v.chosen.keys),
        "parameters": {
            path: [p["value"], p["std"], p["unit"]]
            for e in found.effects(v.chosen)
            for path, p in e["parameters"].items()
        },
        "base": {path: [p["before"], p["after"], p["unit"]] for path, p in found.base().items()},
        "or": [a["effects"] for a in found.alternatives()],
        "explained": {"fitted": v.explained[0], "held_out": v.explained[1] if bench.held_out else None},
        "rmse_over_peak": {"before": rmse(found.search.empty.prediction), "after": rmse(v.chosen.prediction)},
        "sets": found.sets(4),
        "warnings": list(bench.warnings),
        "seconds": round(found.seconds, 1),
    }


@dataclass(frozen=True)
class Specimens:
    """Verdicts of many specimens.

    Attributes:
        records: `brief` by specimen.
        groups: a group for each specimen, where they fall into some (a material, a date).
    """

    records: dict[str, dict]
    groups: dict[str, str] = field(default_factory=dict)

    @property
    def verdicts(self) -> dict[str, int]:
        """How many specimens got each verdict."""
        kinds = [r["verdict"] for r in self.records.values()]
        return {k: kinds.count(k) for k in dict.fromkeys(kinds)}

    @property
    def counts(self) -> dict[str, int]:
        """In how many specimens each effect was found, most often first."""
        names = [e for r in self.records.values() for e in r["effects"]]
        return dict(sorted({n: names.count(n) for n in names}.items(), key=lambda kv: -kv[1]))

    def first(self) -> dict[str, int]:
        """How often each effect explained most, alone."""
        names = [r["effects"][0] for r in self.records.values() if r["effects"]]
        return dict(sorted({n: names.count(n) for n in names}.items(), key=lambda kv: -kv[1]))

    def sentence(self) -> str:
        """One sentence: each specimen with its verdict."""
        words = {n: " + ".join(r["effects"] or r["best_attempt"]) or "nothing" for n, r in self.records.items()}
        return "; ".join(f"{n}: {r['verdict']}, {words[n]}" for n, r in self.records.items())

    def as_dict(self) -> dict:
        """Counts and records."""
        return {
            "specimens": len(self.records),
            "verdicts": self.verdicts,
            "found_in": self.counts,
            "found_first_in": self.first(),
            "each": self.records,
        }
