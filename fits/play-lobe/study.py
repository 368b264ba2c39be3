"""Is a precomputed probing as good as the full model, and quick enough for a hand? A table and a figure.

tissuejax study fits/play-lobe       some minutes of precomputing on two cores (kept in out/play-lobe), then ten
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from tissuejax.effects.adhesion import Adhesion
from tissuejax.effects.friction import Friction
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.energies import catalogue
from tissuejax.errors import InputError
from tissuejax.experiments.probing import assembled
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.play import haptics
from tissuejax.progress import for_terminal
from tissuejax.recordings.recording import Geometry
from tissuejax.storage import write_json
from tissuejax.surrogate import store
from tissuejax.surrogate.live.ask import Asker
from tissuejax.surrogate.live.native import Native
from tissuejax.surrogate.places import Box
from tissuejax.surrogate.precompute import precompute
from tissuejax.surrogate.predict import force_along
from tissuejax.surrogate.ramp import Matter, bare_setup
from tissuejax.surrogate.site_mesh import Grid, geometry, half, nodes, topology
from tissuejax.tled.simulate import run

jax.config.update("jax_enable_x64", True)

SIZE, RADIUS, TOP = (0.06, 0.06, 0.02), 4.75e-3, 0.02
PRONY = {"g1": 0.2, "g2": 0.15, "tau1": 0.5, "tau2": 5.0}
WANTED = Box(np.array([-0.012, -0.012]), np.array([0.012, 0.012]), 7e-3, (5, 5), 8)
SECONDS = 60.0


def matter(*effects, **values) -> Matter:
    """A slab of liver-like tissue and the ball of the recordings; it relaxes unless other effects are named."""
    if not effects:
        effects, values = (Viscoelasticity(terms=2),), {f"effects.viscoelasticity.{k}": v for k, v in PRONY.items()}
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"), effects)
    values = model.defaults | {"energy.C10": 645.0, "energy.C20": 500.0, "volumetric.K": 20e3} | values
    return Matter(model, values, lobe_of_mesh(box(SIZE, (4, 4, 2))), RADIUS, 1060.0)


def tabulated(out: Path):
    """The surrogate, precomputed or taken from `out`; how long it took and how large it is."""
    file = out / "slab.play.h5"
    if not file.is_file():
        begun, cpu = time.perf_counter(), os.times()
        made = precompute(matter(), WANTED, Grid((16, 16, 6), RADIUS), None, out / "sites", for_terminal())
        spent = [b - a for a, b in zip(cpu, os.times())]
        made.record["sample"] = "slab"
        made.record["took"] = {"wall_s": time.perf_counter() - begun, "cpu_s": sum(spent[:4])}
        store.write(made, file)
    return store.read(file), file.stat().st_size


def line(surrogate) -> dict:
    """Lateral force along a line at one depth: its second difference over 0.75 mm, and the same of the vertical."""
    x = np.arange(-0.0105, 0.0105, 7.5e-4)
    force = np.array([surrogate.elastic(jnp.array([v, 0.002, TOP + RADIUS - 4e-3])) for v in x])
    second = np.abs(np.diff(force, 2, axis=0)).max(0)
    return {"lateral_N": float(second[0]), "vertical_N": float(second[2]), "force_N": float(force[:, 2].mean())}


def loops(surrogate, count: int = 8) -> dict:
    """Closed paths in and out of contact without relaxation: net work over the work of the press."""
    asker, rng, worst = Asker(surrogate.put({"memory.g": jnp.zeros(2)})), np.random.default_rng(3), 0.0
    angle = np.linspace(0, 2 * np.pi, 4001)
    for _ in range(count):
        a, b, phase = rng.uniform(0.002, 0.009), rng.uniform(0.002, 0.009), rng.uniform(0, 6.28)
        d = 2.5e-3 - 3.5e-3 * np.cos(angle)
        path = np.stack([a * np.sin(angle + phase), b * np.sin(2 * angle), TOP + RADIUS - d], 1)
        asker.rest()
        force = np.array([asker.tick(p, 1e-3) for p in path])
        step = np.diff(path, axis=0)
        mean = (force[1:] + force[:-1]) / 2
        press = np.sum(np.maximum(mean[:, 2] * -step[:, 2], 0))
        worst = max(worst, abs(float(np.sum(mean * step))) / press)
    return {"paths": count, "net_over_press": worst}


PHASES = {
    "press": (0.2, 1.2),
    "hold": (1.2, 3.2),
    "drag": (3.2, 4.2),
    "hold after": (4.2, 6.2),
    "lift": (6.2, 7.2),
    "lifted": (7.2, 8.0),
}


def narrow(tissue: Matter, grid: Grid, core: float) -> Geometry:
    """A mesh whose equal elements about the middle reach only as far as `core`, m."""
    wide = []
    for n, inner in zip(grid.counts[:2], grid.inner):
        right = half(SIZE[0] / 2, core, inner, n // 2 - inner)
        wide.append(0.5 + np.concatenate([-right[::-1], [0.0], right]) / SIZE[0])
    cells, fixed, _ = topology(grid)
    return Geometry(nodes(tissue.lobe, *wide, grid.counts[2]).reshape(-1, 3), cells, "hexahedron", fixed)


def full(tissue: Matter, counts, t, path, speed: float, core=None) -> tuple[np.ndarray, np.ndarray, int]:
    """Times and forces of TLED on a fixed mesh along a path, `speed` times faster than life; and the elements."""
    grid, interval = Grid(counts, 1.25 * RADIUS), float(t[1] - t[0])
    body = geometry(tissue.lobe, np.zeros(2), grid) if core is None else narrow(tissue, grid, core)
    setup = bare_setup(tissue, body, topology(grid)[2], np.zeros(2), TOP + RADIUS)
    scene, _ = assembled(tissue.model, {k: jnp.asarray(float(v)) for k, v in tissue.values.items()}, setup)
    scene = scene.put({
        "probe.time": jnp.asarray(t), "probe.position": jnp.asarray(path), "clock.start": jnp.asarray(-interval / 2),
        "clock.interval": jnp.asarray(interval), "clock.compression": jnp.asarray(speed), "clock.frames": len(t),
        "clock.steps": int(np.ceil(interval / speed / float(scene.clock.step))),
    }).cast(jnp.float32)  # fmt: skip
    out = run(scene)
    return np.asarray(out.time, float), np.asarray(out.force, float), len(body.cells)


def along(surrogate, t, path, at) -> np.ndarray:
    """The surrogate's force along a path, at given times."""
    ours = np.asarray(force_along(surrogate, jnp.asarray(t), jnp.asarray(path)))
    return np.stack([np.interp(at, t, c) for c in ours.T], 1)


def drawn() -> tuple[np.ndarray, np.ndarray]:
    """Times and path: press 5 mm, hold, drag 6 mm, hold, lift."""
    t = np.arange(0, 8.0, 0.02)
    knots = [0, 0.2, 1.2, 3.2, 4.2, 6.2, 7.2, 8.0]
    d = np.interp(t, knots, [-1e-3, -1e-3 * 0.2, 5e-3, 5e-3, 5e-3, 5e-3, -1.5e-3, -1.5e-3])
    x = np.interp(t, knots, [-3e-3] * 4 + [3e-3] * 4)
    return t, np.stack([x, 0 * x, TOP + RADIUS - d], 1)


def drag(surrogate, tissue: Matter, counts=(16, 16, 6), speed: float = 1.5) -> dict:
    """Press, hold, drag, hold, lift against TLED on a fixed mesh: rms of the difference over the peak, by phase."""
    t, path = drawn()
    at, force, elements = full(tissue, counts, t, path, speed)
    ours, peak, phases = along(surrogate, t, path, at), force[:, 2].max(), {}
    for name, (a, b) in PHASES.items():
        on = (at >= a) & (at < b)
        rms = np.sqrt(np.mean((ours - force)[on] ** 2, axis=0)) / peak
        phases[name] = {"vertical": float(rms[2]), "lateral": float(rms[0])}
    return {
        "elements": elements, "times_faster_than_life": speed, "peak_N": float(peak), "phases": phases,
        "least_when_lifted_N": float(ours[at > 7.2, 2].min()),
        "series": {"time": at.tolist(), "full": force.tolist(), "surrogate": ours.tolist()},
    }  # fmt: skip


def rubbed(surrogate, coefficients=(0.1, 0.3)) -> dict:
    """Friction in the same drag, without relaxation, and what of the lateral force is friction's alone."""
    found, bare = {}, surrogate.put({"memory.g": jnp.zeros(2)})
    for mu in coefficients:
        tissue = matter(Friction(), **{"effects.friction.coefficient": mu})
        one = drag(bare.put({"rub.friction": mu}), tissue)
        series = one.pop("series")
        at, force, ours = (np.array(series[k]) for k in ("time", "full", "surrogate"))
        sliding = (at > 3.7) & (at < 4.2)
        one["lateral_when_sliding_N"] = {"full": force[sliding, 0].mean(), "surrogate": ours[sliding, 0].mean()}
        found[f"coefficient {mu:g}"] = one
    return found


def pulled(t, depth, at, force) -> dict:
    """The greatest pull, N, and the height over first contact at which the last half millinewton is gone, m."""
    last = np.flatnonzero(force[:, 2] < -5e-4)
    free = -np.interp(at[last[-1]], t, depth) if len(last) else 0.0
    return {"greatest_pull_N": -float(force[:, 2].min()), "free_at_height_m": float(free)}


def stuck(surrogate, strengths=(200.0, 1000.0), reach: float = 2e-4) -> dict:
    """Adhesion without relaxation: the greatest pull on the way out and the height at which the ball comes free, beside
    the full model on elements of 2, 1 and 0.6 mm under the ball."""
    found, bare = {}, surrogate.put({"memory.g": jnp.zeros(2)})
    t = np.arange(0, 4.0, 0.01)
    d = np.interp(t, [0, 1, 1.5, 4.0], [-3e-4, 3e-3, 3e-3, -4.5e-3])
    path = np.stack([0 * t, 0 * t, TOP + RADIUS - d], 1)
    meshes = {"2 mm": ((16, 16, 6), None), "1 mm": ((16, 16, 6), 5e-3), "0.6 mm": ((24, 24, 8), 5e-3)}
    for strength in strengths:
        values = {"effects.adhesion.strength": strength, "effects.adhesion.reach": reach}
        ours = along(bare.put({"rub.strength": strength, "rub.reach": reach}), t, path, t)
        one = {"surrogate": pulled(t, d, t, ours)}
        for name, (counts, core) in meshes.items():
            at, force, elements = full(matter(Adhesion(), **values), counts, t, path, 3.0, core)
            mine = along(bare.put({"rub.strength": strength, "rub.reach": reach}), t, path, at)
            rms = float(np.sqrt(np.mean((mine - force)[:, 2] ** 2)) / force[:, 2].max())
            one[name] = pulled(t, d, at, force) | {"elements": elements, "surrogate_rms_over_peak": rms}
        found[f"{strength:g} Pa"] = one
    return found


def plain_of(surrogate):
    """Without memory."""
    return type(surrogate)(**(vars(surrogate) | {"memory": None}))


def speeds(surrogate) -> dict:
    """Seconds of CPU for one force in Python and for one picture's nodes."""
    asker, p = Asker(surrogate), np.array([0.001, 0.002, TOP + RADIUS - 4e-3])
    plain = Asker(plain_of(surrogate))
    out = {}
    for name, one in (
        ("python_force", lambda: plain.tick(p, 1e-3)),
        ("python_force_relaxing", lambda: asker.tick(p, 1e-3)),
    ):
        cpu = time.process_time()
        for _ in range(1000):
            one()
        out[name + "_us"] = 1e3 * (time.process_time() - cpu)
    out["c_force_us"] = 1e6 * min(Native(plain_of(surrogate)).seconds() for _ in range(5))
    out["c_force_relaxing_us"] = 1e6 * min(Native(surrogate).seconds() for _ in range(5))
    modes = np.asarray(surrogate.surface.modes).reshape(len(surrogate.surface.modes), -1)
    cpu = time.process_time()
    for _ in range(200):
        asker.shape() @ modes
    out["picture_us"] = 5e3 * (time.process_time() - cpu)
    return out


def looped(surrogate) -> dict:
    """The C loop beside two processes that do nothing but work."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: sum(range(100000))"]) for _ in range(2)]
    try:
        elastic = haptics.loop(plain_of(surrogate), seconds=SECONDS)
        relaxing = haptics.loop(surrogate, seconds=SECONDS)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    return {"elastic": elastic.record, "relaxing": relaxing.record}


def replayed(out: Path, shared: Path) -> dict | None:
    """p01's r3 by the surrogate of the fitted model, on two meshes, and by direct TLED."""
    file = shared / "practice" / "p01.h5"
    if not file.is_file():
        return None
    root, found = Path(__file__).resolve().parents[1], {}
    for mesh, name in (("16x16x6", "p01.play.h5"), ("22x22x8", "p01-fine.play.h5")):
        target = out / name
        if not target.is_file():
            _command([
                "precompute", str(root / "probing-practice"), "--sample", str(file), "--recording", "r3", "--reach",
                "1", "--spacing", "2", "--depth", "7", "--mesh", mesh, "--out", str(target), "--json",
            ])  # fmt: skip
        done = _command(["play", str(target), "--replay", str(file), "--recording", "r3", "--json"])
        record = store.read(target).record
        found[mesh] = json.loads(done) | {"error": record["error"], "numerical": record["numerical"]}
    return found


def _command(words: list[str]) -> str:
    done = subprocess.run([sys.executable, "-m", "tissuejax", *words], capture_output=True, text=True)
    if done.returncode:
        raise InputError(done.stderr)
    return done.stdout


def draw(found: dict) -> Figure:
    """The relaxing path: force of the full model and of the surrogate, and their difference."""
    s = found["series"]
    t, full, ours = (np.array(s[k]) for k in ("time", "full", "surrogate"))
    figure = Figure(figsize=(9, 4.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, height_ratios=[2, 1])
    for column, (axis, word) in enumerate(((2, "vertical"), (0, "along the drag"))):
        top, low = axes[:, column]
        top.plot(t, full[:, axis], color="#222", linewidth=1.6, label="full model (TLED)")
        top.plot(t, ours[:, axis], color="#1f7fd8", linewidth=1.1, linestyle="--", label="surrogate")
        low.plot(t, 1e3 * (ours - full)[:, axis], color="#c0392b", linewidth=1)
        top.set_title(f"force {word} (N)", fontsize=9)
        low.set_title("surrogate less full model (mN)", fontsize=9)
        for ax in (top, low):
            ax.spines[["top", "right"]].set_visible(False)
            ax.tick_params(labelsize=8)
        for name, (a, b) in PHASES.items():
            top.text(
                (a + b) / 2,
                1.0,
                name,
                transform=top.get_xaxis_transform(),
                ha="center",
                va="top",
                fontsize=6,
                color="#667",
            )
            top.axvline(a, color="#e0e3e8", linewidth=0.8, zorder=0)
        low.set_xlabel("time (s)", fontsize=8)
    axes[0, 0].legend(fontsize=7, loc="lower center")
    return figure


def main(folder: Path) -> str:
    """Run all of it; write result.json and figures/drag.png; the answer in a sentence."""
    shared = Path(os.environ.get("TISSUEJAX_SHARED", folder.resolve().parents[2] / "shared"))
    out = folder.resolve().parents[1] / "out" / "play-lobe"
    (folder / "figures").mkdir(exist_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    made, size = tabulated(out)
    surrogate = made.surrogate
    result = {
        "bytes": size,
        **{k: made.record.get(k) for k in ("box", "error", "numerical", "took", "shape_modes", "stress_modes")},
    }

    def keep(name, part):
        result[name] = part
        write_json(folder / "result.json", result)

    keep("line", line(surrogate))
    keep("loops", loops(surrogate))
    keep("speeds", speeds(surrogate))
    found = drag(surrogate, matter())
    draw(found).savefig(folder / "figures" / "drag.png", dpi=110)
    found.pop("series")
    keep("drag", found)
    finer = drag(surrogate, matter(), (24, 20, 8), 5.0)
    finer.pop("series")
    keep("drag, finer mesh", finer)
    keep("friction", rubbed(surrogate))
    keep("adhesion", stuck(surrogate))
    keep("replay", replayed(out, shared))
    keep("haptics", looped(surrogate))
    error = result["error"]
    return (
        f"held-out force median {100 * error['force_median']:.2f} %, worst {100 * error['force_worst']:.2f} %; drag "
        f"{100 * max(p['vertical'] for p in found['phases'].values()):.1f} % vertical, "
        f"{100 * max(p['lateral'] for p in found['phases'].values()):.1f} % lateral"
    )


if __name__ == "__main__":
    print(main(Path(__file__).parent))
