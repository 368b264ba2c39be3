"""How many small fits a second, against workers: a campaign of 10,000 neo-Hookean tension tests from a closed form.

tissuejax study fits/throughput          (CASES=1000 in the environment for a first look)
"""

import os
import shutil
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tissuejax.campaign.run import begin, go_on, table
from tissuejax.campaign.task import Settings
from tissuejax.progress import for_terminal
from tissuejax.storage import write_figure, write_json, write_text

CASES = int(os.environ.get("CASES", "10000"))
PART = 1000  # cases with each number of workers; all of them with the largest
WORKERS = (1, 2, 4)
STRETCH = np.linspace(1.0, 1.3, 40)
NOISE = 10.0  # Pa
SIDE = """file = "tests.csv"
sample = "{specimen}"
recording = "pull"
experiment = "uniaxial"
[columns]
stretch = { column = "stretch" }
nominal_stress = { column = "stress_Pa", unit = "Pa" }
[noise]
nominal_stress = "10 Pa"
"""


def cohort(folder: Path, n: int) -> tuple[str, np.ndarray]:
    """Side file of n tests, and their true moduli, Pa: mu (l - l^-2) with noise."""
    rng = np.random.default_rng(20)
    mu = 3000.0 * rng.lognormal(0.0, 0.2, n)
    stress = mu[:, None] * (STRETCH - STRETCH**-2) + NOISE * rng.normal(size=(n, len(STRETCH)))
    rows = [f"s{i:05d},{l:.6f},{p:.4f}\n" for i, row in enumerate(stress) for l, p in zip(STRETCH, row, strict=True)]
    write_text(folder / "tests.csv", "specimen,stretch,stress_Pa\n" + "".join(rows))
    return str(write_text(folder / "tests.toml", SIDE)), mu


def main(folder: Path) -> str:
    """Run, time, count; result.json and a figure."""
    work = folder.resolve().parents[1] / "out" / "throughput"
    settings, runs = Settings("fit", "neo-hookean", multistart=1), []
    for workers in WORKERS:
        n = CASES if workers == max(WORKERS) else min(PART, CASES)
        shutil.rmtree(work, ignore_errors=True)
        side, mu = cohort(work, n)
        begin(work / "campaign", [side], settings)
        told = go_on(work / "campaign", "processes", workers, progress=for_terminal())
        rows = {r["sample"]: r for r in table(work / "campaign")}
        z = [(rows[f"s{i:05d}"]["energy.mu"] - m) / rows[f"s{i:05d}"]["std energy.mu"] for i, m in enumerate(mu)]
        runs.append(
            {"workers": workers, "cases": n, "seconds": told["seconds"], "per_second": told["per_second"],
             "failed": told["failed"], "within_95": float(np.mean(np.abs(z) < 1.96)), "load": os.getloadavg()[0]}
        )  # fmt: skip
        write_json(folder / "result.json", {"cpus": os.cpu_count(), "runs": runs})
    figure = Figure(figsize=(5, 3.2), layout="constrained")
    ax = figure.subplots()
    ax.plot([r["workers"] for r in runs], [r["per_second"] for r in runs], "o-", color="#1f6fb2")
    ax.set(
        xlabel=f"workers (on {os.cpu_count()} cores)", ylabel="fits a second, start of workers included", ylim=(0, None)
    )
    ax.set_xticks(WORKERS)
    ax.grid(color="#e6ebef")
    write_figure(folder / "figures" / "throughput.png", figure, dpi=110)
    last = runs[-1]
    return f"{last['cases']} fits, {last['workers']} workers: {last['per_second']:.1f} a second"


if __name__ == "__main__":
    print(main(Path(__file__).parent))
