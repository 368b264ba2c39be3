"""Do the intervals hold what they promise? Simulation-based calibration of every kind, on closed-form tension tests.

Evidences are calibrated by the laws they choose: of the data sets that give a law the probability 0.7, seven in ten
should come from it (Schad et al. 2022, Psychol. Methods, doi:10.1037/met0000472).

Truths are drawn from a prior, data from the textbook's formula written here (not the package's), and each truth is
ranked among the draws of its posterior: ranks of a calibrated posterior are uniform (Talts et al. 2018,
arXiv:1804.06788). Intervals and bands are counted: how often they hold the truth, and a value measured anew.

tissuejax study fits/intervals        (PARTS=evidence in the environment: that part only)
"""

import json
import os
from dataclasses import replace
from pathlib import Path

import equinox as eqx
import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binom, chisquare

import tissuejax as tj
from tissuejax.fitting.bands import half_width, prediction_std
from tissuejax.fitting.evidence import evidence
from tissuejax.fitting.least_squares import descend, fit
from tissuejax.fitting.posterior import laplace, nuts_draws, nuts_runner
from tissuejax.fitting.profile import profile
from tissuejax.fitting.result import Fit
from tissuejax.fitting.target import Target
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.storage import write_figure, write_json

ONCE = tj.Search(multistart=1)

DATA_SETS, DRAWS, BINS, SIGMA, SEED = 200, 99, 10, 40.0, 11
STRETCH = np.linspace(0.75, 1.3, 24)
PRIOR = {"energy.mu": (1500.0, 350.0), "energy.b": (2.0, 0.7)}
FEW = 3  # every third sample: eight, for two parameters and a noise that was not recorded
SLIGHT = {"energy.mu": (1500.0, 350.0), "energy.b": (0.3, 0.3)}  # a stiffening that the noise can hide
PARTICLES = 300
ALL = ("posteriors", "evidence")
PARTS = tuple(os.environ.get("PARTS", " ".join(ALL)).split())


def stress(mu: float, b: float = 0.0) -> np.ndarray:
    """Demiray 1972: nominal stress in uniaxial tension, mu exp(b (I1 - 3)) (l - l^-2)."""
    l = STRETCH
    return mu * np.exp(b * (l**2 + 2 / l - 3)) * (l - l**-2)


def data(values, every: int = 1, std: float | None = SIGMA) -> Sample:
    """A sample with these measured values."""
    time = np.arange(float(len(STRETCH)))[::every]
    inputs, channel = {"time": time, "stretch": STRETCH[::every]}, Channel(time, values[::every], "Pa", std)
    return Sample("sbc", {"pull": Recording("pull", "uniaxial", inputs, {"nominal_stress": channel}, {})})


def truths(rng: np.random.Generator, prior=PRIOR) -> np.ndarray:
    """Parameters drawn from the prior, positive ones."""
    means, stds = (np.array([prior[p][k] for p in prior]) for k in (0, 1))
    while True:
        truth = means + stds * rng.normal(size=len(prior))
        if (truth > 0).all():
            return truth


def posterior_ranks(rng: np.random.Generator) -> tuple[dict, dict, float]:
    """Ranks and covered truths of Laplace and NUTS, and the largest k-hat; the noise is recorded."""
    means = np.array([m for m, _ in PRIOR.values()])
    base = tj.fit(data(stress(*means)), "demiray", search=ONCE, unknowns=tj.Unknowns(priors=PRIOR)).problem
    target = Target(base)
    run = nuts_runner(target, 4 * DRAWS, 1, 200)
    ranks, covered, khat = {"Laplace": [], "NUTS": []}, {"Laplace": [], "NUTS": []}, []
    for k in range(DATA_SETS):
        truth = truths(rng)
        measured = stress(*truth) + SIGMA * rng.normal(size=len(STRETCH))
        posed = replace(base, predictor=eqx.tree_at(lambda p: p.sample, base.predictor, data(measured)))
        best = descend(posed, dict(base.start) | dict(zip(base.free, means)))
        own = target.with_data_of(posed)
        found = laplace(own, best.y, 1500, seed=k)
        khat.append(found.checks["khat"])
        y, _ = nuts_draws(own, best.y, own.data, 4 * DRAWS, 1, 200, k, run)
        all_draws = {"Laplace": found.flat, "NUTS": own.parameters(y[0])}
        few = {"Laplace": found.flat[:: len(found.flat) // DRAWS][:DRAWS], "NUTS": own.parameters(y[0][3::4])[:DRAWS]}
        for method, x in few.items():
            ranks[method].append((x < truth).sum(0))
            low, high = np.quantile(all_draws[method], [0.025, 0.975], axis=0)
            covered[method].append((low < truth) & (truth < high))
    return ranks, covered, float(np.max(khat))


def choices(rng: np.random.Generator) -> tuple[list, np.ndarray, np.ndarray]:
    """Ranks among the particles of tempered sampling; the probability of Demiray's law against a neo-Hookean one by
    their evidences, and which it was: the law is drawn first, each with probability 1/2 (Schad et al. 2022).
    """
    priors = {"demiray": SLIGHT, "neo-hookean": {"energy.mu": SLIGHT["energy.mu"]}}
    few = data(stress(1500.0), FEW)
    bases = {
        law: tj.fit(few, law, search=ONCE, unknowns=tj.Unknowns(priors=prior)).problem for law, prior in priors.items()
    }
    targets = {law: Target(base) for law, base in bases.items()}
    ranks, probability, was = [], [], []
    for k in range(DATA_SETS):
        law = tuple(priors)[int(rng.integers(2))]
        truth = truths(rng, priors[law])
        measured = stress(*truth) + SIGMA * rng.normal(size=len(STRETCH))
        found = {}
        for name, base in bases.items():
            posed = replace(base, predictor=eqx.tree_at(lambda p: p.sample, base.predictor, data(measured, FEW)))
            found[name] = evidence(targets[name].with_data_of(posed), PARTICLES, 1, seed=k)
        log_odds = found["demiray"].log_evidence - found["neo-hookean"].log_evidence
        probability.append(1 / (1 + np.exp(-log_odds)))
        was.append(law == "demiray")
        draws = found[law].draws[0]
        some = draws[rng.choice(len(draws), DRAWS, replace=False)]
        ranks.append((law, (some < truth).sum(0)))
    return ranks, np.array(probability), np.array(was)


def counted(rng: np.random.Generator, every: int, std: float | None) -> dict[str, list]:
    """Truths in intervals by standard error and by profile; curve and newly measured values in the band."""
    means = np.array([m for m, _ in PRIOR.values()])
    base = tj.fit(data(stress(*means), every, std), "demiray", search=ONCE).problem
    found: dict[str, list] = {"standard error": [], "profile": [], "band of new values": []}
    for _ in range(DATA_SETS):
        truth = truths(rng)
        clean = stress(*truth)
        measured = clean + SIGMA * rng.normal(size=len(STRETCH))
        posed = replace(base, predictor=eqx.tree_at(lambda p: p.sample, base.predictor, data(measured, every, std)))
        best: Fit = fit(posed, start=dict(base.start) | dict(zip(base.free, means)), search=ONCE)
        inside = [low < x < high for x, (low, high) in zip(truth, best.intervals.values(), strict=True)]
        found["standard error"].append(inside)
        ends = [profile(best, path, points=4).interval for path in best.free]
        found["profile"].append([low < x < high for x, (low, high) in zip(truth, ends, strict=True)])
        spread = prediction_std(best.problem, best.values, best.uncertainty, ("pull",))["pull"]["nominal_stress"]
        half = half_width(spread, best.problem.noise.std["pull/nominal_stress"], best.uncertainty)
        again = clean[::every] + SIGMA * rng.normal(size=len(spread))
        predicted = np.asarray(best.predictions["pull"].channels["nominal_stress"].values)
        found["band of new values"].append(np.abs(again - predicted) < half)
    return found


def main(folder: Path) -> str:
    """Ranks and coverages; result.json and a figure. A part that is not run keeps its last result."""
    kept = folder / "result.json"
    record = json.loads(kept.read_text()) if kept.is_file() and set(PARTS) < set(ALL) else {"ranks": {}}
    record |= {"data_sets": DATA_SETS, "draws": DRAWS}
    if "posteriors" in PARTS:
        rng = np.random.default_rng(SEED)
        ranks, covered, record["khat_largest"] = posterior_ranks(rng)
        for method, of in ranks.items():
            record["ranks"][method] = uniform(dict(zip(PRIOR, np.array(of).T, strict=True)))
        tables = {"noise recorded, prior": covered}
        tables["noise recorded, 24 samples"] = counted(rng, 1, SIGMA)
        tables["noise not recorded, 8 samples"] = counted(rng, FEW, None)
        record["coverage_95"] = {
            name: {
                method: float(np.mean(x)) if "band" in method else dict(zip(PRIOR, np.mean(x, 0).tolist()))
                for method, x in of.items()
            }
            for name, of in tables.items()
        }
    if "evidence" in PARTS:
        chosen, probability, was = choices(np.random.default_rng(SEED + 1))
        record["ranks"]["tempered"] = uniform(
            {path: np.array([r[i] for _, r in chosen if i < len(r)]) for i, path in enumerate(SLIGHT)}
        )
        record["evidence"] = {
            "probability_of_demiray": probability.tolist(), "was_demiray": was.tolist(),
            "expected": float(probability.sum()), "found": int(was.sum()),
            "z": float((was - probability).sum() / np.sqrt((probability * (1 - probability)).sum())),
        }  # fmt: skip
    write_json(kept, record)
    write_figure(folder / "figures" / "ranks.png", drawn(record), dpi=110)
    worst = min(p for m in record["ranks"].values() for p in m["uniform_p"].values())
    every = [c for of in record["coverage_95"].values() for c in of.values()]
    flat = [c for e in every for c in (e.values() if isinstance(e, dict) else [e])]
    return (
        f"{DATA_SETS} data sets: least p of uniform ranks {worst:.2f}; coverage {min(flat):.3f} to {max(flat):.3f}; "
        f"choices by evidence {record['evidence']['z']:+.2f} standard deviations from what they say"
    )


def uniform(ranks: dict[str, np.ndarray]) -> dict:
    """Counts in bins by parameter, and the p of chi-square against uniform ones."""
    counts = {path: np.histogram(r, BINS, (-0.5, DRAWS + 0.5))[0] for path, r in ranks.items()}
    return {
        "counts": {path: c.tolist() for path, c in counts.items()},
        "uniform_p": {path: float(chisquare(c).pvalue) for path, c in counts.items()},
    }


def drawn(record) -> Figure:
    """Histograms of ranks with the range in which 95 % of bins of a calibrated posterior lie; choices, coverages."""
    methods = list(record["ranks"])
    figure = Figure(figsize=(11, 8.4), layout="constrained")
    axes = figure.subplots(3, len(methods), squeeze=False)
    for column, method in enumerate(methods):
        for ax, path in zip(axes[:2, column], PRIOR, strict=True):
            counts = record["ranks"][method]["counts"][path]
            low, high = binom.ppf([0.025, 0.975], sum(counts), 1 / BINS)
            ax.bar(np.arange(BINS), counts, color="#1f6fb2", label="data sets in the bin")
            ax.axhspan(low, high, color="#d9730d", alpha=0.2, label="where 95 % of points lie if calibrated")
            p = record["ranks"][method]["uniform_p"][path]
            ax.set_title(f"{method}: {path}, p = {p:.2f}", loc="left", fontsize=9)
            ax.set_xlabel("rank of the truth among the draws, tenths", fontsize=8)
            ax.set_ylabel("data sets", fontsize=8)
            ax.set_ylim(0, 1.25 * max(max(counts), high))
    for ax, path in zip(axes[2], PRIOR, strict=False):
        low, high = binom.ppf([0.025, 0.975], DATA_SETS, 0.95) / DATA_SETS
        rows = [(f"{m}\n{name}", of[path]) for name, by in record["coverage_95"].items() for m, of in by.items()
                if isinstance(of, dict)]  # fmt: skip
        y = np.arange(len(rows))[::-1]
        ax.plot([c for _, c in rows], y, "o", color="#1f6fb2")
        ax.axvspan(low, high, color="#d9730d", alpha=0.2)
        ax.axvline(0.95, color="#22313f", linewidth=0.8)
        ax.set_yticks(y, [text for text, _ in rows] if path == next(iter(PRIOR)) else [""] * len(rows), fontsize=7)
        ax.set_xlim(0.85, 1)
        ax.set_title(path, loc="left", fontsize=9)
        ax.set_xlabel("share of 95 % intervals that hold the truth", fontsize=8)
    _choices(axes[2, -1], record["evidence"])
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8
    )
    return figure


def _choices(ax, of: dict) -> None:
    """How often the law with more constants was the true one, against the probability it was given."""
    p, was = np.array(of["probability_of_demiray"]), np.array(of["was_demiray"])
    parts = np.array_split(np.argsort(p), 5)
    for part in parts:
        low, high = binom.ppf([0.025, 0.975], len(part), p[part].mean()) / len(part)
        ax.plot([p[part].mean()] * 2, [low, high], color="#d9730d", alpha=0.4, linewidth=7, solid_capstyle="butt")
        ax.plot(p[part].mean(), was[part].mean(), "o", color="#1f6fb2")
    ax.plot([0, 1], [0, 1], color="#22313f", linewidth=0.8)
    ax.set_title(f"choice: {of['found']} of {len(p)}, {of['expected']:.0f} expected", loc="left", fontsize=9)
    ax.set_xlabel("probability of Demiray's law by evidence", fontsize=8)
    ax.set_ylabel("share in which it was that law", fontsize=8)


if __name__ == "__main__":
    print(main(Path(__file__).parent))
