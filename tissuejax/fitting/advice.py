"""What a careful colleague would say about a fit, in sentences."""

import math
from typing import TYPE_CHECKING

import numpy as np

from tissuejax.estimation.level import OF_NOTE
from tissuejax.estimation.stability import sentence
from tissuejax.experiments.soundness import CHECKS, sentences
from tissuejax.fitting.memory import begun_loaded, times

if TYPE_CHECKING:
    from tissuejax.fitting.result import Fit

MISFIT = 1.5  # chi-square per sample from which the misfit is called larger than the noise
NO_NOTE = f"less than {OF_NOTE:.1%} of the largest value, which is of no note"
NO_PHYSICS = "scatters from sample to sample, which missing physics does not"
WHITE = 30  # samples from which neighbours that do not agree tell that residuals are white
SERIAL = 0.5  # lag-one correlation of residuals from which standard errors are called optimistic
CONDITION = 1e6
TWINS = 0.05  # of their ratio: relaxation times closer than that are one
GROSS = 5.0  # misfit in units of the noise beyond which a fit describes something else


def warnings_of(found: "Fit") -> list[str]:
    """All warnings of a fit, the gravest first."""
    problem, said = found.problem, []
    if not found.converged:
        said.append(f"Not converged: {found.status}. The numbers below are where the search stopped.")
    for path, side in found.at_bound.items():
        lower, upper = problem.bound(path)
        limit = lower if side == "lower" else upper
        unit = problem.predictor.model.parameters[path].unit
        shown = f"{limit:g}{'' if unit == '1' else f' {unit}'}"
        said.append(f"{path} ended at its {side} bound ({shown}); its standard error means little there.")
    said += found.uncertainty.sentences
    said += _twins(found)
    said += [text] if (text := sentence(found.stability)) else []
    if times(problem.predictor):
        said += begun_loaded(problem.predictor.sample.recordings, problem.predictor.names, problem.noise)
    said += _misfit(found)
    said += _serial(found)
    said += _held_out(found)
    if found.uncertainty.condition > CONDITION and not found.uncertainty.sentences:
        said.append(
            f"The condition number is {found.uncertainty.condition:.1e}: some parameters trade off against each other; "
            "see the correlation matrix."
        )
    if problem.noise.estimated:
        levels = {g: problem.noise.std[key] for key, g in problem.noise.groups.items()}
        text = ", ".join(f"{level:.3g} ({group})" for group, level in levels.items())
        said.append(
            f"The noise was not recorded; it was estimated from the residuals: {text}. "
            "So chi-square says nothing on whether the model fits."
        )
    return said + sentences(found.numerics) + _starts(found)


def _twins(found: "Fit") -> list[str]:
    """Relaxation times of one effect that came out alike: one term would say as much."""
    free, said = sorted(p for p in times(found.problem.predictor) if p in found.free), []
    for i, one in enumerate(free):
        for other in free[i + 1 :]:
            a, b = found.values[one], found.values[other]
            if one.rpartition(".")[0] == other.rpartition(".")[0] and abs(math.log(a / b)) < TWINS:
                shares = [p.replace(".tau", ".g") for p in (one, other)]
                said.append(
                    f"{one} and {other} are the same time ({a:.3g} s): only the sum of their shares is seen "
                    f"({sum(found.values[p] for p in shares):.3g}). One term fewer says as much, e.g. --effect "
                    f"viscoelasticity-{len(free) - 1}."
                )
    return said


def numerics_sentence(found: "Fit") -> str:
    """One line on the numerical checks of a fit's simulations, the worst recording of each; empty without any."""
    shares = {c: max((v[c] for v in found.numerics.values() if c in v), default=None) for c in CHECKS}
    worst = ", ".join(f"{check} {share:.2%}" for check, share in shares.items() if share is not None)
    return (
        f"Simulations at worst: {worst} (of strain energy, of the probe's radius, of strain energy)." if worst else ""
    )


def misfits(found: "Fit") -> dict[str, float]:
    """Channels whose misfit exceeds the recorded noise, and how many times.

    A noise level estimated from few samples may be a quarter too low, hence the margin of `MISFIT`.
    """
    known = {k: s for k, s in found.channels.items() if k not in found.problem.noise.groups}
    return {k: math.sqrt(s.chi2_per_sample) for k, s in known.items() if s.chi2_per_sample > MISFIT}


def of_note(found: "Fit") -> dict[str, float]:
    """The misfits of which, as in a judgement, what lies beyond the noise is `OF_NOTE` of the largest value or more."""
    recordings, counted = found.problem.predictor.sample.recordings, {}
    for key, ratio in misfits(found).items():
        name, channel = key.split("/", 1)
        top = float(np.nanquantile(np.abs(recordings[name].channels[channel].values), 0.98))
        rest = found.channels[key].rmse * math.sqrt(1 - 1 / ratio**2)
        if channel == "markers" or rest > OF_NOTE * top:
            counted[key] = ratio
    return counted


def scattered(found: "Fit") -> dict[str, float]:
    """Those that are noise of another level than stated: residuals whose neighbours agree no more than by chance.

    Of independent ones the correlation lies within 2 / sqrt(n) in 95 of 100 cases. Few samples can't tell, nor can
    components side by side (forces, markers), whose neighbours are no neighbours in time.
    """
    recordings = found.problem.predictor.sample.recordings

    def white(key: str) -> bool:
        name, channel = key.split("/", 1)
        score, one = found.channels[key], np.ndim(recordings[name].channels[channel].values) == 1
        return one and score.n >= WHITE and score.autocorrelation < 2 / math.sqrt(score.n)

    return {key: ratio for key, ratio in of_note(found).items() if white(key)}


def beyond_noise(found: "Fit") -> dict[str, float]:
    """The misfits that count, of note and no scatter: the one test of "something is missing"."""
    noise = scattered(found)
    return {key: ratio for key, ratio in of_note(found).items() if key not in noise}


def suspicions(found: "Fit") -> dict[str, list[str]]:
    """Why the numbers should not be used as they are, by kind: at a bound, unstable, a misfit far above the noise."""
    said = {"at a bound": [f"{path} ended at its {side} bound" for path, side in found.at_bound.items()]}
    if sentence(found.stability):
        said["unstable"] = ["the fitted energy is unstable inside the recorded range"]
    worst = max(misfits(found).values(), default=0.0)
    if worst > GROSS:
        said["misfit"] = [f"the misfit is {worst:.3g} times the noise"]
    return {kind: why for kind, why in said.items() if why}


def suspect(found: "Fit") -> list[str]:
    """The sentences of `suspicions`, the one test of numbers that should not be used as they are."""
    return [why for of_kind in suspicions(found).values() for why in of_kind]


def _misfit(found: "Fit") -> list[str]:
    bad = misfits(found)
    small = {k: math.sqrt(s.chi2_per_sample) for k, s in found.channels.items() if k not in found.problem.noise.groups}
    if small and math.isfinite(found.uncertainty.dof) and max(small.values()) < 1:
        return [
            f"The residuals are only {max(small.values()):.2f} times the recorded noise: check the noise level. "
            "Standard errors go by the residuals."
        ]
    if not bad:
        return []
    worst = sorted(bad, key=bad.get, reverse=True)
    shown = ", ".join(f"{key} {bad[key]:.1f} times" for key in worst[:6]) + (", ..." if len(bad) > 6 else "")
    if beyond_noise(found):
        why = "the model lacks something."
    elif scattered(found):
        why = f"what is left {NO_PHYSICS}: check the noise level."
    else:
        why = f"by {NO_NOTE}; is the noise level right?"
    return [f"The misfit exceeds the noise ({shown}): {why} Standard errors were widened accordingly."]


def _serial(found: "Fit") -> list[str]:
    worst = max(found.channels.items(), key=lambda kv: kv[1].autocorrelation, default=None)
    if worst is None or worst[1].autocorrelation < SERIAL:
        return []
    rho = min(worst[1].autocorrelation, 0.999)
    said = (
        f"Residuals of {worst[0]} are serially correlated ({rho:.2f} from one sample to the next), so samples are not "
    )
    inflation = found.uncertainty.inflation
    if inflation is not None and found.uncertainty.serial:
        factor = math.sqrt(float(np.max(inflation)))
        return [f"{said}independent; the standard errors allow for it and are up to {factor:.1f} times larger."]
    return [f"{said}independent and the standard errors are too small, by up to about {mean_factor(rho):.1f} times."]


def mean_factor(rho: float) -> float:
    """Standard error of a mean of samples with correlation `rho` between neighbours, over that of independent ones."""
    return math.sqrt((1 + rho) / (1 - rho))


def _held_out(found: "Fit") -> list[str]:
    if not found.holdout or not found.channels:
        return []
    inside = max(s.chi2_per_sample for s in found.channels.values())
    return [
        f"{key} (held out) is predicted {math.sqrt(s.chi2_per_sample / inside):.1f} times worse than the fitted "
        f"recordings: "
        "the parameters do not carry over to it."
        for key, s in found.holdout.items()
        if inside > 0 and s.chi2_per_sample > 4 * max(inside, 1.0)
    ]


def _starts(found: "Fit") -> list[str]:
    ends = [c for c in found.starts if math.isfinite(c)]
    if len(found.starts) < 2 or not ends:
        return []
    best = min(ends)
    same = sum(c <= best * (1 + 1e-3) + 1e-9 for c in ends)
    if same > 1:
        return []
    return [
        f"Only 1 of {len(found.starts)} starts reached the best fit: there are other minima; raise --multistart "
        f"to be surer."
    ]
