"""Specimens as a population: does the interval for a specimen not yet tested hold?

Three cohorts: beef (148 indentations, groups: muscle and day), Ecoflex (190 compressions, groups: the material), the
four regions of the brain. Every specimen is fitted by itself; the hierarchical fit stands beside the pooled and the
separate ones. Then specimens are held out, five parts in turn, with their group known or with their whole group held
out, and it is counted how often the 95 % interval holds their estimate and the stress that was measured on them.

Parts that are done are kept under out/population: a run that is stopped goes on there.

tissuejax study fits/population        (COHORTS=Ecoflex,brain in the environment: only these; the others' results stay)
"""

import json
import os
import re
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

import tissuejax as tj
from tissuejax.cache import source
from tissuejax.cache.key import key
from tissuejax.campaign.population import Estimates, Runner, estimates, pooled, population
from tissuejax.errors import TissueError
from tissuejax.fitting.result import Fit
from tissuejax.progress import for_terminal
from tissuejax.recordings.files import read_all
from tissuejax.report.population_page import write_population
from tissuejax.storage import write_json

ONCE = tj.Search(multistart=1)

DRAWS, WARMUP, CHAINS, PARTS, SEED = 400, 400, 2, 5, 5
RELAXATION = ((0.05, 0.65), (0.5, 0.21), (6.0, 0.07))  # s, share: median of five tests, fits/beef/README.md
KINDS = ("hierarchical", "classical", "pooled")
COUNTED = ("estimate", "stress", "stress, misfit added", "width", "width, misfit added")
SHARES = (0.25, 0.5, 0.75, 1.0)  # of a test's largest strain, where its stress is predicted


def cohorts(fits: Path) -> dict[str, dict]:
    """Side file, law, group of a sample's name, and what is held in each cohort."""
    held = {f"effects.viscoelasticity.tau{i}": t for i, (t, _) in enumerate(RELAXATION, 1)}
    held |= {f"effects.viscoelasticity.g{i}": g for i, (_, g) in enumerate(RELAXATION, 1)}
    return {
        "beef": {
            "file": fits / "beef" / "relaxation.toml", "energy": "reduced-polynomial-2",
            "effects": ["viscoelasticity-3"], "fix": held, "group": r"^(\d{6}_(?:RDG|FF))",
        },
        "Ecoflex": {
            "file": fits / "ecoflex" / "ecoflex-each.toml", "energy": "reduced-polynomial-2",
            "group": r"^(.*)_[A-Z]\d+$",
        },
        "brain": {"file": fits / "human-brain" / "brain.toml", "energy": "reduced-polynomial-2"},
    }  # fmt: skip


def separate(told: dict) -> dict[str, Fit]:
    """Every specimen's own fit; those that can't be fitted are left out."""
    samples, found = read_all(told["file"]), {}
    with for_terminal().stage("separate fits", len(samples)) as stage:
        for name, sample in samples.items():
            with suppress(TissueError):
                found[name] = tj.fit(
                    sample,
                    told["energy"],
                    effects=told.get("effects", ()),
                    unknowns=tj.Unknowns(fix=told.get("fix")),
                    search=ONCE,
                )
            stage.advance(note=name)
    return found


def stresses(found: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (k, p) of the predicted stress, linear in the constants of a reduced polynomial, and the measured one (k)
    at some shares of the largest strain on the way there."""
    recording = next(iter(found.predictions))
    name = next(iter(found.predictions[recording].channels))
    _, slopes = found.problem.predictor.jacobian(found.values, found.free)
    J = np.stack([np.asarray(slopes[p][recording][name], float) for p in found.free], -1)
    measured = found.problem.predictor.sample.recordings[recording]
    strain = np.abs(np.asarray(measured.inputs["stretch"], float) - 1)
    top = int(np.argmax(strain))
    at = [int(np.argmin(np.abs(strain[: top + 1] - s * strain[top]))) for s in SHARES]
    return J[at], np.asarray(measured.channels[name].values, float)[at]


def covered(of: Estimates, fits: dict[str, Fit], by_group: bool, runner: Runner, kept: Path) -> dict[str, dict]:
    """Shares of held-out estimates and stresses inside 95 % intervals of three kinds, and the median width."""
    rng, n = np.random.default_rng(SEED), len(of.samples)
    if by_group:
        parts = np.array_split(rng.permutation(len(of.labels)), min(PARTS, len(of.labels)))
        folds = [np.isin(of.group, part) for part in parts]
    else:
        folds = [np.isin(np.arange(n), part) for part in np.array_split(rng.permutation(n), min(PARTS, n))]
    found = {kind: {what: [] for what in COUNTED} for kind in KINDS}
    with for_terminal().stage(f"parts held out, {'groups' if by_group else 'specimens'}", len(folds)) as stage:
        for k, out in enumerate(folds):
            part = once(kept, ("held out", k, out, by_group, of), partial(held_out, of, fits, by_group, runner, k, out))
            for kind, by in part.items():
                for what, hits in by.items():
                    found[kind][what] += hits
            stage.advance(note=f"{int(out.sum())} specimens")
    return {
        kind: {what: float((np.median if "width" in what else np.mean)(x)) for what, x in by.items()}
        for kind, by in found.items()
    }


def held_out(of: Estimates, fits: dict[str, Fit], by_group: bool, runner: Runner, k: int, out: np.ndarray) -> dict:
    """One part: which estimates and stresses of the specimens `out` lie inside, and how wide the stress's interval is
    at the largest strain over the stress measured there.

    A law does not meet its own specimen's curve either. So stresses are also counted with that added: measured over
    fitted stress of a specimen that takes part (of the same group, where it is known), drawn at random.
    """
    x, _ = of.working
    rng, chance = np.random.default_rng([SEED, k]), np.random.default_rng([SEED, k, 1])
    missed = {i: m / (J @ of.values[i]) for i in np.flatnonzero(~out) for J, m in [stresses(fits[of.samples[i]])]}
    found = population(of, seen=~out, seed=k, runner=runner)
    m, sd, count = x[~out].mean(0), x[~out].std(0, ddof=1), int((~out).sum())
    told = Estimates(tuple(np.array(of.samples)[~out]), of.paths, of.values[~out], of.covariance[~out], of.positive)
    value, error = pooled(told)
    hits = {kind: {what: [] for what in COUNTED} for kind in KINDS}
    for i in np.flatnonzero(out):
        known = bool(of.groups) and not by_group
        draws = found.new(of.groups[i] if known else None, seed=i)
        # Student's prediction interval of specimens all of one kind; draws, so that both give stresses
        t = rng.standard_t(count - 1, size=(len(draws), len(m)))
        of_kind = {
            "hierarchical": draws,
            "classical": of.natural(m + sd * np.sqrt(1 + 1 / count) * t),
            "pooled": value + error * rng.normal(size=draws.shape),
        }
        J, measured = stresses(fits[of.samples[i]])
        alike = [r for j, r in missed.items() if not known or of.group[j] == of.group[i]]
        ratios = np.array(alike)[chance.integers(len(alike), size=len(draws))]
        for kind, theta in of_kind.items():
            noise = rng.multivariate_normal(np.zeros(len(m)), of.covariance[i], size=len(theta))
            predicted = theta @ J.T
            hits[kind]["estimate"].append(_inside(theta + noise, of.values[i]).tolist())
            for of_what, stress in (("", predicted), (", misfit added", predicted * ratios)):
                low, high = np.quantile(stress[:, -1], [0.025, 0.975])
                hits[kind][f"stress{of_what}"].append(_inside(stress, measured).tolist())
                hits[kind][f"width{of_what}"].append(float((high - low) / abs(measured[-1])))
    return hits


def once(kept: Path, told: tuple, work: Callable[[], dict]) -> dict:
    """What `work` gives, or what it gave before for the same data, settings and code: so a run that was stopped goes
    on at the part where it was."""
    name = key(DRAWS, WARMUP, CHAINS, SEED, Path(__file__).read_text(), *told)
    at = kept / f"{name}.json"
    if name is None or not at.is_file():
        found = work()
        if name is not None:
            write_json(at, found)
        return found
    return json.loads(at.read_text())


def _inside(draws: np.ndarray, value: np.ndarray) -> np.ndarray:
    low, high = np.quantile(draws, [0.025, 0.975], axis=0)
    return (low <= value) & (value <= high)


def main(folder: Path) -> str:
    """Fit, shrink, hold out; result.json, and a page for each cohort under figures/."""
    kept, fits_folder = folder / "result.json", folder.resolve().parent
    work = folder.resolve().parents[1] / "out" / "population"
    wanted = set(filter(None, os.environ.get("COHORTS", "").split(",")))
    record = json.loads(kept.read_text()) if wanted and kept.is_file() else {}
    if not (fits_folder / "beef").is_dir():  # run in a copy: the cohorts' side files lie in the checkout
        fits_folder = source.ROOT.parent / "fits"
    for name, told in cohorts(fits_folder).items():
        if wanted and name not in wanted:
            continue
        fits = separate(told)
        rows = {k: f.record() for k, f in fits.items()}
        groups = {k: (re.search(told["group"], k) or ["", "other"])[1] for k in fits} if "group" in told else None
        of = estimates(rows, groups)
        runner = Runner(len(of.labels), DRAWS, WARMUP, CHAINS)
        found = population(of, seed=SEED, runner=runner)
        write_population(found, folder / "figures" / name)
        shrunken, _ = found.specimens()
        x, S = of.working
        record[name] = {
            "fitted": len(fits), "used": len(of.samples), "population": found.record(),
            "moved_by": np.median(np.abs(shrunken - x) / np.sqrt(np.einsum("nii->ni", S)), 0).tolist(),
            "error_over_spread": np.median(
                np.sqrt(np.einsum("nii->ni", S)) / np.sqrt(np.einsum("dii->di", found.between)).mean(0), 0
            ).tolist(),
            "held_out": {"specimens": covered(of, fits, False, runner, work)},
        }  # fmt: skip
        if len(of.labels) > 3:
            record[name]["held_out"]["groups"] = covered(of, fits, True, runner, work)
        write_json(kept, record)
    told = {n: r["held_out"]["specimens"]["hierarchical"]["estimate"] for n, r in record.items() if "held_out" in r}
    return "held-out specimens inside 95 %: " + ", ".join(f"{n} {share:.0%}" for n, share in told.items())


if __name__ == "__main__":
    print(main(Path(__file__).parent))
