"""The diagnosis as data: what `result.json` holds, and what the page and the tables are made from."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version

import numpy as np

from tissuejax.cache import source
from tissuejax.diagnosis.judgement.answer import Answered
from tissuejax.diagnosis.judgement.evidence import SetEvidence
from tissuejax.diagnosis.judgement.judge import Kind, covering
from tissuejax.diagnosis.judgement.numbers import Numbers
from tissuejax.diagnosis.locate import Located, locate
from tissuejax.diagnosis.refit import Refit
from tissuejax.diagnosis.remainder import over_places, remainder
from tissuejax.diagnosis.stiffness_map import fitted_region, regions

USED = (
    "all recordings, those called held out too, chose the set of effects; every parameter shown, and every number for "
    "a recording held out, comes from a fit to the other recordings, with nothing fitted to the one held out"
)


@dataclass
class Diagnosis:
    """A finished diagnosis.

    Attributes:
        sample, energy: what was diagnosed with which base model.
        answered: all that was weighed, the judgement, and the fits that are shown.
        seconds: wall time.
        proposals: what to measure next (`next_experiment.Proposal`), best first.
        maps: of probings: where each fitted recording wants the tissue stiffer or softer (`stiffness_map`).
        numerics: of probings: how the simulations of what is shown went, by recording (`experiments.soundness.checks`).
        unread: of recordings that nothing has read: rms errors of the base and of what is shown, and the noise, SI.
        experiment: the kind of the recordings ("homogeneous", "probing", "cutting").
        foreseen: of material tests: what the fitted recordings leave open in the held-out ones (`foreseen`).
    """

    sample: str
    energy: str
    answered: Answered
    seconds: float
    proposals: list = field(default_factory=list)
    maps: list = field(default_factory=list)
    foreseen: list = field(default_factory=list)
    numerics: dict[str, dict[str, float]] = field(default_factory=dict)
    experiment: str = "homogeneous"
    unread: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def search(self) -> Answered:
        """All that was weighed."""
        return self.answered

    @property
    def verdict(self) -> Answered:
        """The answer."""
        return self.answered

    @property
    def repaired(self) -> dict[str, float]:
        """Values of the effects named, by path: `diagnose(sample, energy, known=found.repaired)` asks what else."""
        names = {f"effects.{n}." for n in self.answered.judgement.names}
        values = self.answered.chosen.values
        return {p: v for p, v in values.items() if p.startswith(tuple(names))} if names else {}

    def located(self) -> list[Located]:
        """Where the base model misses: in time, drive, channel, and in space where maps were made."""
        found = fitted_region(self.answered.chosen.values, self.answered.explained[0])
        return [*self._base_misses, *found, *regions(self.maps)]

    @cached_property
    def _base_misses(self) -> list[Located]:
        return locate(self.answered.bench, self.answered.empty.prediction)

    def as_dict(self) -> dict:
        """`result.json`."""
        a, bench = self.answered, self.answered.bench
        j = a.judgement
        named = j.kind.speaks
        effects = self.effects(a.chosen)
        stated = [e for e in effects if j.kind is Kind.AMBIGUOUS or e["name"] in j.names]
        return {
            "verdict": a.kind.value,
            "confidence": a.confidence,
            "probabilities": {k.value: p for k, p in j.probabilities.items()},
            "inclusion": dict(j.inclusion),
            "something_missing": j.missing,
            "exactly_these": j.exact,
            "reasons": [],
            "effects": stated if named else [],
            "best_attempt": [] if named else effects,
            "alternatives": self.alternatives(),
            "rest": a.rest(),
            "next_experiment": [p.as_dict() for p in self.proposals],
            "located": [x.as_dict() for x in self.located()],
            "candidates": self.candidates(),
            "sets": self.sets(1000),
            "before": self.errors(a.empty),
            "after": self.errors(a.chosen),
            "held_out_uncertainty": [x.as_dict() for x in self.foreseen],
            "base_parameters": self.base(),
            "interval": {"confidence": 0.95, "degrees_of_freedom": a.chosen.dof},
            "numerical_error": self._of(()).numerical,
            **({"unread": self.unread} if self.unread else {}),
            **({"numerics": self.numerics} if self.numerics else {}),
            "explained": {"fitted": a.explained[0], "held_out": a.explained[1] if bench.held_out else None},
            "fitted": list(bench.fitted),
            "held_out": list(bench.held_out),
            "used": USED,
            "sample": self.sample,
            "energy": self.energy,
            "unusual": Numbers(a.exploration.criteria).unusual(),
            "warnings": list(bench.warnings),
            "seconds": self.seconds,
            "versions": {name: version(name) for name in ("tissuejax", "jax", "numpy", "scipy")}
            | {"source": source.LOADED},
        }

    def alternatives(self) -> list[dict]:
        """Sets that these data can't tell from the chosen one, with their probability."""
        a = self.answered
        if a.judgement.kind is not Kind.AMBIGUOUS:
            return []
        return [
            {"effects": list(s.names), "forms": list(s.keys), "probability": p, "log_evidence": s.log_evidence}
            for s, p in covering(a.judgement, a.exploration.criteria)
        ]

    def candidates(self) -> list[dict]:
        """Every effect tried: score at the base fit, weighed alone, probability that it is there."""
        a = self.answered
        first = {x.key: x for x in a.scored.get(frozenset(), [])}
        base = self._of(())
        out = []
        for key, c in a.bench.candidates.items():
            x, alone = first.get(key), self._of((key,))
            if x is None and alone is None:
                continue
            out.append(
                {
                    "name": c.name,
                    "form": c.form,
                    "score": x.gain if x and math.isfinite(x.gain) else None,
                    "score_share": x.share if x else None,
                    "refit_chi2_per_sample": alone.chi2 / alone.n if alone else None,
                    "criterion": 2 * (base.log_evidence - alone.log_evidence) if alone else None,
                    "held_out_chi2_per_sample": None,
                    "most_like": None,
                    "correlation": None,
                    "inclusion": a.judgement.inclusion.get(c.name, 0.0),
                    "chosen": key in a.chosen.keys,
                }
            )
        return sorted(out, key=lambda c: c["criterion"] if c["criterion"] is not None else math.inf)

    def _of(self, keys: tuple[str, ...]) -> SetEvidence | None:
        found = self.answered.exploration.weighed.get(frozenset(keys))
        return found.evidence if found and math.isfinite(found.evidence.log_evidence) else None

    def sets(self, most: int = 10) -> list[dict]:
        """The best sets of effects, each in its best form, with their evidence and probability."""
        a, best = self.answered, {}
        for s in a.evidence.sets:
            name = " + ".join(sorted(s.names))
            if not s.void and math.isfinite(s.log_evidence):
                best[name] = max(best.get(name, s), s, key=lambda x: x.log_evidence)
        top = max(s.log_evidence for s in best.values())
        rows = [
            {
                "effects": list(s.keys),
                "probability": a.judgement.posterior.get(name, 0.0),
                "log_evidence_below_best": top - s.log_evidence,
                "criterion": 2 * (top - s.log_evidence),
                "information_criterion": s.chi2 + s.k * math.log(s.n) if math.isfinite(s.chi2) else None,
                "chi2_per_sample": s.chi2 / s.n,
                "held_out_chi2_per_sample": None,
                "rest_share_of_peak": s.rest_size,
                "explained": s.explained,
            }
            for name, s in best.items()
        ]
        return sorted(rows, key=lambda r: -r["probability"])[:most]

    def effects(self, r: Refit) -> list[dict]:
        """Effects of a fit in the order in which they were added, with parameters, standard errors and units."""
        out, free = [], self.answered.bench.free
        intervals = r.intervals
        for key in r.keys:
            c = self.answered.bench.candidates[key]
            parameters = {
                p: {
                    "value": r.all[p],
                    "std": r.std.get(p),
                    "interval": list(intervals[p]) if p in intervals else None,
                    "unit": free[p].unit,
                    "at_bound": p in r.at_bound,
                }
                for p in (*c.paths, *c.held)
                if p in r.all
            }
            out.append({"name": c.name, "form": c.form, "parameters": parameters})
        return out

    def errors(self, r: Refit) -> dict:
        """Per recording and channel: rmse, unit, chi-square per sample, number of samples, fitted or held out."""
        bench, out = self.answered.bench, {}
        left = bench.y - r.prediction
        for name in (*bench.fitted, *bench.held_out):
            channels = {}
            for channel in dict.fromkeys(s.channel for s in bench.segments if s.recording == name):
                own = [s for s in bench.segments if s.recording == name and s.channel == channel]
                e = np.concatenate([left[s.rows] for s in own])
                z = np.concatenate([left[s.rows] / bench.sigma[s.rows] for s in own])
                channels[channel] = {
                    "rmse": float(np.sqrt(np.mean(e**2))),
                    "unit": own[0].unit,
                    "chi2_per_sample": float(np.mean(z**2)),
                    "n": len(e),
                    "role": "held out" if name in bench.held_out else "fitted",
                }
            out[name] = channels
        return out

    def base(self) -> dict:
        """Base parameters before and after."""
        bench, before, after = self.answered.bench, self.answered.empty, self.answered.chosen
        around = after.intervals
        return {
            p: {
                "before": before.values[p],
                "before_std": before.std.get(p),
                "after": after.values[p],
                "after_std": after.std.get(p),
                "after_interval": list(around[p]) if p in around else None,
                "unit": bench.free[p].unit,
            }
            for p in bench.base
        }

    def remainders(self) -> list[dict]:
        """What the chosen model leaves, as smooth functions, channel by channel."""
        bench = self.answered.bench
        kinds = dict.fromkeys((s.channel, s.component) for s in bench.segments if "marker" not in s.component)
        left = self.answered.chosen.prediction
        places = [over_places(bench, left, r) for r in (*bench.fitted, *bench.held_out)]
        smooth = [remainder(bench, left, c, k) for c, k in kinds]
        return [part.as_dict() for part in (*smooth, *places) if part is not None]
