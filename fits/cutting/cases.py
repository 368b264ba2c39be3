"""The parts of the study: each builds its scenes, runs them and compares with algebra or a published number."""

import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.cutting.oracles import layer_stress, steady_force
from tests.cutting.slabs import BULK, MU, cut, pulled
from tissuejax.tled.simulate import COMPILER_OPTIONS, compiled, run, simulate

jax.config.update("jax_enable_x64", True)
B, W, G = 2e-3, 5e-3, 2.0
NOTCH = 4e-3  # m, cut before: the steady state is meant, not the entry


def late(series, share=0.4):
    """The last part of a series."""
    return np.asarray(series)[-int(share * len(series)) :]


def described(scene, h, bulk=BULK, G=G):
    """One steady cut against the closed form."""
    out = run(scene)
    expected, pressure = steady_force(G, B, W, MU, bulk, float(scene.probe.penalty))
    force = -late(out.force[:, 0]) / h
    b = out.balance
    work = np.asarray(b.work)
    counted = np.abs(np.asarray(b.error))[work > 0.05 * work[-1]]
    travel = 50e-3 * np.asarray(out.end_time)
    toughness = np.polyfit(late(travel), late(b.lost) / h, 1)[0]
    strength = float(np.max(scene.faces.values["strength"]))
    youth = 4 * MU  # plane-strain modulus of nearly incompressible tissue
    return {
        "h_mm": 1e3 * h, "strength_Pa": strength, "bulk_Pa": bulk, "cohesive_length_over_h": youth * G / strength**2 /
        h, "force_N_m": float(force.mean()), "expected_N_m": expected, "error_percent": 100 * (force.mean() / expected
        - 1), "ripple_percent": 100 * float(force.std() / force.mean()), "energy_per_area": float(toughness),
        "balance_percent": 100 * float(counted.max()), "pressure_Pa": pressure,
        "series": [[float(x) for x in travel * 1e3], [float(-x / h) for x in out.force[:, 0]]],
    }  # fmt: skip


def bonded() -> dict:
    """Sides of a bonded slab moved apart by 0.1 mm each: stress with and without the faces' compliance."""
    out = []
    for h in (1e-3, 5e-4):
        scene = pulled(h=h, bulk=2e4, ends=1e-4, energy=np.inf, seconds=0.4, length=0.005, narrow=True)
        b = run(scene).balance
        K, bulk = float(scene.faces.stiffness), 2e4
        low, high = 0.0, 1e-4
        for _ in range(80):  # P(1 + (u - d/2)/W) = K d
            d = 0.5 * (low + high)
            low, high = (d, high) if layer_stress(1 + (1e-4 - d / 2) / W, MU, bulk) > K * d else (low, d)
        work, side = np.asarray(b.support), np.linspace(0, 1e-4, len(b.support) + 1)[1:]
        slope = np.polyfit(side[-8:], work[-8:], 2)
        stress = np.polyval(np.polyder(slope), 1e-4) / 2 / (0.005 * h)
        out.append({"h_mm": 1e3 * h, "stress_Pa": float(stress), "expected_Pa": K * d,
                    "without_faces_Pa": layer_stress(1 + 1e-4 / W, MU, bulk)})  # fmt: skip
    return {"runs": out, "error_percent": max(abs(100 * (r["stress_Pa"] / r["expected_Pa"] - 1)) for r in out)}


def steady() -> dict:
    """Mean force over three meshes, strength 4 kPa (compressible slab, where the steady state is near)."""
    return {
        "runs": [
            described(cut(h=h, travel=0.022, length=0.028, frames=80, notched=NOTCH), h) for h in (1.25e-3, 1e-3, 5e-4)
        ]
    }


def strength() -> dict:
    """Strength halved and doubled with the energy kept."""
    h = 5e-4
    same = dict(h=h, travel=0.022, length=0.028, frames=80, stiff=1.28e8, notched=NOTCH)
    return {"runs": [described(cut(strength=t, **same), h) for t in (2000.0, 4000.0, 8000.0)]}


def nearly() -> dict:
    """Nearly incompressible tissue with friction and with memory: the balance; and the force after a long path."""
    h = 1e-3
    plain = cut(h=h, bulk=2e4, travel=0.07, length=0.08, frames=140, strength=2000.0, friction=0.0)
    rubbed = plain.put({"probe.friction": jnp.asarray(0.1)})
    out = {"runs": [described(plain, h, 2e4)]}
    with_friction = described(rubbed, h, 2e4)
    x, f = np.array(with_friction["series"]), np.array(out["runs"][0]["series"])
    half = len(x[0]) // 2
    slope = np.polyfit(x[0][half:] * 1e-3, (x[1] - f[1])[half:], 1)[0]
    out["friction"] = with_friction | {"slope_N_m2": float(slope), "expected_slope": 0.2 * with_friction["pressure_Pa"]}
    from tissuejax.tled.history import Prony

    relaxing = plain.put({"tissue.prony": Prony(jnp.array([0.3]), jnp.array([0.1]))})
    out["memory"] = described(relaxing, h, 2e4)
    return out


def strip() -> dict:
    """Rivlin and Thomas: a notched strip pulled apart; the side displacement at which the crack runs."""
    from scipy.optimize import brentq

    from tests.cutting.oracles import layer_energy

    out = []
    for h, strong, seconds in ((1e-3, 2000.0, 6.0), (1e-3, 1500.0, 6.0)):
        theory = brentq(lambda d: 2 * W * layer_energy(1 + d / W, MU, BULK) - G, 1e-5, 3e-3)
        scene = pulled(
            h=h,
            bulk=BULK,
            ends=1.25 * theory,
            energy=G,
            length=0.06,
            notch=0.02,
            strength=strong,
            seconds=seconds,
            frames=250,
        )
        b = run(scene).balance
        side = np.linspace(0, 1.25 * theory, len(b.front) + 1)[1:]
        ran = side[np.argmax(np.asarray(b.front) > 0.023)]
        late_ran = side[np.argmax(np.asarray(b.front) > 0.035)]
        out.append({"h_mm": 1e3 * h, "strength_Pa": strong, "theory_mm": 1e3 * theory,
                    "at_3_mm": 1e3 * ran, "at_15_mm": 1e3 * late_ran,
                    "error_percent": 100 * (ran / theory - 1),
                    "balance_percent": 100 * float(np.abs(b.error[100:]).max())})  # fmt: skip
    return {"runs": out}


def beam() -> dict:
    """Double cantilever: force at an opening, steady growth (crack length eliminated)."""
    from tests.cutting.slabs import cantilever

    E, w, h, Gc = 5e4, 10e-3, 5e-3, 0.02
    out = []
    for n in (4, 8):
        scene, opening = cantilever(n)
        b = run(scene).balance
        D = opening(np.asarray(scene.clock.ends))
        P = np.gradient(np.asarray(b.support), D)
        C = Gc * w**2 * h**3 * E / 12
        for at in (2.6e-3, 3.0e-3):
            near = np.abs(D - at) < 0.12e-3
            fit = np.polyval(np.polyfit(D[near], np.asarray(b.support)[near], 2), [at - 1e-5, at + 1e-5])
            expected = C**0.75 * np.sqrt(8 / (E * w * h**3 * at))
            force = float(np.diff(fit)[0] / 2e-5)
            out.append({"elements_through_arm": n, "opening_mm": 1e3 * at, "force_mN": 1e3 * force,
                        "expected_mN": 1e3 * expected, "error_percent": 100 * (force / expected - 1),
                        "peak_mN": 1e3 * float(P[5:].max())})  # fmt: skip
    return {"runs": out}


NAMES = ("faces.values.strength", "faces.values.energy", "probe.friction", "probe.shape.rounding")


def derivatives() -> dict:
    """Derivatives of a cut's force record by four parameters: forward, reverse, and central differences."""
    scene = cut(h=1e-3, bulk=2e4, travel=0.014, frames=40, strength=3000.0, friction=0.1)
    at = jnp.array([3000.0, 2.0, 0.1, float(scene.probe.shape.rounding)])

    def record(x):
        return simulate(scene.put(dict(zip(NAMES, x, strict=True)))).force[:, 0] * 1e3

    forward = jax.jit(jax.jacfwd(lambda s: record(at * s)), compiler_options=COMPILER_OPTIONS)
    weight = jnp.cos(jnp.arange(40.0) / 5)
    backward = jax.jit(jax.grad(lambda s: weight @ record(at * s)), compiler_options=COMPILER_OPTIONS)
    plain = jax.jit(lambda s: record(at * s), compiler_options=COMPILER_OPTIONS)
    one = jnp.ones(4)
    times = {}
    for name, f in (("run", plain), ("forward", forward), ("reverse", backward)):
        f(one).block_until_ready()
        spent = []
        for _ in range(3):
            begun = time.process_time()
            f(one).block_until_ready()
            spent.append(time.process_time() - begun)
        times[name] = min(spent)
    J, g = np.asarray(forward(one)), np.asarray(backward(one))
    out = {"forward_over_run": times["forward"] / times["run"], "reverse_over_run": times["reverse"] / times["run"],
           "reverse_against_forward": float(np.abs(np.asarray(weight) @ J - g).max() / np.abs(g).max()), "differences":
           {}}  # fmt: skip
    for step in (1e-6, 1e-4, 1e-2):
        for i, name in enumerate(NAMES):
            d = one.at[i].add(step), one.at[i].add(-step)
            D = (np.asarray(plain(d[0])) - np.asarray(plain(d[1]))) / (2 * step)
            out["differences"][f"{name} {step:g}"] = float(np.linalg.norm(D - J[:, i]) / np.linalg.norm(D))
    out["jacobian"] = J.T.tolist()
    return out


def cost() -> dict:
    """Time of a step on about 1,000 hexes: bare, with faces, with faces and blade."""
    base = cut(h=5e-4, length=0.025, travel=0.003, frames=10, bulk=2e4)
    count = base.clock.steps * base.clock.frames
    out = {"hexes": len(base.body.cells), "faces": len(base.faces.minus)}
    scenes = {"bare": base.put({"faces": None, "probe": None}), "faces": base.put({"probe": None}), "blade": base,
              "friction": base.put({"probe.friction": jnp.asarray(0.1)})}  # fmt: skip
    spent = {k: [] for k in scenes}
    for scene in scenes.values():
        jax.block_until_ready(compiled(scene).force)
    for _ in range(7):
        for name, scene in scenes.items():
            begun = time.process_time()
            jax.block_until_ready(compiled(scene).force)
            spent[name].append((time.process_time() - begun) / count)
    out |= {f"{k}_us_a_step": 1e6 * min(v) for k, v in spent.items()}
    bare = out["bare_us_a_step"]
    out |= {f"{k}_percent": 100 * (out[f"{k}_us_a_step"] / bare - 1) for k in ("faces", "blade", "friction")}
    return out


def recovery() -> dict:
    """Strength, toughness and friction from 50 % off, 3 % noise, a record from a mesh twice as fine; then the same
    behind a notch as long as the entry."""
    from tests.cutting.records import TRUTH, model, simulated
    from tissuejax.fitting.cut import ENERGY, FRICTION, STRENGTH, fit_cut

    known = {k: v for k, v in TRUTH.items() if k.startswith(("energy", "volumetric"))}
    start = {STRENGTH: 1.5 * TRUTH[STRENGTH], ENERGY: 1.5 * TRUTH[ENERGY], FRICTION: 1.5 * TRUTH[FRICTION]}
    out = []
    for what, notch in (("entry included", None), ("entry left out", 6e-3)):
        seen = simulated(5e-4, 0.03, notch=notch)
        begun, cpu = time.perf_counter(), time.process_time()
        found = fit_cut(seen, model(), known, start)
        row = {"what": what, "status": found.status, "runs": found.runs, "chi2_per_sample": found.chi2_per_sample,
               "wall_s": time.perf_counter() - begun, "cpu_s": time.process_time() - cpu}  # fmt: skip
        for name, path in (("strength", STRENGTH), ("energy", ENERGY), ("friction", FRICTION)):
            row |= {name: found.values[path], f"{name}_std": found.std[path],
                    f"{name}_percent": 100 * (found.values[path] / TRUTH[path] - 1)}  # fmt: skip
        measured = found.predictor.sample.recordings["r"].channels["cutting_force"]
        made = found.predicted["r"].channels["cutting_force"]
        row |= {"unidentified": found.unidentified, "record": [np.asarray(x).tolist() for x in
                (measured.time, measured.values, made.values)]}  # fmt: skip
        out.append(row)
    return {"runs": out}
