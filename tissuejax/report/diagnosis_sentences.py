"""A diagnosis in sentences: the verdict, how sure, what it can't tell, what to measure next."""

import math

from tissuejax.diagnosis.result import Diagnosis
from tissuejax.report.scales import with_std


def joined(names: list[str], word: str = "and") -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def names_of(d: Diagnosis) -> list[str]:
    """Effects of the chosen set, in order, each once."""
    return list(dict.fromkeys(d.search.bench.candidates[k].name for k in d.verdict.chosen.keys))


def lead(d: Diagnosis) -> str:
    """The verdict in one or two sentences."""
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
    v, s, out = d.verdict, d.search, []
    b, q = v.base_quality, v.quality
    out.append(
        f"The base model's residual is {b.z_fitted:.1f} standard deviations larger than noise in the fitted recordings"
        + (f", {b.z_held:.1f} in the held-out ones" if s.bench.held_out else "")
        + f"; its correlation after whitening is at {b.z_correlation:.1f} (above 3.5 is not noise)."
    )
    if v.chosen.keys:
        out.append(
            f"With the chosen effects: {q.z_fitted:.1f}"
            + (f", {q.z_held:.1f}" if s.bench.held_out else "")
            + f" and {q.z_correlation:.1f}. They remove {v.explained[0]:.0%} of the misfit"
            + (f" and {v.explained[1]:.0%} of the held-out one." if s.bench.held_out else ".")
        )
    if math.isfinite(v.confidence) and v.kind in ("found", "ambiguous"):
        out.append(f"Stated confidence that exactly this set is right: {v.confidence:.0%}.")
    for channel, n in s.misfit.noises.items():
        if n.share > 0.05:
            out.append(
                f"The noise of {channel.replace('_', ' ')} is serially correlated (share {n.share:.2f}, {n.rho:.2f} "
                f"from sample to sample): {n.inflation:.0f} samples count as one for smooth signals, and all tests "
                "allow for it."
            )
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
