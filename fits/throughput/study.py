"""How many small fits a second, against workers: a campaign of 10,000 neo-Hookean tension tests from a closed form.

Workers share two things: the machine's cores, and the one client that hands cases out. The first is measured by the
rate of a single worker once it has started, the second by the client's own CPU time a case (under Dask the scheduler's
with it); so with a core for each worker the rate once all have started is the smaller of (workers times that of one)
and (1 / client's time a case). What starting costs is in "seconds", "first_after_seconds" and the workers' CPU time.

tissuejax study fits/throughput          (CASES=1000 in the environment for a first look;
                                          RUNS="processes-1-1000 dask-2-1000": only these, the others' results stay;
                                          RUNS=none: only the figure, from result.json)
"""

import json
import os
import resource
import shutil
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from tissuejax.campaign.run import begin, go_on, table
from tissuejax.campaign.task import Settings
from tissuejax.progress import Progress, Stage
from tissuejax.storage import write_figure, write_json, write_text

CASES = int(os.environ.get("CASES", "10000"))
PART = min(1000, CASES)  # cases of every run but the largest
RUNS = (
    ("processes", 1, PART),
    ("processes", 2, PART),
    ("dask", 2, PART),
    ("processes", 4, PART),
    ("processes", 4, CASES),
)
STRETCH = np.linspace(1.0, 1.3, 40)
NOISE = 10.0  # Pa
ASKED = os.environ.get("RUNS", "").split()
COLOURS = {"processes": "#1f6fb2", "dask": "#d9730d"}
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


class Clock(Progress, Stage):
    """Notes wall time and this process's CPU time at every case that comes back."""

    def __init__(self):
        self.at = []

    @contextmanager
    def stage(self, description: str, total: int | None = None):
        """Itself, as the only stage."""
        yield self

    def advance(self, steps: int = 1, note: str = "") -> None:
        """One case is back."""
        self.at.append((time.perf_counter(), time.process_time()))
        if len(self.at) % 500 == 0:
            print(f"{len(self.at)} cases", flush=True)

    def late(self) -> tuple[float, float]:
        """Wall and CPU seconds a case, once a tenth of them is back and all workers are at it."""
        late = np.array(self.at[len(self.at) // 10 :])
        return tuple((late[-1] - late[0]) / (len(late) - 1))


def timed(folder: Path, engine: str, workers: int, n: int) -> dict:
    """One campaign from an empty folder: rates, the client's own time a case, and how many truths were covered."""
    shutil.rmtree(folder, ignore_errors=True)
    side, mu = cohort(folder, n)
    began = time.perf_counter()
    store = begin(folder / "campaign", [side], Settings("fit", "neo-hookean", multistart=1))
    planning, others, theirs, clock = time.perf_counter() - began, load(), cpu(), Clock()
    begun = time.perf_counter()
    told = go_on(store.folder, engine, workers, progress=clock)
    wall, client = clock.late()
    rows = {r["sample"]: r for r in table(folder / "campaign")}
    z = [(rows[f"s{i:05d}"]["energy.mu"] - m) / rows[f"s{i:05d}"]["std energy.mu"] for i, m in enumerate(mu)]
    return {
        "engine": engine, "workers": workers, "cases": n, "failed": told["failed"],
        "within_95": float(np.mean(np.abs(z) < 1.96)), "planning_seconds": planning, "seconds": told["seconds"],
        "first_after_seconds": clock.at[0][0] - begun, "per_second": told["per_second"],
        "per_second_started": 1 / wall, "client_ms_a_case": 1e3 * client,
        "workers_cpu_ms_a_case": 1e3 * (cpu() - theirs) / n, "load_before": others,
        "load_after": load(),
    }  # fmt: skip


def cpu() -> float:
    """CPU seconds of the processes begun here that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def load() -> float:
    """Processes that ran or wanted to, mean of a minute."""
    return os.getloadavg()[0]


def main(folder: Path) -> str:
    """Run, time, count; result.json and a figure."""
    work, kept = folder.resolve().parents[1] / "out" / "throughput", folder / "result.json"
    before = json.loads(kept.read_text())["runs"] if ASKED and kept.is_file() else []
    found = {f"{r['engine']}-{r['workers']}-{r['cases']}": r for r in before}
    for engine, workers, n in RUNS:
        if not ASKED or f"{engine}-{workers}-{n}" in ASKED:
            found[f"{engine}-{workers}-{n}"] = timed(work, engine, workers, n)
            write_json(kept, {"cpus": os.cpu_count(), "runs": list(found.values())})
    runs = list(found.values())
    write_figure(folder / "figures" / "throughput.png", drawn(runs, json.loads(kept.read_text())["cpus"]), dpi=110)
    last = max(runs, key=lambda r: r["cases"])
    return f"{last['cases']} fits, {last['workers']} workers: {last['per_second']:.1f} a second"


def drawn(runs: list[dict], cpus: int) -> Figure:
    """Measured rates, and what they would grow to on enough cores: both once all workers have started."""
    figure = Figure(figsize=(6.8, 4.8), layout="constrained")
    ax = figure.subplots()
    most = np.geomspace(1, 1000, 200)
    alone = next(r for r in runs if r["engine"] == "processes" and r["workers"] == 1)
    one = alone["per_second_started"]  # of a core to itself
    for engine, colour in COLOURS.items():
        of = [r for r in runs if r["engine"] == engine and r["cases"] == PART]
        ceiling = 1e3 / min(r["client_ms_a_case"] for r in of)
        ax.plot([r["workers"] for r in of], [r["per_second_started"] for r in of], "o-" if len(of) > 1 else "s",
                color=colour, label=f"{engine}, measured here")  # fmt: skip
        ax.plot(most, np.minimum(one * most, ceiling), "--", color=colour, linewidth=1,
                label=f"{engine}, on paper: {one:.0f} a core, {ceiling:.0f} a client")  # fmt: skip
    ax.axvline(cpus, color="#8895a0", linewidth=0.8, label=f"cores of this machine ({cpus})")
    ax.set(xscale="log", yscale="log", xlabel="workers", ylabel="fits a second, all workers started")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter(ScalarFormatter())
    ax.grid(color="#e6ebef", which="both", linewidth=0.5)
    figure.legend(frameon=False, fontsize=8, loc="outside lower center", ncols=2)
    return figure


if __name__ == "__main__":
    print(main(Path(__file__).parent))
