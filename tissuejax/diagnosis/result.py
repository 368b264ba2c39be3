"""The diagnosis as data: what `result.json` holds, and what the page and the tables are made from."""

import math
from dataclasses import dataclass, field
from importlib.metadata import version

import numpy as np

from tissuejax.cache import source
from tissuejax.diagnosis.decide import Verdict
from tissuejax.diagnosis.locate import Located, locate
from tissuejax.diagnosis.refit import Refit
from tissuejax.diagnosis.remainder import over_places, remainder
from tissuejax.diagnosis.search import Search, best_of_each
from tissuejax.diagnosis.stiffness_map import fitted_region, regions


@dataclass
class Diagnosis:
    """A finished diagnosis.

    Attributes:
        sample, energy: what was diagnosed with which base model.
        search: everything tried.
        verdict: the answer.
        seconds: wall time.
        proposals: what to measure next (`next_experiment.Proposal`), best first.
        maps: of probings: where each fitted recording wants the tissue stiffer or softer (`stiffness_map`).
        foreseen: of material tests: what the fitted recordings leave open in the held-out ones (`foreseen`).
    """

    sample: str
    energy: str
    search: Search
    verdict: Verdict
    seconds: float
    proposals: list = field(default_factory=list)
    maps: list = field(default_factory=list)
    foreseen: list = field(default_factory=list)

    def located(self) -> list[Located]:
        """Where the base model misses: in time, drive, channel, and in space where maps were made."""
        found = fitted_region(self.verdict.chosen.values, self.verdict.explained[0])
        return [*locate(self.search.bench, self.search.empty.prediction), *found, *regions(self.maps)]

    def as_dict(self) -> dict:
        """`result.json`."""
        v, s = self.verdict, self.search
        bench = s.bench
        return {
            "verdict": v.kind,
            "confidence": v.confidence,
            "reasons": list(v.reasons),
            "effects": self.effects(v.chosen) if v.kind in ("found", "ambiguous") else [],
            "best_attempt": self.effects(v.chosen) if v.kind == "unexplained" else [],
            "alternatives": self.alternatives(),
            "next_experiment": [p.as_dict() for p in self.proposals],
            "located": [x.as_dict() for x in self.located()],
            "candidates": self.candidates(),
            "sets": self.sets(1000),
            "before": self.errors(s.empty),
            "after": self.errors(v.chosen),
            "held_out_uncertainty": [x.as_dict() for x in self.foreseen],
            "base_parameters": self.base(),
            "numerical_error": self.numerical(s.empty),
            "numerical_error_after": self.numerical(v.chosen),
            "noise": {
                f"{r}/{c}": {
                    "correlated_share": n.share,
                    "correlation_time": n.tau,
                    "over_recorded": s.misfit.levels.get((r, c)),
                }
                for (r, c), n in s.misfit.noises.items()
            },
            "explained": {"fitted": v.explained[0], "held_out": v.explained[1] if bench.held_out else None},
            "fitted": list(bench.fitted),
            "held_out": list(bench.held_out),
            "sample": self.sample,
            "energy": self.energy,
            "warnings": list(bench.warnings),
            "seconds": self.seconds,
            "versions": {name: version(name) for name in ("tissuejax", "jax", "numpy", "scipy")}
            | {"source": source.LOADED},
        }

    def numerical(self, r: Refit) -> dict | None:
        """What the simulation has wrong at a fit, where that was asked."""
        known = self.search.bench.numerics.get(frozenset(r.keys))
        return known.as_dict() if known else None

    def effects(self, r: Refit) -> list[dict]:
        """Effects of a fit in the order in which they were added, with parameters, standard errors and units."""
        out, free = [], self.search.bench.free
        for key in r.keys:
            c = self.search.bench.candidates[key]
            parameters = {
                p: {"value": r.all[p], "std": r.std.get(p), "unit": free[p].unit, "at_bound": p in r.at_bound}
                for p in (*c.paths, *c.held)
                if p in r.all
            }
            out.append({"name": c.name, "form": c.form, "parameters": parameters})
        return out

    def alternatives(self) -> list[dict]:
        """Sets that these data can't tell from the chosen one."""
        candidates = self.search.bench.candidates
        return [
            {
                "effects": [candidates[k].name for k in r.keys],
                "forms": list(r.keys),
                "criterion_above_chosen": self.search.criterion(r) - self.search.criterion(self.verdict.chosen),
                "parameters": self.effects(r),
            }
            for r in self.verdict.rivals
        ]

    def candidates(self) -> list[dict]:
        """Every effect tried: score at the base fit, best refit alone, in the chosen company, correlation."""
        s = self.search
        first = {x.key: x for x in s.scored.get(frozenset(), [])}
        directions = {k: x.direction for k, x in first.items() if np.any(x.direction)}
        out = []
        for key, c in s.bench.candidates.items():
            x, alone = first.get(key), s.refits.get(frozenset({key}))
            if x is None and alone is None:
                continue
            near = {
                k: float(abs(directions[key] @ d))
                for k, d in directions.items()
                if key in directions and s.bench.candidates[k].name != c.name
            }
            closest = max(near, key=near.get) if near else None
            out.append(
                {
                    "name": c.name,
                    "form": c.form,
                    "score": x.gain if x else None,
                    "score_share": x.share if x else None,
                    "refit_chi2_per_sample": alone.chi2 / alone.n if alone else None,
                    "criterion": s.criterion(alone) - s.criterion(s.empty) if alone else None,
                    "held_out_chi2_per_sample": alone.held / alone.n_held if alone and alone.n_held else None,
                    "most_like": closest,
                    "correlation": near.get(closest) if closest else None,
                    "chosen": key in self.verdict.chosen.keys,
                }
            )
        return sorted(out, key=lambda c: c["criterion"] if c["criterion"] is not None else math.inf)

    def sets(self, most: int = 10) -> list[dict]:
        """The best sets of effects, each in its best form, with what they reach; the criterion above the best one's."""
        s = self.search
        best = min(s.criterion(r) for r in s.refits.values())
        return [
            {
                "effects": list(s.refits[k].keys),
                "criterion": s.criterion(s.refits[k]) - best,
                "information_criterion": s.refits[k].chi2 + s.inside(s.refits[k]),
                "chi2_per_sample": s.refits[k].chi2 / s.refits[k].n,
                "held_out_chi2_per_sample": s.refits[k].held / s.refits[k].n_held if s.refits[k].n_held else None,
            }
            for k in best_of_each(s)[:most]
        ]

    def errors(self, r: Refit) -> dict:
        """Per recording and channel: rmse, unit, chi-square per sample, number of samples, fitted or held out."""
        bench, out = self.search.bench, {}
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
        bench, before, after = self.search.bench, self.search.empty, self.verdict.chosen
        return {
            p: {
                "before": before.values[p],
                "before_std": before.std.get(p),
                "after": after.values[p],
                "after_std": after.std.get(p),
                "unit": bench.free[p].unit,
            }
            for p in bench.base
        }

    def remainders(self) -> list[dict]:
        """What the chosen model leaves, as smooth functions, channel by channel."""
        bench = self.search.bench
        kinds = dict.fromkeys((s.channel, s.component) for s in bench.segments if "marker" not in s.component)
        left = self.verdict.chosen.prediction
        places = [over_places(bench, left, r) for r in (*bench.fitted, *bench.held_out)]
        smooth = [remainder(bench, left, c, k) for c, k in kinds]
        return [part.as_dict() for part in (*smooth, *places) if part is not None]
