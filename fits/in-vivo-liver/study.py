"""Three sites on one lobe with the source's in vivo models 1, 2, 3: ex vivo start, stress-curve iteration, gradients.

tissuejax study fits/in-vivo-liver
"""

import time
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure

from tissuejax.energies.catalogue import volumetric
from tissuejax.energies.published import published
from tissuejax.errors import UnstableSimulation
from tissuejax.estimation.stability import recorded_stability
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_settings import ProbingSettings
from tissuejax.fitting.options import Unknowns
from tissuejax.fitting.setup import problem
from tissuejax.fitting.stress_curve import errors, stress_curve
from tissuejax.mesh.columns import Lobe, columns
from tissuejax.model import Model
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.storage import write_json

jax.config.update("jax_enable_x64", True)

SITES = {
    "site 1": ("in-vivo-1", (-0.014, -0.008)),
    "site 2": ("in-vivo-2", (0.013, -0.006)),
    "site 3": ("in-vivo-3", (0.0, 0.012)),
}
START = "ex-vivo-ogden"
K = 20e3  # Pa, taken as known
RADIUS, SPEED, DEPTH = 4.75e-3, 1.25e-3, 4.0e-3  # m, m/s, m: the source's 9.5 mm tip
FORCE_NOISE, MARKER_NOISE = 2e-3, 2.5e-4  # N and m: the source's sensors
FORCE_RATE, MARKER_RATE = 62.5, 15.0
TRUTH = ProbingSettings(counts=(16, 16, 7), compression=4.0, interval=0.032, step=2.0e-4, penalty=6e8, hourglass=0.2)
FIT = ProbingSettings(counts=(12, 12, 5), compression=5.0, interval=0.032, step=2.5e-4, processes=1)
PUBLISHED = {"site 1": (0.420, 0.030), "site 2": (0.170, 0.015), "site 3": (0.080, 0.025)}


def lobe() -> Lobe:
    """A dome of 70 x 60 x 22 mm with a slanting top."""
    s = np.linspace(0, 1, 41)
    a, b = np.meshgrid(2 * s - 1, 2 * s - 1, indexing="ij")
    top = 0.022 * (0.45 + 0.55 * ((1 - a**2) * (1 - b**2)) ** 0.5) * (1 + 0.06 * a)
    return Lobe.of_grid(s, s, 0.035 * a * (1 - 0.12 * b**2), 0.030 * b * (1 - 0.12 * a**2), np.zeros_like(top), top)


def rig(body: Lobe, name: str, place: tuple[float, float]) -> Recording:
    """Down at 1.25 mm/s, a short hold, up; markers around the site; no measurement yet."""
    height = float(body.top.ev(*body.parameters_of(np.array(place))))
    down = (DEPTH + 1e-3) / SPEED
    t = np.arange(0, 2 * down + 0.9, 0.01)
    z = (
        height
        + RADIUS
        + np.interp(t, [0, 0.3, 0.3 + down, 0.6 + down, 0.6 + 2 * down], [1e-3, 1e-3, -DEPTH, -DEPTH, 1e-3])
    )
    path = np.stack([np.full_like(t, place[0]), np.full_like(t, place[1]), z], 1)
    angle = np.arange(7) * 2 * np.pi / 7
    around = (
        np.array(place)
        + np.stack([np.cos(angle), np.sin(angle)], 1) * np.array([7e-3, 1.05e-2])[np.arange(7) % 2][:, None]
    )
    dots = np.array([[*xy, body.top.ev(*body.parameters_of(xy))] for xy in around])
    ft, mt = np.arange(0.016, t[-1], 1 / FORCE_RATE), np.arange(0.02, t[-1], 1 / MARKER_RATE)
    channels = {
        "force": Channel(ft, np.zeros((len(ft), 3)), "N", FORCE_NOISE),
        "markers": Channel(mt, np.tile(dots, (len(mt), 1, 1)), "m", MARKER_NOISE),
    }
    return Recording(name, "probing", {"probe/time": t, "probe/position": path}, channels, {"probe/radius": RADIUS})


def measured(body: Lobe, name: str, rng: np.random.Generator) -> Sample:
    """The recording of one site: finer mesh, smaller steps, another penalty, noise of the sensors."""
    truth, place = SITES[name]
    blank = Sample("lobe", {name: rig(body, name, place)}, columns(body, (16, 14, 6)), 1060.0)
    entry = published(truth)
    model = Model(entry.energy, volumetric("quadratic"))
    values = {f"energy.{k}": v for k, v in entry.constants.items()} | {"volumetric.K": K}
    told = predictor(model, blank, settings=TRUTH).predict(values)[name]
    return Sample("lobe", {name: noisy(blank.recordings[name], told, rng)}, blank.geometry, 1060.0)


def noisy(blank: Recording, told: Recording, rng: np.random.Generator) -> Recording:
    """What was foretold, with the noise that the sensors of `blank` state, channel by channel."""
    channels = {
        c: replace(ch, values=np.asarray(told.channels[c].values) + rng.normal(0, ch.noise_std, ch.values.shape))
        for c, ch in blank.channels.items()
    }
    return replace(blank, channels=channels)


def scaled(p, name: str, start: dict, told: Recording) -> dict:
    """All moduli times the ratio of measured to simulated force of the simulation that is there already."""
    there = np.asarray(told.channels["force"].values)[:, 2]
    real = np.asarray(p.sample.recordings[name].channels["force"].values)[:, 2]
    factor = float(real @ there / (there @ there))
    return {k: v * factor if k.startswith("energy.mu") else v for k, v in start.items()}


def by_gradients(p, name: str, start: dict, most: int = 4) -> tuple[dict, list[dict]]:
    """Gauss-Newton from simulations that carry their derivatives; the best values and how it went.

    Free are two things that keep the start's character: one factor on all moduli and one on all exponents (the moduli
    one by one are nearly the same direction, and leave the stable energies at once). Force is nearly linear in the
    moduli, so the first factor comes from the start's own simulation. No step is longer than a half of a factor, none
    leads into an unstable energy, one that breaks or worsens is shortened; it ends where a step gains less than 10 %.
    """
    runs = [run_of(p, name, start, told := p.predict(start)[name], "start")]
    values = scaled(p, name, start, told)
    posed = problem(p, unknowns=Unknowns(start=values, free=tuple(k for k in start if k.startswith("energy."))))
    moduli = np.array([k.startswith("energy.mu") for k in posed.free])
    x, step, best = posed.vector(values), None, None
    while len(runs) < most:
        tried = x if best is None else x + step
        try:
            r, J = posed.linearised(posed.values(tried))
        except UnstableSimulation:
            runs.append({"force_N": float("inf"), "what": "broke"})
            step = step / 4
            continue
        rms = {c: (3 * np.mean((r[rows] * posed.sigma((name, c))) ** 2)) ** 0.5 for (_, c), rows in posed.rows.items()}
        runs.append({"force_N": float(rms["force"]), "marker_m": float(rms["markers"]), "what": "with tangents"})
        if best is not None and r @ r > best:
            step = step / 2
            continue
        gain = np.inf if best is None else best - r @ r
        x, best = tried, float(r @ r)
        factors = np.stack([np.where(moduli, x, 0.0), np.where(moduli, 0.0, x)], 1)
        asked = np.linalg.lstsq(J @ factors, -r, rcond=None)[0]
        if gain < 0.1 * best:
            break
        step = factors @ (asked * min(1.0, 0.5 / np.abs(asked).max()))
        for _ in range(6):  # told without a simulation
            if recorded_stability(p, posed.values(x + step)).stable:
                break
            step = step / 2
    return posed.values(x), runs


def run_of(p, name: str, values: dict, told: Recording, what: str) -> dict:
    """Errors of a simulation."""
    force, markers = errors(p.sample.recordings[name], told)
    return {"force_N": force, "marker_m": markers, "what": what}


def study_site(body: Lobe, name: str, rng: np.random.Generator) -> dict:
    """One row of the table."""
    sample = measured(body, name, rng)
    entry = published(START)
    model = Model(entry.energy, volumetric("quadratic"))
    start = {f"energy.{k}": float(v) for k, v in entry.constants.items()} | {"volumetric.K": K}
    p = predictor(model, sample, settings=FIT)
    begun = time.perf_counter()
    _, turns = stress_curve(p, name, start)
    manual, begun = time.perf_counter() - begun, time.perf_counter()
    values, runs = by_gradients(p, name, start)
    seconds = time.perf_counter() - begun
    last = min((run for run in runs if "marker_m" in run), key=lambda run: run["force_N"])
    return {
        "truth": SITES[name][0],
        "ex_vivo": {"force_N": turns[0].force_rmse, "marker_m": turns[0].marker_rmse},
        "stress_curve": {
            "force_N": turns[-1].force_rmse, "marker_m": turns[-1].marker_rmse,
            "simulations": len(turns), "seconds": manual,
            "turns": [{"force_N": t.force_rmse, "marker_m": t.marker_rmse, "stable": t.stable} for t in turns],
        },
        "gradients": {
            "force_N": last["force_N"], "marker_m": last["marker_m"], "simulations": len(runs), "seconds": seconds,
            "runs": runs, "values": values,
        },
        "published": {"ex_vivo_N": PUBLISHED[name][0], "stress_curve_N": PUBLISHED[name][1]},
    }  # fmt: skip


def draw(rows: dict, folder: Path) -> None:
    """Force error against the number of simulations, both ways, site by site."""
    figure = Figure(figsize=(8.5, 2.8), layout="constrained")
    for ax, (name, row) in zip(figure.subplots(1, 3, sharey=True), rows.items(), strict=True):
        for label, runs, color in (
            ("stress curve", row["stress_curve"]["turns"], "#b65a1e"),
            ("gradients", row["gradients"]["runs"], "#1f5fa8"),
        ):
            force = [
                run["force_N"] if run["force_N"] is not None and np.isfinite(run["force_N"]) else None for run in runs
            ]
            done = [(i + 1, f) for i, f in enumerate(force) if f is not None]
            ax.semilogy(*zip(*done, strict=True), "o-", color=color, markersize=4, linewidth=1.2, label=label)
            if len(done) < len(force):
                ax.annotate("can't be simulated", done[-1], (6, 4), textcoords="offset points", fontsize=7, color=color)
        ax.axhline(0.010, color="#777777", linewidth=0.8, linestyle=":", label="aim")
        ax.axhline(3**0.5 * FORCE_NOISE, color="#cccccc", linewidth=0.8, label="noise")
        ax.set(title=name, xlabel="simulations", xticks=range(1, 6))
        ax.title.set_fontsize(9)
        ax.tick_params(labelsize=8)
        ax.spines[["top", "right"]].set_visible(False)
    figure.axes[0].set_ylabel("force RMSE, N")
    figure.axes[-1].legend(fontsize=7, frameon=False)
    (folder / "figures").mkdir(exist_ok=True)
    figure.savefig(folder / "figures" / "errors.png", dpi=100)


def main(folder: Path) -> str:
    """Write result.json; returns the answer in a sentence."""
    body, rows = lobe(), {}
    for i, name in enumerate(SITES):
        rows[name] = study_site(body, name, np.random.default_rng([2012, i]))
        write_json(folder / "result.json", rows)
        print(name, {k: (v["force_N"], v["marker_m"]) for k, v in rows[name].items() if "force_N" in v}, flush=True)
    draw(rows, folder)
    best = [r["gradients"]["force_N"] for r in rows.values()]
    manual = [min(turn["force_N"] for turn in r["stress_curve"]["turns"]) for r in rows.values()]
    listed = [", ".join(f"{x:.4f}" for x in values) for values in (best, manual)]
    return f"force RMSE by gradients {listed[0]} N, by the stress curve {listed[1]} N"


if __name__ == "__main__":
    print(main(Path(__file__).parent))
