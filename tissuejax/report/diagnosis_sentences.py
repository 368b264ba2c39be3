"""A diagnosis in sentences: the verdict, how sure, what it can't tell, what to measure next."""

import inspect
import math

from tissuejax.diagnosis.bench import Segment
from tissuejax.diagnosis.judgement.material_diagnosis import MaterialDiagnosis
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.quality import SIGNIFICANT
from tissuejax.diagnosis.refit import Refit
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.effects.catalogue import effects
from tissuejax.report import judged_sentences
from tissuejax.report.scales import with_std


def joined(names: list[str], word: str = "and") -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def names_of(d: Diagnosis) -> list[str]:
    """Effects of the chosen set, in order, each once."""
    return list(dict.fromkeys(d.search.bench.candidates[k].name for k in d.verdict.chosen.keys))


def lead(d: Diagnosis) -> str:
    """The verdict in one or two sentences."""
    if isinstance(d, MaterialDiagnosis):
        return judged_sentences.lead(d)
    v, s = d.verdict, d.search
    chi = s.empty.chi2 / s.empty.n
    after = f"chi² per sample {chi:.2f} before, {v.chosen.chi2 / v.chosen.n:.2f} after"
    if s.bench.held_out:
        after += f"; held out {s.empty.held / s.empty.n_held:.2f} before, {v.chosen.held / v.chosen.n_held:.2f} after"
    if v.kind == "nothing-missing":
        return (
            f"Nothing is missing: {d.energy} predicts these recordings to within the noise (chi² per sample {chi:.2f})."
        )
    if v.kind == "found":
        return f"Missing: {joined(names_of(d))}. With it the model reaches {after}."
    if v.kind == "ambiguous":
        others = [joined(list(a["effects"])) for a in d.alternatives()]
        return (
            f"Something is missing, and these data can't say which of several it is: {joined(names_of(d))}, or "
            f"{joined(others, 'or')}. The first fits best ({after})."
        )
    return (
        f"Something is missing that no effect of the catalogue explains ({d.energy} alone: chi² per sample {chi:.2f}). "
        + " ".join(f"{r[:1].upper()}{r[1:]}." for r in v.reasons)
    )


def sure(d: Diagnosis) -> list[str]:
    """How sure, in numbers."""
    if isinstance(d, MaterialDiagnosis):
        return judged_sentences.sure(d)
    v, s, out = d.verdict, d.search, []
    b, q = v.base_quality, v.quality

    def times(r: Refit) -> str:
        held = f", {math.sqrt(r.held / r.n_held):.3g} in the held-out ones" if s.bench.held_out else ""
        return f"{math.sqrt(r.chi2 / r.n):.3g} times the noise in the fitted recordings{held}"

    worst = max(x for x in (b.z_fitted, b.z_held, b.z_correlation) if math.isfinite(x))
    out.append(
        f"The base model alone misses by {times(s.empty)} (RMS): "
        + (
            f"{worst:.1f} standard deviations from pure noise, where 3.5 would be too many."
            if worst > SIGNIFICANT
            else f"no test of size or correlation is beyond {SIGNIFICANT} standard deviations of pure noise."
        )
    )
    if v.chosen.keys:
        held = f" and {v.explained[1]:.0%} of the held-out one" if s.bench.held_out else ""
        left = max(x for x in (q.z_fitted, q.z_held, q.z_correlation) if math.isfinite(x))
        rest = "what is left is noise" if q.noise else f"what is left is not all noise ({left:.1f} standard deviations)"
        out.append(
            f"With the effects it misses by {times(v.chosen)}; they remove {v.explained[0]:.0%} of the misfit{held}, "
            f"and {rest}."
        )
        needless = [r for k, r in s.refits.items() if k < frozenset(v.chosen.keys) and len(k) == len(v.chosen.keys) - 1]
        if len(v.chosen.keys) > 1 and needless:
            second = min(needless, key=s.criterion)
            missing = joined([s.bench.candidates[k].name for k in v.chosen.keys if k not in second.keys])
            cost = s.criterion(second) - s.criterion(v.chosen)
            out.append(
                f"The least needed of them is {missing}: without it the criterion is {cost:.0f} worse (8 would do)."
            )
        others = [r for k, r in s.refits.items() if k and s.names(k) != s.names(frozenset(v.chosen.keys))]
        others = [r for r in others if len(r.keys) <= len(v.chosen.keys)]
        if others and v.kind == "found":
            best = min(others, key=s.criterion)
            words = joined(list(dict.fromkeys(s.bench.candidates[k].name for k in best.keys)))
            gap = s.criterion(best) - s.criterion(v.chosen)
            out.append(
                f"The best other explanation of the same size, {words}, is {gap:.0f} worse (above 6 is another)."
            )
    if math.isfinite(v.confidence) and v.kind in ("found", "ambiguous"):
        stated = f"{v.confidence:.0%}" if v.confidence < 0.995 else "over 99 %"
        out.append(f"Stated confidence that exactly this set is right: {stated}.")
    return out + correlated_noise(s.misfit)


def correlated_noise(misfit: Misfit) -> list[str]:
    """What is said of noise that remembers, once for the recordings that share it."""
    alike: dict[tuple, list[Segment]] = {}
    for segment in misfit.rows(misfit.bench.fitted):
        noise = misfit.noise(segment)
        if noise.share > 0.05 and not noise.is_white(segment.time):
            alike.setdefault((segment.channel, noise), []).append(segment)
    out = []
    for (channel, noise), segments in alike.items():
        per = sum(len(s.time) for s in segments) / sum(noise.effective(s.time) for s in segments)
        names = list(dict.fromkeys(s.recording for s in segments))
        where = "" if set(names) == set(misfit.bench.fitted) else f" in {joined(names)}"
        out.append(
            f"The noise of {channel.replace('_', ' ')}{where} is correlated over {noise.tau:.2g} s "
            f"({noise.share:.0%} of its variance): {per:.0f} samples count as one for smooth signals, and all tests "
            "allow for it."
        )
    return out


def next_steps(d: Diagnosis) -> list[str]:
    """What to measure next."""
    if d.proposals:
        return [p.as_dict()["sentence"] for p in d.proposals]
    kind = d.verdict.kind
    if not d.search.bench.held_out:
        return ["Record once more, in another way, and hold that recording out: nothing guards this verdict yet."]
    if kind == "nothing-missing":
        return [
            "Nothing is asked for by these recordings. What they are blind to (other rates, directions, kinds of test) "
            "they can't speak of; a recording unlike these, held out, is the next test of the model."
        ]
    if kind in ("found", "found-in-part"):
        return [
            "No further recording is needed to tell the candidates apart. A second specimen, with the effects held at "
            "these values and only the base refitted, would show whether they belong to the material."
        ]
    if kind == "ambiguous":
        return ["No variation of these protocols tells the explanations apart well; another kind of test is needed."]
    return [
        "Look at the remainder below (remainder.json): what it is a function of (drive, rate, time, place) says which "
        "recording to make next, one where that varies alone. A new effect is one file: see docs/new-effect.md."
    ]


def meanings(d: Diagnosis) -> list[str]:
    """What each effect of the verdict is and what it is seen by."""
    known, out = effects(), []
    for name in names_of(d):
        e = known.get(name)
        if e is not None:
            text = (inspect.getdoc(e) or "").split("\n\n")[0].replace("\n", " ")
            out.append(f"{name}: {text} It is seen by {e.reveals}; blind to it: {e.blind}.")
    return out


def limits(d: Diagnosis) -> list[str]:
    """What this diagnosis can't tell."""
    out = list(d.search.bench.warnings)
    out.append("A wrong gain of the force sensor and a stiffness scale can't be told apart by any data of one sample.")
    for c in d.candidates():
        if c["chosen"] and (c["correlation"] or 0) > 0.95:
            out.append(
                f"To first order {c['name']} and {c['most_like']} change these recordings almost alike (correlation "
                f"{c['correlation']:.2f}); only the full refits told them apart."
            )
    if not d.search.bench.held_out:
        out.append("No recording was held out, so nothing guards against an effect that merely bends to the data.")
    return list(dict.fromkeys(out))


def parameters(d: Diagnosis) -> list[dict]:
    """Rows of the table of effects."""
    rows = []
    for effect in d.effects(d.verdict.chosen):
        for path, p in effect["parameters"].items():
            note = "on its bound" if p["at_bound"] else ""
            value = with_std(p["value"], p["std"])
            rows.append({"effect": effect["name"], "path": path, "value": value, "unit": p["unit"], "note": note})
    return rows


def base(d: Diagnosis) -> list[dict]:
    """Rows of the table of base parameters."""
    return [
        {
            "path": path,
            "before": with_std(p["before"], p["before_std"]),
            "after": with_std(p["after"], p["after_std"]),
            "unit": p["unit"],
        }
        for path, p in d.base().items()
    ]


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
