"""A diagnosis in sentences: what its effects mean, what it can't tell, what to measure next; tables of parameters."""

import inspect
import math

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.effects.catalogue import effects
from tissuejax.report.scales import display, with_std
from tissuejax.report.sentences import identified


def names_of(d: Diagnosis) -> list[str]:
    """Effects of the chosen set, in order, each once."""
    return list(dict.fromkeys(d.search.bench.candidates[k].name for k in d.verdict.chosen.keys))


def next_steps(d: Diagnosis) -> list[str]:
    """What to measure next."""
    planned, kind = [p.as_dict()["sentence"] for p in d.proposals], d.verdict.kind
    if kind == "unexplained":
        look = (
            "Look at the remainder below (remainder.json): what it is a function of (drive, rate, time, place) says "
            "which recording to make next, one where that varies alone. A new effect is one file: see "
            "docs/new-effect.md."
        )
        return [*planned, look]
    if planned:
        return planned
    if not d.search.bench.held_out:
        return ["Record once more, in another way, and hold that recording out: nothing guards this verdict yet."]
    if kind == "ambiguous" or d.verdict.rivals:
        return ["No variation of these protocols tells the explanations apart well; another kind of test is needed."]
    if kind == "nothing-missing":
        return [
            "Nothing is asked for by these recordings. What they are blind to (other rates, directions, kinds of test) "
            "they can't speak of; a recording unlike these, held out, is the next test of the model."
        ]
    return [
        "No further recording is needed to tell the candidates apart. A second specimen, with the effects held at "
        "these values and only the base refitted, would show whether they belong to the material."
    ]


def meanings(d: Diagnosis) -> list[str]:
    """What each effect of the verdict is and what it is seen by."""
    known, out = effects(), []
    for name in names_of(d):
        e = known.get(name)
        if e is not None:
            text = (inspect.getdoc(e) or "").split("\n\n")[0].replace("\n", " ")
            what = f" What to do: {e.remedy}." if e.remedy else ""
            out.append(f"{name}: {text} It is seen by {e.reveals}; blind to it: {e.blind}.{what}")
    return out


def limits(d: Diagnosis) -> list[str]:
    """What this diagnosis can't tell."""
    out = list(d.search.bench.warnings)
    out.append("A wrong gain of the force sensor and a stiffness scale can't be told apart by any data of one sample.")
    if not d.search.bench.held_out:
        out.append("No recording was held out, so nothing guards against an effect that merely bends to the data.")
    return list(dict.fromkeys(out))


def parameters(d: Diagnosis) -> list[dict]:
    """Rows of the table of effects, in units that people read."""
    rows = []
    for effect in d.effects(d.verdict.chosen):
        for path, p in effect["parameters"].items():
            factor, unit = display(p["unit"], abs(p["value"]))
            rows.append(
                {
                    "effect": effect["name"],
                    "path": path,
                    "value": _value(d, path, p["value"], p["std"], factor),
                    "interval": _interval(d, path, p, factor),
                    "unit": "" if unit == "1" else unit,
                    "note": "on its bound" if p["at_bound"] else "",
                }
            )
    return rows


def base(d: Diagnosis) -> list[dict]:
    """Rows of the table of base parameters, before and after in one unit."""
    rows = []
    for path, p in d.base().items():
        factor, unit = display(p["unit"], abs(p["after"]))
        rows.append(
            {
                "path": path,
                "before": _value(d, path, p["before"], p["before_std"], factor),
                "after": _value(d, path, p["after"], p["after_std"], factor),
                "unit": "" if unit == "1" else unit,
            }
        )
    return rows


def _value(d: Diagnosis, path: str, value: float, std: float | None, factor: float) -> str:
    """Value and standard error, or words where the error says that nothing is known."""
    if std is None:
        return with_std(value / factor, None)
    known = identified(value, std, d.answered.bench.free[path].scale)
    return with_std(value / factor, std / factor if known else math.inf)


def _interval(d: Diagnosis, path: str, p: dict, factor: float) -> str:
    std, ends = p["std"], p["interval"]
    if std is None or ends is None or not identified(p["value"], std, d.answered.bench.free[path].scale):
        return ""
    return " to ".join(f"{end / factor:.4g}" for end in ends)


def places(d: Diagnosis, most: int = 10) -> list[dict]:
    """The most telling places, with their share."""
    found = [x for x in d.as_dict()["located"] if x["share"] >= 0.05]
    kinds: dict[str, int] = {}
    out = []
    for x in found:
        kinds[x["kind"]] = kinds.get(x["kind"], 0) + 1
        if kinds[x["kind"]] <= 3:
            out.append(x)
    return out[:most]
