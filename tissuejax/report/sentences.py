"""A fit in words: what was fitted, how well, and what to do next."""

import math

from tissuejax.energies.catalogue import name_of
from tissuejax.fitting.advice import NO_NOTE, NO_PHYSICS, beyond_noise, misfits, scattered
from tissuejax.fitting.result import Fit
from tissuejax.report.scales import display, with_std


def summary(found: Fit) -> str:
    """Two or three sentences for a reader in a hurry."""
    problem = found.problem
    n, k = len(problem.predictor.names), len(found.free)
    energy = problem.predictor.model.energy
    effects = [effect.name for effect in problem.predictor.model.effects]
    with_effects = f" with {', '.join(effects)}" if effects else ""
    text = (
        f"The {name_of(energy)} energy{with_effects} was fitted to {n} recording{'s' * (n != 1)} of "
        f"{problem.predictor.sample.name} ({problem.n_samples} samples, {k} free parameter{'s' * (k != 1)}). "
    )
    text += f"{overall(found)} "
    if found.holdout:
        names = sorted({key.split("/")[0] for key in found.holdout})
        text += f"Held out and only predicted: {', '.join(names)} ({_range(found.holdout)})."
    return text.strip()


def overall(found: Fit) -> str:
    """How well, in one sentence."""
    if found.problem.noise.estimated:
        return (
            f"The model leaves {_range(found.channels)}; the noise was not recorded, so this is all that can be said."
        )
    bad, small = beyond_noise(found), misfits(found)
    verdict = "as well as the noise allows"
    if bad:
        verdict = f"to within {max(bad.values()):.1f} times the noise, so something is missing from the model"
    elif scattered(found):
        verdict = (
            f"to within {max(small.values()):.1f} times the noise; what is left {NO_PHYSICS}: check the noise level"
        )
    elif small:
        verdict = f"to within {max(small.values()):.1f} times the noise; what is beyond it is {NO_NOTE}"
    ratio = found.chi2_per_dof
    return f"It describes them {verdict} ({_range(found.channels)}, chi-square per degree of freedom {ratio:.3g})."


def _range(scores) -> str:
    by_unit: dict[str, list[float]] = {}
    for s in scores.values():
        by_unit.setdefault(s.unit, []).append(s.rmse)
    parts = []
    for unit, values in by_unit.items():
        low, high = min(values), max(values)
        factor, shown = display(unit, high)
        span = (
            f"{high / factor:.3g}"
            if len(values) == 1 or math.isclose(low, high)
            else (f"{low / factor:.3g} to {high / factor:.3g}")
        )
        parts.append(f"RMSE {span} {shown}")
    return ", ".join(parts) or "no channel"


def next_steps(found: Fit) -> list[str]:
    """What a colleague would try next, from what the fit shows."""
    said = []
    if not found.converged:
        said.append(
            "Start elsewhere (--start, --multistart 16), or fit fewer parameters (--fix), before trusting a number."
        )
    misfit = bool(beyond_noise(found))
    serial = max((s.autocorrelation for s in found.channels.values()), default=0.0) > 0.5
    if misfit or (serial and found.problem.noise.estimated):
        said.append(
            "Ask what the model lacks: tissuejax diagnose names rate, softening, friction or the rig; "
            "or try an energy with one more term."
        )
    if found.uncertainty.sentences:
        said.append(
            "Add a recording of another mode (planar, equibiaxial, shear), fix a parameter that is known, or take a "
            "smaller energy: these recordings can't separate all that is fitted."
        )
    if found.at_bound:
        said.append(
            f"Look at {', '.join(found.at_bound)}: at a bound. Widen the bound if physics allows, or leave the "
            "term out."
        )
    if not found.holdout and len(found.problem.predictor.sample.recordings) > 1:
        said.append("Hold one recording out (--holdout NAME): a fit is worth what it predicts.")
    if any("unstable" in w.lower() for w in found.warnings):
        said.append(
            "Don't simulate beyond the stable range given above; refit with the stability constraint (--stable)."
        )
    return said or ["Nothing here asks for more. Use the parameters inside the range of stretches that was fitted."]


def table(found: Fit) -> list[dict[str, str]]:
    """Rows of the parameter table: one unit a family, four digits, 95 % intervals, in words where nothing is known."""
    declared = found.problem.predictor.model.parameters
    sizes: dict[str, list[float]] = {}
    for path in found.free:
        if found.values[path]:
            sizes.setdefault(declared[path].unit, []).append(abs(found.values[path]))
    common = {unit: display(unit, sorted(of)[len(of) // 2]) for unit, of in sizes.items()}
    rows, intervals = [], found.intervals
    for path, value in found.values.items():
        factor, unit = common.get(declared[path].unit) or display(declared[path].unit, abs(value))
        std = found.std.get(path)
        known = std is not None and identified(value, std, declared[path].typical)
        interval = ""
        if known:
            interval = " to ".join(f"{end / factor:.4g}" for end in intervals[path])
        note = f"at its {found.at_bound[path]} bound" if path in found.at_bound else ""
        rows.append(
            {
                "path": path,
                "value": with_std(value / factor, None if std is None else std / factor if known else math.inf),
                "interval": interval,
                "unit": "" if unit == "1" else unit,
                "meaning": declared[path].meaning,
                "note": note if path in found.free else "fixed",
            }
        )
    return rows


def identified(value: float, std: float, typical: float) -> bool:
    """Whether a standard error says anything: smaller than the value, or than what such a parameter usually is."""
    return math.isfinite(std) and std <= max(abs(value), typical)


def errors(found: Fit) -> list[dict[str, str]]:
    """Rows of the error table, fitted channels first."""
    rows = []
    for kind, scores in (("fitted", found.channels), ("held out", found.holdout)):
        for key, s in scores.items():
            factor, unit = display(s.unit, s.rmse)
            rows.append(
                {
                    "key": key,
                    "kind": kind,
                    "rmse": f"{s.rmse / factor:.3g} {unit}",
                    "r2": f"{s.r2:.4f}",
                    "chi2": f"{s.chi2_per_sample:.3g}",
                    "n": str(s.n),
                }
            )
    return rows


def sites(found: Fit) -> list[dict[str, str]]:
    """Rows of the table of probed sites: error vectors before and after."""
    rows = []
    for name, channels in found.sites.items():
        for channel, errors in channels.items():
            unit = "N" if channel == "force" else "m"
            factor, shown = display(unit, errors["after"])
            before, after = (f"{errors[k] / factor:.3g} {shown}" for k in ("before", "after"))
            rows.append({"site": name, "channel": channel, "before": before, "after": after})
    return rows
