"""Candidates of probings: the effects in their forms, with priors on what a careful experimenter misjudges at most.

Gravity is not among them. Its size is known (9.81 m/s^2): it is nothing to be found but something to be told, a model
with the effect `gravity` fixed at that value. As a candidate it would cost a stress-free shape for every run.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.catalogue import Entry, Form
from tissuejax.effects.adhesion import Adhesion
from tissuejax.effects.aging import Aging
from tissuejax.effects.anisotropy import Anisotropy
from tissuejax.effects.base_slip import BaseSlip
from tissuejax.effects.capsule import Capsule
from tissuejax.effects.catalogue import effects
from tissuejax.effects.clock_lag import ClockLag
from tissuejax.effects.compressibility import Compressibility
from tissuejax.effects.contact_offset import ContactOffset
from tissuejax.effects.drift import Drift
from tissuejax.effects.effect import Effect
from tissuejax.effects.energy_form import EnergyForm
from tissuejax.effects.friction import Friction
from tissuejax.effects.inclusion import Inclusion
from tissuejax.effects.machine_compliance import MachineCompliance
from tissuejax.effects.periodic import Periodic
from tissuejax.effects.registration import Registration
from tissuejax.effects.softening import Softening
from tissuejax.effects.viscoelasticity import Viscoelasticity

# standard deviations of what may be misjudged: without them a probe moved by 2.5 mm explains an inclusion
PRIORS = {
    "registration.dx": 7e-4,
    "registration.dy": 7e-4,
    "registration.radius": 3e-4,
    "registration.thickness": 0.05,
    "registration.turn": 0.1,
    "contact-offset.depth": 7e-4,
    "contact-offset.delay": 0.1,
}
GIVING = {"coefficient": (0.45,), "give": (2e-8,)}  # m/Pa: 500 Pa move by 10 micrometres


def probing_entries(energy: float) -> list[Entry]:
    """All effects that act in probings, in their forms.

    Args:
        energy: typical strain energy under the probe, Pa.
    """
    wave = ("sin", "cos", "sin2", "cos2")
    axes = [f"{a}_{c}" for a in ("offset", "rate") for c in "xyz"]
    found: list[tuple[Effect, tuple[Form, ...]]] = [
        (
            Viscoelasticity(terms=2),
            (
                Form("one time", ("g1", "tau1"), {"tau1": (0.4, 4.0)}, nominated=False),
                Form("two times", ("g1", "g2", "tau1", "tau2"), {"tau1": (0.5,), "tau2": (6.0,)}),
            ),
        ),
        (Softening(), (Form("", ("r", "m"), {"m": (0.05 * energy, 0.4 * energy)}),)),
        (
            Anisotropy(),
            (Form("", ("k1", "angle"), {"angle": tuple(np.arange(4) * np.pi / 4)}),),
        ),
        (EnergyForm(terms=("C30", "C01")), (Form("", ("C30", "C01"), {}),)),
        (Compressibility(), (Form("draining", ("drained", "time"), {"time": (4.0,)}),)),
        (Aging(), (Form("", ("rate",), {}),)),
        (
            Drift(kind="probing", separate=True),
            (
                Form("", tuple(axes), {}),
                Form("each recording", tuple(axes), {}, each=tuple(axes)),
            ),
        ),
        (
            Periodic(kind="probing", separate=True),
            (Form("", (*wave, "lean_x", "lean_y", "frequency"), {}, each=wave),),
        ),
        (MachineCompliance(), (Form("", ("compliance",), {}),)),
        (
            ContactOffset(separate=True),
            (
                Form("delay", ("delay",), {}),
                Form("depth", ("depth",), {}),
                Form("each recording", ("depth",), {}, each=("depth",)),
            ),
        ),
        (
            Friction(),
            (
                Form("", ("coefficient",), {}),
                # where the surface sticks, a rigid stick of weak friction passes for a giving one of strong friction
                Form("giving", ("coefficient", "give"), GIVING, nominated=False),
            ),
        ),
        (Adhesion(), (Form("", ("strength", "reach"), {"reach": (1e-4, 3e-4, 8e-4)}),)),
        (Capsule(), (Form("", ("stiffness",), {}),)),
        (BaseSlip(), (Form("", ("compliance", "fluidity"), {}),)),
        (ClockLag(), (Form("", ("lag",), {}),)),
        (
            Registration(),
            (
                Form("place", ("dx", "dy"), {}),
                Form("turn", ("turn",), {}),
                Form("radius", ("radius",), {}),
                Form("thickness", ("thickness",), {}),
            ),
        ),
        (
            Inclusion(),
            (
                Form("round", ("contrast", "x", "y", "z", "radius"), {"radius": (6e-3,)}),
                Form("flat", ("contrast", "x", "y", "z", "radius", "flatness"), {}, nominated=False),
            ),
        ),
    ]
    known = effects("probing")
    return [Entry(effect, forms, effect.name) for effect, forms in found if effect.name in known]


def places(
    sites: dict[str, Float[np.ndarray, "2"]], height: dict[str, float], depths: tuple[float, ...] = (0.25, 0.45, 0.7)
) -> list[dict[str, float]]:
    """Where an inclusion is looked for: under every site, at some shares of the thickness."""
    out = []
    for name, (x, y) in sites.items():
        for share in depths:
            z = height[name] * (1 - share)
            radius = float(np.clip(0.25 * height[name], 3e-3, 1e-2))
            out.append(
                {
                    "effects.inclusion.x": float(x),
                    "effects.inclusion.y": float(y),
                    "effects.inclusion.z": float(z),
                    "effects.inclusion.radius": radius,
                }
            )
    return out
