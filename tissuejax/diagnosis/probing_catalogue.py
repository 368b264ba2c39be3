"""Candidates of probings: the effects in their forms, with priors on what a careful experimenter misjudges at most.

An effect that is not named here has one form, with all its parameters and the shapes of its grid. Gravity is no
candidate: its size is known (9.81 m/s^2), so it is stated (`--with gravity`) and not looked for.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.catalogue import Entry, Form
from tissuejax.effects.adhesion import Adhesion
from tissuejax.effects.aging import Aging
from tissuejax.effects.anisotropy import Anisotropy
from tissuejax.effects.catalogue import effects
from tissuejax.effects.compressibility import Compressibility
from tissuejax.effects.contact_offset import ContactOffset
from tissuejax.effects.effect import Effect
from tissuejax.effects.energy_form import EnergyForm
from tissuejax.effects.force_drift import ForceDrift
from tissuejax.effects.friction import Friction
from tissuejax.effects.inclusion import Inclusion
from tissuejax.effects.machine_compliance import MachineCompliance
from tissuejax.effects.registration import Registration
from tissuejax.effects.softening import Softening
from tissuejax.effects.support_motion import SupportMotion
from tissuejax.effects.viscoelasticity import Viscoelasticity

GIVING = {"coefficient": (0.45,), "give": (2e-8,)}  # m/Pa: 500 Pa move by 10 micrometres


def probing_entries(energy: float) -> list[Entry]:
    """All effects that act in probings, in their forms.

    Args:
        energy: typical strain energy under the probe, Pa.
    """
    wave = ("sin", "cos", "sin2", "cos2")
    axes = ForceDrift().amplitudes
    special: dict[str, tuple[Effect, tuple[Form, ...]]] = {
        "viscoelasticity": (
            Viscoelasticity(terms=2),
            (
                Form("one time", ("g1", "tau1"), {"tau1": (0.4, 4.0)}, nominated=False),
                Form("two times", ("g1", "g2", "tau1", "tau2"), {"tau1": (0.5,), "tau2": (6.0,)}),
            ),
        ),
        "softening": (Softening(), (Form("", ("r", "m"), {"m": (0.05 * energy, 0.4 * energy)}),)),
        "anisotropy": (Anisotropy(), (Form("", ("k1", "angle"), {"angle": tuple(np.arange(4) * np.pi / 4)}),)),
        "energy-form": (EnergyForm(terms=("C30", "C01")), (Form("", ("C30", "C01"), {}),)),
        "compressibility": (Compressibility(), (Form("draining", ("drained", "time"), {"time": (4.0,)}),)),
        "aging": (Aging(), (Form("", ("rate",), {}),)),
        "force-drift": (
            ForceDrift(separate=True),
            (Form("", axes, {}), Form("each recording", axes, {}, each=axes)),
        ),
        "support-motion": (
            SupportMotion(),
            (Form("", (*wave, "lean_x", "lean_y", "frequency"), {}, each=wave),),
        ),
        "machine-compliance": (MachineCompliance(), (Form("", ("compliance",), {}),)),
        "contact-offset": (
            ContactOffset(separate=True),
            (
                Form("delay", ("delay",), {}),
                Form("depth", ("depth",), {}),
                Form("each recording", ("depth",), {}, each=("depth",)),
            ),
        ),
        "friction": (
            Friction(),
            (
                Form("", ("coefficient",), {}),
                # where the surface sticks, a rigid stick of weak friction passes for a giving one of strong friction
                Form("giving", ("coefficient", "give"), GIVING, nominated=False),
            ),
        ),
        "adhesion": (Adhesion(), (Form("", ("strength", "reach"), {"reach": (1e-4, 3e-4, 8e-4)}),)),
        "registration": (
            Registration(),
            (
                Form("place", ("dx", "dy"), {}),
                Form("turn", ("turn",), {}),
                Form("radius", ("radius",), {}),
                Form("thickness", ("thickness",), {}),
            ),
        ),
        "inclusion": (
            Inclusion(),
            (
                Form("round", ("contrast", "x", "y", "z", "radius"), {"radius": (6e-3,)}),
                Form("flat", ("contrast", "x", "y", "z", "radius", "flatness"), {}, nominated=False),
            ),
        ),
    }
    out = []
    for name, kind in effects("probing").items():
        if name in special:
            effect, forms = special[name]
        else:
            effect = kind()
            free = tuple(p.name for p in effect.parameters if not p.frozen)
            each = tuple(p.name for p in effect.parameters if p.each)
            forms = (Form("", free, dict(effect.grid), each=each),)
        if kind.candidate:
            out.append(Entry(effect, forms, name))
    return out


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
