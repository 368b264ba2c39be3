"""The parts of the study: each builds its scenes, runs them and compares with algebra or a published number."""

import runpy
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.cache import source

sys.path.insert(0, str(source.ROOT.parent))

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
    toughness, shaken = (np.polyfit(late(travel), late(x) / h, 1)[0] for x in (b.lost, b.damping))
    strength = float(np.max(scene.faces.values["strength"]))
    youth = 4 * MU  # plane-strain modulus of nearly incompressible tissue
    return {
        "h_mm": 1e3 * h, "strength_Pa": strength, "bulk_Pa": bulk, "cohesive_length_over_h": youth * G / strength**2 /
        h, "force_N_m": float(force.mean()), "expected_N_m": expected, "error_percent": 100 * (force.mean() / expected
        - 1), "ripple_percent": 100 * float(force.std() / force.mean()), "energy_per_area": float(toughness),
        "damping_N_m": float(shaken), "balance_percent": 100 * float(counted.max()), "pressure_Pa": pressure,
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
    """Mean force over four meshes, strength 3 kPa; three decay lengths, W sqrt(M / mu) = 9 mm, from either end."""
    same = dict(length=0.07, travel=0.044, frames=120, strength=3000.0)
    runs = [described(cut(h=h, **same), h) for h in (1.25e-3, 1e-3, 7e-4, 5e-4)]
    means = [r["force_N_m"] for r in runs]
    spread = lambda some: 100 * (max(some) / min(some) - 1)  # noqa: E731
    return {"runs": runs, "coarse_three_percent": spread(means[:3]), "fine_three_percent": spread(means[1:])}


def strength() -> dict:
    """Strength halved and doubled with the energy kept, over the same path as `steady`."""
    h = 5e-4
    same = dict(h=h, travel=0.044, length=0.07, frames=120, stiff=1.28e8, notched=NOTCH)
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
    """Rivlin and Thomas: a notched strip pulled apart; the side displacement at which the crack runs. Bonded faces give
    way a little, which stores less ahead of the crack: the displacement with and without that."""
    from scipy.optimize import brentq, minimize_scalar

    from tests.cutting.oracles import layer_energy

    out = []
    for h, strong in ((1e-3, 2000.0), (1e-3, 1500.0)):
        plain = brentq(lambda d: 2 * W * layer_energy(1 + d / W, MU, BULK) - G, 1e-5, 3e-3)
        same = dict(h=h, bulk=BULK, ends=1.15 * plain, energy=G, strength=strong)
        scene = pulled(length=0.08, notch=0.03, seconds=20.0, frames=500, **same)
        K = float(scene.faces.stiffness)

        def stored(d, K=K):
            return minimize_scalar(
                lambda v: 2 * W * layer_energy(1 + (d - v / 2) / W, MU, BULK) + K * v**2 / 2, bounds=(0, d),
                method="bounded", options={"xatol": 1e-12},
            ).fun  # fmt: skip

        theory = brentq(lambda d: stored(d) - G, 1e-5, 3e-3)
        b = run(scene).balance
        side = np.linspace(0, 1.15 * plain, len(b.front) + 1)[1:]
        front = np.maximum.accumulate(np.where(np.isfinite(b.front), b.front, 0.0))
        ran, on = (_reached(front, side, 0.03 + far) for far in (3e-3, 15e-3))
        out.append({"h_mm": 1e3 * h, "strength_Pa": strong, "cohesive_length_over_h": 4 * MU * G / strong**2 / h,
                    "expected_mm": 1e3 * theory, "stiff_faces_mm": 1e3 * plain, "at_3_mm": 1e3 * ran,
                    "at_15_mm": 1e3 * on, "error_percent": 100 * (ran / theory - 1), "stiff_faces_error_percent":
                    100 * (ran / plain - 1), "balance_percent": 100 * float(np.abs(b.error[200:]).max())})  # fmt: skip
    return {"runs": out}


def _reached(front, side, far: float) -> float:
    """Displacement at which the front comes to `far`, between the two frames around it."""
    k = int(np.argmax(front > far))
    return float(np.interp(far, front[k - 1 : k + 1], side[k - 1 : k + 1]))


def peel() -> dict:
    """T-peel of two thin arms: force per width of each is half the toughness (the arms' stretch, a per cent, in it)."""
    from tests.cutting.slabs import peeled

    Gc, E, thick = 0.5, 5e4, 1e-3
    scene, side = peeled(Gc, E, thick)
    b = run(scene).balance
    u, work = side(np.asarray(scene.clock.ends)), np.asarray(b.support) - np.asarray(b.damping) - np.asarray(b.kinetic)
    front = np.asarray(b.front)
    steady = (front > 0.03) & (front < 0.045)
    force = np.polyfit(u[steady], work[steady] / 2 / 1e-3, 1)[0]
    # an arm under F stretches by e = F / (E t): F (2 + 2 e) - 2 (F^2 / 2 E t) = Gc by virtual work
    expected = brentq_force(Gc, E * thick)
    per_area = np.polyfit(front[steady], np.asarray(b.lost)[steady] / 1e-3, 1)[0]
    return {"force_N_m": float(force), "expected_N_m": expected, "inextensible_N_m": Gc / 2,
            "error_percent": 100 * (float(force) / expected - 1), "lost_per_area": float(per_area),
            "balance_percent": 100 * float(np.abs(b.error[100:]).max())}  # fmt: skip


def brentq_force(Gc: float, stiff: float) -> float:
    """Peel force per width of two arms of tension stiffness `stiff` (N/m): 2 F + F^2 / stiff = Gc."""
    return float(stiff * (np.sqrt(1 + Gc / stiff) - 1))


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


def solid() -> dict:
    """Three dimensions: a curved edge drawn at a slant, deeper along the path, above tissue that stays whole."""
    from tests.cutting.slabs import drawn

    scene, tip = drawn()
    out = run(scene)
    b, force = out.balance, np.asarray(out.force)
    work = np.asarray(b.work)
    counted = np.abs(np.asarray(b.error))[work > 0.05 * work[-1]]
    parts = ("friction", "lost", "elastic", "damping")
    shares = {f"{n}_percent": 100 * float(getattr(b, n)[-1] / work[-1]) for n in parts}
    return {
        "hexes": len(scene.body.cells), "balance_percent": 100 * float(counted.max()), "work_mJ": 1e3 * float(work[-1]),
        "parted_mm2": 1e6 * float(b.area[-1]), "front_mm": 1e3 * float(b.front[-1]), "tip_mm": 1e3 * float(tip[-1, 0]),
        "along_cut_N": float(-force[-8:, 0].mean()), "along_blade_N": float(force[-8:, 2].mean()),
        "across_N": float(np.abs(force[:, 1]).max()),
    } | shares  # fmt: skip


def separation() -> dict:
    """See `separation.py`."""
    return runpy.run_path(str(Path(__file__).with_name("separation.py")))["separated"]()


NAMES = ("faces.values.strength", "faces.values.energy", "probe.friction", "probe.shape.rounding")


def derivatives() -> dict:
    """Derivatives of a cut's force record by four parameters: forward, reverse, and central differences; hardly damped
    on elements of 1 mm (1.4 in the cohesive length) and of 0.5 mm, and with the damping that a fit takes (CALM_CUT)."""
    scene = cut(h=1e-3, bulk=2e4, travel=0.014, frames=40, strength=3000.0, friction=0.1)
    at = jnp.array([3000.0, 2.0, 0.1, float(scene.probe.shape.rounding)])
    plain, forward = _programs(scene, at)
    weight = jnp.cos(jnp.arange(40.0) / 5)
    backward = jax.jit(jax.grad(lambda s: weight @ _record(scene, at * s)), compiler_options=COMPILER_OPTIONS)
    one = jnp.ones(4)
    times, clock = {}, {}
    for name, f in (("run", plain), ("forward", forward), ("reverse", backward)):
        f(one).block_until_ready()
        spent = []
        for _ in range(5):
            begun, wall = time.process_time(), time.perf_counter()
            f(one).block_until_ready()
            spent.append((time.process_time() - begun, time.perf_counter() - wall))
        times[name], clock[name] = (min(s[k] for s in spent) for k in (0, 1))
    J, g = np.asarray(forward(one)), np.asarray(backward(one))
    out = {f"{name}_over_run": times[name] / times["run"] for name in ("forward", "reverse")}
    out |= {f"{name}_over_run_wall": clock[name] / clock["run"] for name in ("forward", "reverse")}
    out["reverse_against_forward"] = float(np.abs(np.asarray(weight) @ J - g).max() / np.abs(g).max())
    out |= _differences(plain, J, (1e-6, 1e-4, 1e-2), 3)
    same = dict(bulk=2e4, travel=0.014, frames=40, strength=3000.0, friction=0.1, rounding=float(at[3]))
    others = {"finer": cut(h=5e-4, **same), "calm": cut(h=1e-3, damping=200.0, **same)}
    for name, other in others.items():
        plain, forward = _programs(other, at)
        out[name] = _differences(plain, np.asarray(forward(one)), (1e-4, 1e-2), 3)
    return out | {"jacobian": J.T.tolist()}


def _record(scene, x):
    return simulate(scene.put(dict(zip(NAMES, x, strict=True)))).force[:, 0] * 1e3


def _programs(scene, at):
    """The record, and its Jacobian, by factors on the values `at`."""
    forward = jax.jit(jax.jacfwd(lambda s: _record(scene, at * s)), compiler_options=COMPILER_OPTIONS)
    return jax.jit(lambda s: _record(scene, at * s), compiler_options=COMPILER_OPTIONS), forward


def _differences(plain, J, steps, over: int) -> dict:
    """Relative distance of the derivatives from central differences, of the record and of means over `over` frames."""
    one, out = jnp.ones(4), {"differences": {}, "differences_of_means": {}}
    means = lambda x: np.convolve(x, np.ones(over) / over, "valid")  # noqa: E731  over an element, as a fit compares
    for step in steps:
        for i, name in enumerate(NAMES):
            d = one.at[i].add(step), one.at[i].add(-step)
            D = (np.asarray(plain(d[0])) - np.asarray(plain(d[1]))) / (2 * step)
            out["differences"][f"{name} {step:g}"] = float(np.linalg.norm(D - J[:, i]) / np.linalg.norm(D))
            mean, slope = means(D), means(J[:, i])
            out["differences_of_means"][f"{name} {step:g}"] = float(np.linalg.norm(mean - slope) / np.linalg.norm(mean))
    return out


def cost() -> dict:
    """Time of a step on about 1,000 hexes: bare, with faces, with faces and blade; least of some runs of 1,620
    steps, in which what is worked out once a run is lost."""
    base = cut(h=5e-4, length=0.025, travel=0.006, frames=2, bulk=2e4)
    count = base.clock.steps * base.clock.frames
    out = {"hexes": len(base.body.cells), "faces": len(base.faces.minus)}
    scenes = {"bare": base.put({"faces": None, "probe": None}), "faces": base.put({"probe": None}), "blade": base,
              "friction": base.put({"probe.friction": jnp.asarray(0.1)})}  # fmt: skip
    spent = {k: [] for k in scenes}
    for scene in scenes.values():
        jax.block_until_ready(compiled(scene).force)
    for _ in range(15):
        for name, scene in scenes.items():
            begun = time.process_time()
            jax.block_until_ready(compiled(scene).force)
            spent[name].append((time.process_time() - begun) / count)
    out |= {f"{k}_us_a_step": 1e6 * min(v) for k, v in spent.items()}
    bare = out["bare_us_a_step"]
    out |= {f"{k}_percent": 100 * (out[f"{k}_us_a_step"] / bare - 1) for k in ("faces", "blade", "friction")}
    return out


CORNERS = ((0.5, 0.5, 0.5), (1.5, 1.5, 1.5), (1.5, 0.5, 0.5), (0.5, 1.5, 1.5))
OTHER = {"cohesion.strength": 2200.0, "cohesion.energy": 1.5, "effects.blade-friction.coefficient": 0.15}


def recovery() -> dict:
    """Strength, toughness and friction from 50 % off in both directions and mixed, 3 % noise, a record from a mesh
    twice as fine as that of the descent, which is the mesh of the steps after it; a second draw of the noise; records
    of two meshes that are neither; a second truth; then the first behind a notch as long as the entry."""
    todo = [(f, 3, None, {}, 5e-4) for f in CORNERS]
    todo += [((0.5, 1.5, 0.5), 4, None, {}, 5e-4), ((0.5, 0.5, 0.5), 3, None, {}, 4.2e-4)]
    todo += [((0.5, 0.5, 0.5), 3, None, {}, 6.2e-4), ((0.5, 0.5, 1.5), 5, None, OTHER, 5e-4)]
    todo += [((1.5, 1.5, 1.5), 3, 6e-3, {}, 5e-4)]
    return {"runs": [recovered(*which) for which in todo]}


def recovered(off, seed, notch, other, h) -> dict:
    """One of them: factors on strength, toughness and friction at the start, seed of the noise, length of the notch,
    what differs in the truth, element of the record (m)."""
    from tests.cutting.records import TRUTH, model, simulated
    from tissuejax.fitting.cut import fit_cut
    from tissuejax.fitting.cut_result import ENERGY, FRICTION, STRENGTH

    truth = TRUTH | other
    known = {k: v for k, v in truth.items() if k.startswith(("energy", "volumetric"))}
    paths = {"strength": STRENGTH, "energy": ENERGY, "friction": FRICTION}
    record = simulated(h, 0.03, seed=seed, notch=notch, truth=other)
    begun, cpu = time.perf_counter(), time.process_time()
    start = {p: f * truth[p] for p, f in zip(paths.values(), off, strict=True)}
    found = fit_cut(record, model(), known, start)
    signs = " ".join(f"{q} {100 * (f - 1):+.0f} %" for q, f in zip(paths, off, strict=True))
    out = {
        "what": "entry left out" if notch else "entry included", "start": signs, "noise": seed, "record_h_mm": 1e3 * h,
        "truth": [truth[p] for p in paths.values()], "status": found.status, "warnings": " ".join(found.warnings),
        "runs_of_the_model": found.runs, "chi2_per_sample": found.chi2_per_sample,
        "wall_s": time.perf_counter() - begun, "cpu_s": time.process_time() - cpu,
    }  # fmt: skip
    for name, path in paths.items():
        out[f"{name}_percent"] = 100 * (found.values[path] / truth[path] - 1)
        out[f"{name}_std_percent"] = 100 * found.std[path] / truth[path]
    measured = found.predictor.sample.recordings["r"].channels["cutting_force"]
    made = found.predicted["r"].channels["cutting_force"]
    shown = (measured.time, measured.values, made.values)
    out["not_identified"] = "; ".join(f"{p}: {w}" for p, w in found.unidentified.items())
    return out | {"record": [np.asarray(x).tolist() for x in shown]}


def meshes() -> dict:
    """Table 3.2 redone: a blade pushed into an uncut front, four meshes, one strength and one energy: the way to the
    first fracture, the force there, the peak.

    The strength is one that the coarsest mesh carries (3320 Pa at n = 1) and by which the blade parts the tissue (above
    2 G / b = 2000 Pa: at that value itself faces of h 0.5 mm never parted).
    """
    out = []
    for h in (1e-3, 7e-4, 5e-4, 3.5e-4):
        scene = cut(h=h, length=0.021, travel=0.013, frames=520, strength=3000.0, bulk=2e4, friction=0.0)
        b, force = (o := run(scene)).balance, -np.asarray(o.force[:, 0]) / h
        way = 50e-3 * np.asarray(o.end_time) - 2e-3
        if not float(b.area[-1]) > 0:
            raise RuntimeError(f"nothing parted at h {h:g} m")
        first = int(np.argmax(np.asarray(b.area) > 0))
        near = slice(max(first - 6, 0), first + 7)
        smooth = np.convolve(force, np.ones(40) / 40, "same")  # over 1 mm
        top = int(np.argmax(smooth[: int(0.9 * len(smooth))]))
        out.append({"h_mm": 1e3 * h, "hexes": len(scene.body.cells), "first_fracture_mm": 1e3 * float(way[first]),
                    "past_the_point_mm": 1e3 * float(way[first] - b.front[first]),
                    "force_there_N_m": float(np.polyval(np.polyfit(way[near], force[near], 1), way[first])),
                    "peak_N_m": float(smooth[top]), "peak_at_mm": 1e3 * float(way[top]),
                    "mean_from_6_mm_N_m": float(force[(way > 6e-3) & (way < 10e-3)].mean()),
                    "series": [(1e3 * way).tolist(), force.tolist()]})  # fmt: skip
    return {"runs": out}


def source() -> dict:
    """See `source_run.py`: with its own strength on 42,120 elements; on 9,072 with one that parts the tissue."""
    drawn = runpy.run_path(str(Path(__file__).with_name("source_run.py")))["drawn"]
    return drawn() | {"parting": drawn((54, 12, 14), strength=30e3)}
