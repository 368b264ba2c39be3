"""How fast our own loop is: the bodies of the source's tables, and meshes that are fine under the ball, in CPU time of
one core, float32. `python fits/slow-motion/direct.py` measures this part alone and puts it into result.json."""

import json
import os
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.columns import box
from tissuejax.storage import write_json
from tissuejax.surrogate.live.direct import Direct, calling, direct_scene, largest, made_ready, shortened
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.tled import build, native

POLYNOMIAL = dict(C10=781.898, C20=-747.631, C30=426.135, C40=122.701)  # in vivo 3, of the source's kernel
LIFE = np.arange(2) * 1e-3  # s; one frame: a call of a millisecond
PRESS = 4e-3  # m
HANDS = (0.01, 0.03)  # m/s
MESHES = ((8, 8, 3), (12, 12, 4), (12, 12, 5), (16, 16, 6))
FINE = (12, 12, 5)  # of these meshes: 64 facets that the ball may touch, where the lobe has 16


def body(size, counts, radius: float | None = None):
    """A block of the source's material, K 20 kPa, with a ball a millimetre above its middle where a radius is given."""
    path = None if radius is None else np.array([[0, 0, size[2] + radius + z] for z in (1e-3, -PRESS)])
    return build.scene(
        box(size, counts),
        build.Tissue(ReducedPolynomial(order=4), Quadratic(), POLYNOMIAL, dict(K=20e3), 1060.0),
        LIFE,
        None if path is None else build.ProbePath(LIFE, path, radius),
        numerics=build.Numerics(step=None if path is None else 1e-3),
    ).cast(jnp.float32)


def timed(calls: dict, each: int = 200, rounds: int = 5) -> dict:
    """CPU seconds of one call of each, the least mean of some rounds taken in turns, and spreads of all calls, ms."""
    least, cpu, wall = dict.fromkeys(calls, np.inf), {k: [] for k in calls}, {k: [] for k in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            some = []
            for _ in range(each):
                a, b = time.process_time(), time.perf_counter()
                call()
                some.append(time.process_time() - a)
                wall[name].append(time.perf_counter() - b)
            least[name] = min(least[name], float(np.mean(some)))
            cpu[name] += some
    spread = lambda x: [float(1e3 * np.quantile(x, q)) for q in (0.5, 0.99)]  # noqa: E731
    return {k: {"cpu_s": least[k], "cpu_p50_p99_ms": spread(cpu[k]), "wall_p50_p99_ms": spread(wall[k])} for k in calls}


def stepping(made, state, steps: int, at=(0.0, 0.0, 0.0)):
    """A function that goes on by one call of so many steps, the ball held at its place; all must stay finite."""
    go, kept, ends = calling(made, steps), [state], np.tile(at, (2, 1)).astype(np.float32)

    def call():
        kept[0], force = go(kept[0], ends)
        assert np.isfinite(np.asarray(force)).all()
        return np.asarray(force)

    return call


def held(direct: Direct):
    """The ball pressed in and held: a function of one call."""
    down = direct.at - np.array([0, 0, direct.gap + PRESS])
    for share in np.linspace(0, 1, 150):
        direct.move(direct.at + (down - direct.at) * share)
    return lambda: direct.move(down)


def pressed(direct: Direct, speed: float) -> np.ndarray:
    """Force, N, of a press and a hold of 0.2 s by a hand of that speed, call by call."""
    start, deep = direct.at, direct.gap + PRESS
    count = int(np.ceil(deep / speed / direct.call))
    path = [start - np.array([0, 0, deep * min(1.0, k / count)]) for k in range(1, count + 201)]
    force = np.array([direct.move(p)[2] for p in path])
    direct.home()
    return force


def inertia(direct: Direct, finer: Direct) -> dict:
    """What the static mass of contact does: rms of the force beside steps of a quarter, over the peak of those."""
    found = {}
    for speed in HANDS:
        ours, theirs = pressed(direct, speed), pressed(finer, speed)
        found[f"{1e3 * speed:g} mm/s"] = float(np.sqrt(np.mean((ours - theirs) ** 2)) / theirs.max())
    return found


def paces(matter, radius: float) -> dict:
    """Everything measured."""
    found = {"element_loop": "C" if native.wanted() else "XLA", "load": list(os.getloadavg())}
    cube, free = body((0.1, 0.1, 0.1), (10, 10, 10)), body((0.18, 0.115, 0.04), (14, 10, 5))
    lobe = body((0.18, 0.115, 0.04), (14, 10, 5), radius)
    found["bodies"] = _lobes(cube, free, lobe)
    found["contact_share"] = {}
    for direct in (Direct(lobe, PRESS), Direct(direct_scene(matter, Grid(FINE, radius), np.zeros(2)), 7e-3)):
        words = f"{len(direct.scene.body.cells)} elements, {direct.scene.probe.area.shape[-1]} facets"
        found["contact_share"][words] = _share(direct)
    found["meshes"] = {"x".join(map(str, c)): _mesh(matter, Grid(c, radius)) for c in MESHES}
    return found | {"lobe, XLA": _by_xla(lobe)}


def _told(spent: dict, scene, steps: int) -> dict:
    life = steps * float(scene.clock.step)
    return spent | {"elements": len(scene.body.cells), "step_ms": 1e3 * float(scene.clock.step),
                    "times_life": life / spent["cpu_s"], "steps_per_s": steps / spent["cpu_s"]}  # fmt: skip


def _lobes(cube, free, lobe) -> dict:
    found, first = {}, Direct(lobe, PRESS)
    directs = {n: Direct(shortened(first.scene, n)) for n in (1, 2, 4) if n >= first.steps}
    finest = Direct(shortened(first.scene, 8))
    spent = timed({"cube": stepping(*made_ready(cube), 1), "nothing near": stepping(*made_ready(free), 1)}
                  | {f"{n} a call": held(d) for n, d in directs.items()})  # fmt: skip
    found["cube"] = _told(spent["cube"], cube, 1)
    found["lobe, nothing near"] = _told(spent["nothing near"], free, 1)
    for n, d in directs.items():
        d.home()
        told = _told(spent[f"{n} a call"], d.scene, n)
        found[f"lobe in contact, steps of {1 / n:g} ms"] = told | {"inertia": inertia(d, finest)}
    return found


def _share(direct: Direct, steps: int = 16) -> dict:
    held(direct)()
    bare = stepping(*made_ready(direct.scene.put({"probe": None})), steps)
    both = {"with": stepping(direct.made, direct.state, steps, direct.at), "without": bare}
    spent = {k: v["cpu_s"] / steps for k, v in timed(both, 40, 7).items()}
    return {"share": 1 - spent["without"] / spent["with"], "contact_s": spent["with"] - spent["without"]}


def _mesh(matter, grid: Grid) -> dict:
    direct = Direct(direct_scene(matter, grid, np.zeros(2)), 7e-3)
    spent = timed({"it": held(direct)}, 150)["it"]
    pace = direct.pace()._replace(times_life=direct.call / spent["cpu_s"])
    told = _told(spent, direct.scene, direct.steps)
    finer = Direct(shortened(direct.scene, 4 * direct.steps))
    return told | {"largest_that_keeps_up": list(largest(pace, grid).counts), "inertia": inertia(direct, finer)}


def _by_xla(lobe) -> dict:
    before = os.environ.get("TISSUEJAX_NATIVE")
    os.environ["TISSUEJAX_NATIVE"] = "off"
    try:
        direct = Direct(lobe, PRESS)
        return _told(timed({"it": held(direct)})["it"], direct.scene, direct.steps)
    finally:
        if before is None:
            del os.environ["TISSUEJAX_NATIVE"]
        else:
            os.environ["TISSUEJAX_NATIVE"] = before


if __name__ == "__main__":
    import runpy

    here = Path(__file__).parent
    study = runpy.run_path(str(here / "study.py"))
    result = json.loads((here / "result.json").read_text())
    result["ours"] = paces(study["matter"](study["RADIUS"]), study["RADIUS"])
    write_json(here / "result.json", result)
    print(json.dumps(result["ours"], indent=1))
