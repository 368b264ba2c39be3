"""A judged diagnosis in sentences: the verdict and what it rests on, in words that a physician can use."""

import math
from dataclasses import replace

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.judge import Kind, judge
from tissuejax.diagnosis.refit import Refit
from tissuejax.diagnosis.result import USED, Diagnosis
from tissuejax.report.track_record import sentence

PARTS = {
    "law": "smooth in stretch, shared by recordings (another law)",
    "fine law": "bends in stretch, shared by recordings",
    "gain": "a gain of each recording's own",
    "own law": "a law of each recording's own",
    "hysteresis, step": "hysteresis that turns at once",
    "hysteresis, narrow": "hysteresis that turns quickly",
    "hysteresis, wide": "hysteresis that turns slowly",
    "added law, step": "a law that is added from the start",
    "added law, narrow": "a law that is added soon after the start",
    "added law, wide": "a law that is added on the way",
    "quick": "a quick wander in time",
    "slow": "a slow wander in time",
    "lasting": "a wander longer than a recording",
    "waning gain": "a gain that changes while it is recorded",
    "white": "scatter from sample to sample beyond the stated noise",
    "marker": "each marker's own, smooth in depth",
    "numerical": "what mesh and step of the simulation leave open",
    "mesh": "what the mesh of the simulation leaves open",
    "speed": "what the speed of the simulation leaves open",
    "ringing": "what rings in the simulation where the probe starts or stops",
    "zero": "where the strain counts from",
    "clock": "by whose clock the force is read",
    "effects": "what the law of what is named errs by",
    "crosstalk": "vertical force in the lateral ones",
    "onset": "where the surface is met",
    "peak": "a peak where the blade's shoulder enters",
}

SEEN = 1e-5  # of the peak: no sensor tells less, and an amplitude at its bound is rounding
BEYOND = 2.0  # of the error that two simulations tell: 95 of 100 of a half-normal distribution lie below
LITTLE = 1e-3  # of the stress: a part that is less is no news


def _part(name: str) -> str:
    if name not in PARTS and name.startswith("at once in "):
        return name
    stem, _, channel = name.partition(" of ")
    return f"{PARTS[stem]}{f' ({channel})' if channel else ''}"


def joined(names: list[str], word: str = "and") -> str:
    """a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"


def chance(p: float) -> str:
    """A probability in words that don't promise more than is known."""
    if p > 0.995:
        return "more than 99 in 100"
    if p < 0.005:
        return "fewer than 1 in 100"
    return f"{100 * p:.0f} in 100"


def size(d: Diagnosis) -> str:
    """The rest in its unit and as a share of the peak."""
    rest = d.answered.rest()
    value, unit = rest["rms"], rest["unit"]
    for big, word in ((1e6, "MPa"), (1e3, "kPa")):
        if unit == "Pa" and value >= big:
            value, unit = value / big, word
            break
    share = f"{100 * rest['share_of_peak']:.2g} %"
    if rest["share_of_peak"] < SEEN:
        return f"less than {100 * SEEN:g} % of the largest {'stress' if 'Pa' in unit else 'values'}"
    if unit == "1":  # forces and markers together
        return f"{share} of the largest force and displacement, root mean square"
    return f"{value:.3g} {unit} root mean square, {share} of the largest {'stress' if 'Pa' in unit else 'force'}"


def at_once(d: Diagnosis) -> str:
    """Where something of note happened at once, the largest first: "slow at 10 s and last at 7 s"; empty where nothing
    did."""
    moments = [m for m in d.answered.rest()["at_once"] if m["amplitude"] > LITTLE]
    where = [f"{m['recording']} at {m['time']:.3g} s" for m in moments]
    return joined(where[:3]) if where else ""


def lead(d: Diagnosis) -> str:
    """The verdict in a few sentences."""
    a = d.answered
    j = a.judgement
    removed = f"explains {100 * a.explained[0]:.0f} % of what {d.energy} misses in the fitted recordings"
    if a.bench.held_out:
        removed += f" and {100 * a.explained[1]:.0f} % in the held-out ones"
    if j.kind is Kind.NOTHING:
        return (
            f"Nothing is missing: {d.energy} predicts these recordings to within noise and what any law leaves "
            f"({size(d)}). Of 100 such cases this should be right in {chance(a.confidence).removesuffix(' in 100')}."
        )
    if j.kind is Kind.FOUND:
        return f"Missing: {joined(list(j.names))}, and nothing else of note. It {removed}; what is left is {size(d)}."
    if j.kind is Kind.IN_PART:
        more = [f"{n} ({100 * p:.0f} in 100)" for n, p in j.inclusion.items() if n not in j.names and p > 0.1]
        also = f" Perhaps also {joined(more, 'or')}." if more else ""
        once = f" Something without a name happened at once in {where}." if (where := at_once(d)) else ""
        return (
            f"Missing: {joined(list(j.names))}. It {removed}. That is not all: {size(d)} is left that has no name."
            f"{once}{also}"
        )
    if j.kind is Kind.AMBIGUOUS:
        others = [joined(list(x["effects"])) for x in d.alternatives()]
        first = joined(list(dict.fromkeys(a.bench.candidates[k].name for k in a.chosen.keys)))
        return (
            "Something is missing that has a name, and these data can't say which: "
            f"{joined([first, *others], 'or') if others else first}."
        )
    best = joined(list(dict.fromkeys(a.bench.candidates[k].name for k in a.chosen.keys))) if a.chosen.keys else ""
    attempt = f" The best attempt, {best}, is less probable than that." if best else ""
    if where := at_once(d):
        return (
            f"Something happened at once that no effect of the catalogue explains, in {where}: {size(d)} of the misfit "
            f"has no better account than that and a smooth, nameless rest.{attempt}"
        )
    return (
        f"Something is missing that no effect of the catalogue explains: {size(d)} of the misfit has no better account "
        f"than a smooth, nameless rest.{attempt}"
    )


def _how_rare_faults(d: Diagnosis) -> list[str]:
    """What was held of the machine's faults beforehand, where that is not the usual or decides the answer."""
    criteria, j = d.answered.exploration.criteria, d.answered.judgement
    if not d.answered.evidence.faults:
        return []
    if criteria.fault >= 1:
        return [
            "Beforehand a fault of the test machine was held for as likely as what a tissue does (--rig unchecked)."
        ]
    held = (
        f"Beforehand a fault of the test machine was held for {1 / criteria.fault:.0f} times less likely than what a "
        "tissue does"
    )
    other = judge(d.answered.evidence, replace(criteria, fault=1.0))
    if other.kind is j.kind and set(other.names) == set(j.names):
        return [] if criteria.fault == Criteria().fault else [f"{held}."]
    named = f": {joined(list(other.names))}" if other.names else ""
    return [
        f"{held}. Were it as likely, the answer would be {other.kind.value}{named} ({chance(other.confidence)}); "
        "say so (--rig unchecked) where nobody has looked at the machine."
    ]


def sure(d: Diagnosis) -> list[str]:
    """How sure, in numbers."""
    a, j, out = d.answered, d.answered.judgement, []
    chances = ", ".join(f"{k.value} {chance(p)}" for k, p in sorted(j.probabilities.items(), key=lambda kv: -kv[1]))
    out.append(f"Probabilities of the five answers: {chances}. The most probable is given.")
    lapse = a.exploration.criteria.lapse
    if a.evidence.simulated and lapse > 0:
        out.append(
            f"Once in {1 / lapse:.0f} a search by few simulations was wrong in sealed cases. With that probability it "
            "says nothing here too, and what was held for probable before a recording was seen stands."
        )
    out += [text] if (text := sentence(d.experiment, a.kind.value)) else []
    present = [f"{n} {chance(p)}" for n, p in j.inclusion.items() if p > 0.01][:6]
    if present:
        out.append(f"Probability that an effect is present, over all sets weighed: {', '.join(present)}.")
    names = [(joined(list(s.names)) or "nothing at all", p) for s, p in j.alternatives if p > 1e-6][:1]
    if names and j.kind in (Kind.FOUND, Kind.IN_PART):
        out.append(f"Exactly these and no other: {chance(j.exact)}; the next best account is {names[0][0]}.")
    out += _how_rare_faults(d)
    told = [f"{_over_noise(a.empty, bool(a.bench.held_out))} with {d.energy} alone"]
    if a.chosen.keys:
        named = joined(list(dict.fromkeys(a.bench.candidates[k].name for k in a.chosen.keys)))
        told.append(f"{_over_noise(a.chosen, bool(a.bench.held_out))} with {named}")
    out.append(f"Root mean square of the misfit over the stated noise: {', '.join(told)}.")
    rest = a.rest()
    own = [f"{_part(k)} {100 * v:.2g} %" for k, v in rest["named"].items() if v > LITTLE]
    if own:
        out.append(
            f"Of what has a name, beyond its parameters (typical amplitudes, shares of the stress): {'; '.join(own)}."
        )
    apart = ("mesh", "speed", "ringing", "effects")
    large = [f"{_part(k)} {100 * v:.2g} %" for k, v in rest["parts"].items() if v > LITTLE and k not in apart]
    if large:
        out.append(f"What is left, by kind, as shares of the stress (typical amplitudes): {'; '.join(large)}.")
    if (errs := rest["parts"].get("effects", 0.0)) > LITTLE:
        out.append(
            f"The law of what is named is only nearly right here: it errs by {100 * errs:.2g} % of what it does "
            "(typical amplitude)."
        )
    if j.chosen.numerical:
        out.append(
            f"To mesh and step of the simulation {100 * j.chosen.numerical:.2g} % of the largest values are laid, and "
            "not to the tissue."
        )
    for name, finer in (("mesh", "a finer mesh"), ("speed", "a lower `compression`")):
        if (times := rest["parts"].get(name, 0.0)) > BEYOND:
            out.append(
                f"For that {_part(name)} would have to be {times:.1f} times what two simulations say of it: try "
                f"{finer}, for something else may hide there."
            )
    if rest["kurtosis"] > 5:
        out.append(
            f"What is left jumps (excess kurtosis {rest['kurtosis']:.0f}): slips, steps or spikes are none of the "
            "smooth parts that were allowed for, and the names deserve doubt."
        )
    for name, x in d.unread.items():
        out.append(
            f"{name}, which nothing has read until now: error {x['before']:.3g} Pa with {d.energy} alone, "
            f"{x['after']:.3g} Pa with what is shown, noise {x['noise']:.3g} Pa."
        )
    if a.bench.held_out:
        out.append(f"Which data were used: {USED}.")
    return out


def _over_noise(of: Refit, held_out: bool) -> str:
    """ "21.6 (24.3 in the held-out recordings)", from the misfit of a set that was weighed."""
    means = [math.sqrt(of.chi2 / of.n)] + ([math.sqrt(of.held / of.n_held)] if held_out else [])
    words = [f"{x:.2f}" if x < 10 else f"{x:.0f}" for x in means]
    return f"{words[0]} ({words[1]} in the held-out recordings)" if held_out else words[0]
