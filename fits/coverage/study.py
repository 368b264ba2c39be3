"""Do the intervals that a diagnosis states hold the truth? Hundreds of specimens under four kinds of noise.

A specimen is a neo-Hookean block in grips with play: P = mu (l - l^-2), l the recorded stretch brought nearer to 1 by
the gap (written here, no code of the package). Modulus and gap are drawn anew each time. `diagnose` fits two recordings
and predicts a third, with slack and drift on offer. Counted is how often its 95 % interval of the modulus and of the
gap holds the truth, among all specimens of which it named slack. Beside that the scatter of the estimates over their
mean standard error: one if the errors are right, from either side.

tissuejax study fits/coverage          (DRAWS=120 in the environment for fewer; what this code drew as often is kept)
"""

import json
import os
from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binom

from tissuejax.cache.source import LOADED
from tissuejax.diagnosis.diagnose import diagnose
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.storage import write_figure, write_json

DRAWS, SEED, SIGMA = int(os.environ.get("DRAWS", "400")), 7, 10.0
MODULUS, GAP = (1500.0, 3000.0), (0.01, 0.03)  # Pa; of the height
PATHS = {"energy.mu": "shear modulus", "effects.slack.gap": "gap"}
CASES = {  # samples a recording, level stated over the true one (None: not recorded), correlation time in s
    "white, level recorded": (81, 1.0, 0.0),
    "white, level stated half": (81, 0.5, 0.0),
    "correlated over 0.6 s, level recorded": (81, 1.0, 0.6),
    "14 samples, level not recorded": (14, None, 0.0),
}
CORNERS = {
    "pull": ([0, 8, 12, 20], [1, 1.25, 1.25, 1]),
    "push": ([0, 6, 10, 20], [1, 0.8, 0.8, 1]),
    "again": ([0, 8, 12, 18, 20], [1, 1.2, 1.2, 0.9, 0.9]),
}


def stress(stretch: np.ndarray, mu: float, gap: float) -> np.ndarray:
    """Nominal stress of the block, Pa."""
    strain = stretch - 1
    l = 1 + np.sign(strain) * np.maximum(np.abs(strain) - gap, 0)
    return mu * (l - l**-2)


def noise(rng: np.random.Generator, time: np.ndarray, tau: float) -> np.ndarray:
    """Of standard deviation one: white, or an autoregression with the covariance exp(-dt / tau)."""
    x = rng.normal(size=len(time))
    if tau:
        keep = np.exp(-np.diff(time) / tau)
        for i, k in enumerate(keep, start=1):
            x[i] = k * x[i - 1] + np.sqrt(1 - k**2) * x[i]
    return x


def specimen(rng: np.random.Generator, case: tuple) -> tuple[Sample, dict[str, float]]:
    """A sample and its truth."""
    n, stated, tau = case
    truth = dict(zip(PATHS, (rng.uniform(*MODULUS), rng.uniform(*GAP)), strict=True))
    time, recordings = np.linspace(0, 20, n), {}
    for name, (at, stretch) in CORNERS.items():
        l = np.interp(time, at, stretch)
        y = stress(l, *truth.values()) + SIGMA * noise(rng, time, tau)
        channel = Channel(time, y, "Pa", None if stated is None else stated * SIGMA)
        recordings[name] = Recording(name, "uniaxial", {"time": time, "stretch": l}, {"nominal_stress": channel}, {})
    return Sample("made", recordings), truth


def counted(case: tuple) -> dict:
    """Verdicts, coverage and scatter over `DRAWS` specimens."""
    rng, verdicts, rows = np.random.default_rng(SEED), Counter(), {path: [] for path in PATHS}
    for _ in range(DRAWS):
        sample, truth = specimen(rng, case)
        found = diagnose(sample, "neo-hookean", effects=["slack", "drift"]).as_dict()
        named = [e["name"] for e in found["effects"]]
        verdicts[f"{found['verdict']}: {' + '.join(named) or '-'}"] += 1
        if "slack" not in named:
            continue
        base = found["base_parameters"]["energy.mu"]
        gap = found["effects"][named.index("slack")]["parameters"]["effects.slack.gap"]
        told = {
            "energy.mu": (base["after"], base["after_std"], base["after_interval"]),
            "effects.slack.gap": (gap["value"], gap["std"], gap["interval"]),
        }
        for path, (value, std, ends) in told.items():
            held = None if ends is None else ends[0] < truth[path] < ends[1]
            rows[path].append((value - truth[path], std, held))
    out = {"draws": DRAWS, "verdicts": dict(verdicts.most_common()), "parameters": {}}
    for path, of in rows.items():
        known = [r for r in of if r[2] is not None]
        miss, std, held = (np.array(x, float) for x in zip(*known, strict=True))
        out["parameters"][path] = {
            "counted": len(known),
            "without_interval": len(of) - len(known),
            "coverage_95": float(np.mean(held)),
            "scatter_over_stated": float(np.sqrt(np.mean(miss**2) / np.mean(std**2))),
        }
    return out


def main(folder: Path) -> str:
    """Count every case; result.json and a figure."""
    kept = folder / "result.json"
    record = json.loads(kept.read_text()) if kept.is_file() else {"cases": {}}
    for name, case in CASES.items():
        known = record["cases"].get(name, {})
        if known.get("draws", 0) < DRAWS or known.get("code") != LOADED:
            record["cases"][name] = counted(case) | {"code": LOADED}
            write_json(kept, record)
    write_figure(folder / "figures" / "coverage.png", drawn(record), dpi=110)
    every = [p["coverage_95"] for c in record["cases"].values() for p in c["parameters"].values()]
    fewest = min(c["draws"] for c in record["cases"].values())
    return f"{fewest} specimens a case or more: 95 % intervals of a diagnosis hold {min(every):.1%} to {max(every):.1%}"


def drawn(record) -> Figure:
    """Coverage and scatter, a row a case; bands: where 95 % of right programs would lie."""
    figure = Figure(figsize=(9, 3.1), layout="constrained")
    left, right = figure.subplots(1, 2)
    names = list(record["cases"])
    for i, name in enumerate(names):
        draws = record["cases"][name]["draws"]
        low, high = binom.ppf([0.025, 0.975], draws, 0.95) / draws
        text = "95 % of right intervals, by chance" if i == 0 else None
        left.fill_betweenx([-i - 0.4, -i + 0.4], low, high, color="#d9730d", alpha=0.2, linewidth=0, label=text)
    left.axvline(0.95, color="#22313f", linewidth=0.8)
    right.axvline(1, color="#22313f", linewidth=0.8)
    for k, (path, marker) in enumerate(zip(PATHS, "os", strict=True)):
        of = [record["cases"][n]["parameters"][path] for n in names]
        y = -np.arange(len(names)) - 0.16 * (2 * k - 1)
        style = {"color": ("#1f6fb2", "#2a9d5c")[k], "label": PATHS[path]}
        left.plot([p["coverage_95"] for p in of], y, marker, **style)
        right.plot([p["scatter_over_stated"] for p in of], y, marker, **style)
    told = [f"{name}\n{record['cases'][name]['draws']} specimens" for name in names]
    left.set_yticks(-np.arange(len(names)), told, fontsize=8)
    right.set_yticks(-np.arange(len(names)), [""] * len(names))
    left.set_xlim(0.86, 1.0)
    right.set_xlim(0.5, 1.5)
    left.set_xlabel("share of 95 % intervals that hold the truth", fontsize=8)
    right.set_xlabel("scatter of the estimates over the stated standard error", fontsize=8)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


if __name__ == "__main__":
    print(main(Path(__file__).parent))
