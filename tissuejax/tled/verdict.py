"""What went wrong in a run, in a sentence: broken down under the probe, away from it, or gone through the surface."""

import warnings
from typing import TYPE_CHECKING

import numpy as np

from tissuejax.arrays import Given
from tissuejax.errors import CoarseMesh, UnstableSimulation
from tissuejax.tled import contact
from tissuejax.tled.scene import Probe, Scene
from tissuejax.tled.stable import critical_steps

if TYPE_CHECKING:
    from tissuejax.tled.simulate import Outcome

NEAR = 1.0  # radii around the probe's patch, and around where its tip has been: a breakdown there is the probe's
STOPS = 65  # places of the tip's way that are looked at


def halved(scene: Scene) -> Scene:
    """The same scene with half the step; the static mass of contact goes with its square."""
    changes: dict[str, Given] = {"clock.steps": 2 * scene.clock.steps}
    if scene.probe is not None:
        changes["probe.mass"] = scene.probe.mass / 4
    if scene.faces is not None:
        changes["faces.mass"] = scene.faces.mass / 4
    return scene.put(changes)


def shorter_helps(out: "Outcome", scene: Scene) -> bool:
    """Whether a shorter step may cure the breakdown: not where gravity crushes a support."""
    return _under_probe(out, scene) or scene.gravity is None or _too_long(scene)


def _too_long(scene: Scene) -> bool:
    """Whether the step is above the critical one at rest: a parameter has grown since it was chosen."""
    return float(scene.clock.step) > float(np.min(critical_steps(scene)))


def check(out: "Outcome", scene: Scene) -> None:
    """Raise `UnstableSimulation` if the run failed or the probe went through the surface; warn (`CoarseMesh`) where
    elements are folded under it (host side)."""
    if int(out.failed) >= 0:
        raise UnstableSimulation(_broken(out, scene))
    if scene.faces is not None:  # a blade: how far it sinks in is in the energy balance
        return
    frame = int(out.pierced(scene))
    if frame >= 0:
        raise UnstableSimulation(_pierced(out, scene, frame))
    folded = np.flatnonzero(np.asarray(out.checks.lost) >= 1)
    if scene.probe is not None and len(folded):
        warnings.warn(_folded(out, scene, int(folded[0])), CoarseMesh, stacklevel=3)


def _place(point) -> str:
    return f"({', '.join(f'{x:.1f}' for x in 1e3 * np.asarray(point))}) mm"


def _broken(out, scene) -> str:
    frame, element = int(out.failed), int(out.element)
    place = _place(np.asarray(scene.body.points)[np.asarray(scene.body.cells)[element]].mean(0))
    said = (
        f"the simulation broke down by t = {float(out.end_time[frame]):.4g} s (frame {frame}): element {element} near "
        f"{place} is inverted or no longer finite; the step was {float(scene.clock.step) * 1e3:.3g} ms. "
    )
    if scene.faces is not None:
        return said + (
            "Where a blade enters soft tissue the first elements fold: take tissue that resists compression (K ten "
            "times the shear modulus or more), other elements there, a strength that the mesh can carry and that parts "
            "within the blade's thickness (`tissuejax cut resolve`), or begin in a short notch"
        )
    if _too_long(scene):
        critical = np.asarray(critical_steps(scene))
        return said + (
            f"The step is above the critical one, {1e3 * critical.min():.3g} ms in element {int(critical.argmin())}. "
            "Take a smaller step (stiffer parameters need one)"
        )
    if _under_probe(out, scene):
        return said + (
            "Take a smaller step (stiffer parameters need one), less time compression, less stiffness damping, or a "
            "finer mesh under the probe"
        )
    if scene.gravity is None:
        return said + (
            "The element is not under a probe: take a smaller step (stiffer parameters need one), less time "
            "compression or less stiffness damping, and look at the support's motion"
        )
    return said + "The element is not under a probe: gravity or the support breaks it. " + weight(scene)


def weight(scene: Scene) -> str:
    """What gravity asks of the tissue, and what to do about it."""
    points, fixed = np.asarray(scene.body.points), np.asarray(scene.body.fixed)
    g = float(np.linalg.norm(np.asarray(scene.gravity)))
    shear = float(scene.tissue.energy.initial_shear_modulus(scene.tissue.energy_values))
    load = float(scene.tissue.density) * g * float(np.ptp(points[:, 2]))
    return (
        f"The weight of the tissue's height ({load:.0f} Pa) is {load / shear:.2g} times its shear modulus ({shear:.4g} "
        f"Pa) and {len(fixed)} of {len(points)} nodes are held; check density, moduli and gravity, lay the body on a "
        "larger support, or find its stress-free shape first (`gravity.stress_free`)"
    )


def _pierced(out, scene, frame) -> str:
    when, deep, reach = float(out.end_time[frame]), float(out.penetration[frame]), float(contact.breadth(scene))
    (centre,) = _way(scene.probe, [when])
    worst, penalty = float(np.max(out.penetration)), float(scene.probe.penalty)
    needed = penalty * worst / (0.01 * reach)
    return (
        f"the surface is {1e3 * deep:.3g} mm inside the probe at t = {when:.4g} s (frame {frame}), the probe at "
        f"{_place(centre)}: more than {contact.PIERCED:.0%} of its radius {1e3 * reach:.3g} mm, so the force is "
        f"too low. Give a larger penalty ({needed:.2g} Pa/m would hold it to 1 to 3 %; it was {penalty:.2g}), a "
        "finer mesh under the probe, or press less deep"
    )


def _folded(out, scene, block: int) -> str:
    element = int(out.checks.folded[block])
    place = _place(np.asarray(scene.body.points)[np.asarray(scene.body.cells)[element]].mean(0))
    return (
        f"element {element} near {place} is folded by t = {float(out.check_time[block]):.4g} s: edges at one of its "
        "corners have changed sides, which the stress in its middle does not feel, so the tissue gives way without "
        f"force and what the probe feels is too little ({float(out.hourglass):.0%} of the strain energy is that of the "
        "hourglass control). Take a finer mesh under the probe, more hourglass stiffness (it was "
        f"{float(scene.settings.hourglass):.2g} of the shear modulus at rest; tissue that stiffens needs its modulus "
        "under the probe), or press less deep"
    )


def _way(probe: Probe, times) -> np.ndarray:
    """The probe's centre at these times, (n, 3), m."""
    time, place = np.asarray(probe.time), np.asarray(probe.position)
    offset = 0.0 if probe.offset is None else np.asarray(probe.offset)
    return np.stack([np.interp(times, time, x) for x in place.T], axis=1) + offset


def _under_probe(out, scene: Scene) -> bool:
    """Whether the element that broke down lies at the patch, or where the tip came near on its way down."""
    if scene.probe is None:
        return False
    points, cell = np.asarray(scene.body.points), np.asarray(scene.body.cells)[int(out.element)]
    facets, reach = points[np.asarray(scene.probe.patch)].mean(1), float(contact.breadth(scene))
    here = points[cell].mean(0)
    if np.linalg.norm(facets - here, axis=1).min() <= NEAR * reach:
        return True
    settled = 0.0 if scene.body.settled is None else np.asarray(scene.body.settled)[cell].mean(0)
    way = _way(scene.probe, np.linspace(0.0, float(out.end_time[int(out.failed)]), STOPS))
    return bool(np.linalg.norm(way - here - settled, axis=1).min() <= (1 + NEAR) * reach)
