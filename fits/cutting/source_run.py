"""The source's own run (Lister 2012, 3.2.1), without its layer of wedges and without taking tissue away."""

import time

import jax.numpy as jnp
import numpy as np

from tissuejax.cohesion.catalogue import law
from tissuejax.energies.reduced_polynomial import ReducedPolynomial
from tissuejax.energies.volumetric import Quadratic
from tissuejax.mesh.slab import block
from tissuejax.mesh.split import split
from tissuejax.tled import build, seam
from tissuejax.tled.blade import Wedge
from tissuejax.tled.simulate import compiled

IN_VIVO_3 = dict(C10=781.898, C20=-747.631, C30=426.135, C40=122.701)  # Pa, Lister 2012, 3.2.1; D 1e-4 1/Pa
PUBLISHED = 13594.0 * 0.365e-3  # N/m: its strength times the blade's thickness, the force over depth that it stands for


def drawn(parts=(54, 26, 30), toughness=5.0, strength=13594.0) -> dict:
    """The source's run: 5 mm of contact in 0.1 s and 30 mm in 0.6 s (smooth step), a blade of 0.365 mm and 28.44
    degrees, in vivo 3, about 40,000 hexes, single precision; no wedge layer, no tissue removed, not cut through.

    Its energy, 1.25e-4 J/m^2 as entered, ends the law at 18 nm. Here the toughness is what its force implies (5 J/m^2);
    a blade so thin parts it from 2 G / b = 27 kPa on, which no such mesh resolves.
    """

    b, slope, deep, height, h = 0.365e-3, float(np.tan(np.radians(14.22))), 5e-3, 0.02, 0.7e-3
    side = np.concatenate([[0], np.cumsum(1.25 ** np.arange(parts[1] // 2))])
    side = 0.03 * side / side[-1]
    up = np.linspace(0, height, parts[2] + 1)
    body = block(np.arange(parts[0] + 1) * h, np.concatenate([-side[:0:-1], side]), up, "base")
    made = split(body, lambda p: p[:, 1], within=lambda p: p[:, 2] > height - deep)
    smooth = lambda u: u**3 * (10 - 15 * u + 6 * u**2)  # noqa: E731
    at = np.linspace(0, 0.7, 281)
    x = -5e-3 + 5e-3 * smooth(np.clip(at / 0.1, 0, 1)) + 30e-3 * smooth(np.clip((at - 0.1) / 0.6, 0, 1))
    tip = np.stack([x, 0 * x, np.full_like(x, height - deep)], 1)
    frames = 140
    scene = build.scene(
        made.geometry,
        build.Tissue(ReducedPolynomial(order=4), Quadratic(), IN_VIVO_3, dict(K=2e4), 981.0),
        (np.arange(frames) + 0.5) * 0.7 / frames,
        numerics=build.Numerics(mass_damping=20.0, hourglass=seam.HOURGLASS),
        joined=seam.pairs(made),
    )
    scene = seam.joined(scene, made, law("bilinear"), {"strength": strength, "energy": toughness})
    blade = Wedge(b, slope, seam.shoulder(b, slope, h), bottom=0.2e-3)
    scene = seam.armed(scene, made, blade, at, tip, friction=0.0).cast(jnp.float32)
    compiled(scene).force.block_until_ready()
    begun, cpu = time.perf_counter(), time.process_time()
    out = compiled(scene)
    out.force.block_until_ready()
    spent, cpu = time.perf_counter() - begun, time.process_time() - cpu
    balance, force = out.balance, np.asarray(out.force, float) / deep
    way = 1e3 * np.interp(np.asarray(out.end_time, float), at, x)
    if int(out.failed) >= 0:
        place = 1e3 * np.asarray(scene.body.points)[np.asarray(scene.body.cells)[int(out.element)]].mean(0)
        return {
            "hexes": len(body.cells), "stable": False, "failed_at_mm": float(way[int(out.failed)]), "failed_at_s":
            float(out.end_time[int(out.failed)]), "element_mm": [float(c) for c in place], "run_cpu_s": cpu,
            "step_us": 1e6 * float(scene.clock.step),
        }  # fmt: skip
    work = np.asarray(balance.work, float)
    late_work = work > 0.05 * work[-1]
    cutting = (way > 15) & (way < 28)
    return {
        "hexes": len(body.cells), "faces": len(made.minus), "steps": int(scene.clock.frames * scene.clock.steps),
        "step_us": 1e6 * float(scene.clock.step), "run_cpu_s": cpu, "run_wall_s": spent, "stable": int(out.failed) < 0,
        "force_over_depth_N_m": float(-force[cutting, 0].mean()), "along_blade_N_m": float(force[cutting, 2].mean()),
        "across_N_m": float(np.abs(force[cutting, 1]).max()), "published_peak_N_m": PUBLISHED,
        "balance_percent": 100 * float(np.abs(np.asarray(balance.error))[late_work].max()),
        "lost_in_faces_over_area": float(balance.lost[-1] / balance.area[-1]),
        "front_mm": 1e3 * float(balance.front[-1]),
        "series": [way.tolist(), (-force[:, 0]).tolist(), force[:, 2].tolist()],
    }  # fmt: skip
