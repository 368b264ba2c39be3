"""What a cut's parameters mean for a mesh: cohesive length, separation, the strength that a mesh can carry, step, cost.

Cohesive length l = E' G / tau^2 (Hillerborg 1976), E' = E / (1 - nu^2) at rest; a mesh of size h carries
tau_h = sqrt(9 pi E' G / (32 n h)) over n elements (Turon et al. 2007, Eng. Fract. Mech. 74): where it is too coarse the
strength is lowered and the energy kept. The source lowered both (3.2.1, 3.2.2); then nothing that is published means
the tissue any more.
"""

import math
from dataclasses import asdict, dataclass

from tissuejax.errors import InputError

SPAN = 3  # elements that the cohesive length should span
NANOSECONDS = 80.0  # an element and step with faces and a blade, one core, float64, in C (fits/cutting; by XLA 142)
LEAST_SHARE = 0.01  # J/m^2: no tissue has so little
TOUGH = (1.0, 2000.0)  # J/m^2: soft tissue that was ever cut lies between


@dataclass(frozen=True)
class Resolution:
    """Numbers and sentences; lengths m, stresses Pa, seconds."""

    cohesive_length: float
    separation: float
    carried: float
    step: float
    steps: int
    elements: int
    seconds: float
    sentences: tuple[str, ...]

    def as_dict(self) -> dict:
        """Plain data."""
        return asdict(self)


def resolution(
    strength: float, energy: float, mu: float, bulk: float, thickness: float, h: float, length: float, half: float,
    density: float = 1000.0, speed: float = 0.05,
) -> Resolution:  # fmt: skip
    """Work it out.

    Raises:
        InputError: values that are not positive, an energy that is in J and not J/m^2.
    """
    given = {"strength": strength, "energy": energy, "mu": mu, "K": bulk, "blade thickness": thickness, "h": h}
    for name, value in given.items():
        if not value > 0 or not math.isfinite(value):
            raise InputError(f"{name} {value}: it must be positive")
    refuse_joules(energy)
    plane = plane_modulus(mu, bulk)
    cohesive, apart = plane * energy / strength**2, 2 * energy / strength
    carried = math.sqrt(9 * math.pi * plane * energy / (32 * SPAN * h))
    wave = math.sqrt((bulk + 4 / 3 * mu) / density)
    step = 0.7 * h / wave
    steps = math.ceil(length / speed / step)
    elements = math.ceil(length / h) * 2 * math.ceil(half / h)
    seconds = steps * elements * NANOSECONDS * 1e-9
    said = []
    if cohesive < SPAN * h:
        said.append(
            f"faces are not resolved: the cohesive length {1e3 * cohesive:.3g} mm spans {cohesive / h:.2g} elements of "
            f"{1e3 * h:.3g} mm, {SPAN} are needed. Lower the strength to {carried:.4g} Pa and keep the energy (mean "
            "force "
            f"and toughness stay, the entry peak does not), or take elements of {1e3 * cohesive / SPAN:.3g} mm."
        )
    if apart > thickness:
        said.append(
            f"the blade is thinner ({1e3 * thickness:.3g} mm) than the separation ({1e3 * apart:.3g} mm): its flats "
            "do not "
            f"part the tissue, which holds on beside them; the force will be too low. A strength above "
            f"{2 * energy / thickness:.4g} Pa parts it."
        )
    if carried < strength and carried < 2 * energy / thickness:
        said.append(
            f"no strength suits both this mesh (at most {carried:.4g} Pa) and this blade (at least "
            f"{2 * energy / thickness:.4g} Pa): elements of "
            f"{1e3 * thickness**2 * 9 * math.pi * plane / (128 * SPAN * energy):.3g} "
            "mm are needed."
        )
    said.append(
        "not identified: the strength, by any record that starts in the cut or by the mean force (which holds none); "
        "energy and wedging apart, by one pass without a return stroke or a second pass; friction, by a cut shorter "
        "than "
        "some ten blade thicknesses in one direction."
    )
    if cohesive < h:
        said.append("not identified on this mesh: the strength at all; what the fit calls so is numerical.")
    return Resolution(cohesive, apart, carried, step, steps, elements, seconds, tuple(said))


def plane_modulus(mu: float, bulk: float) -> float:
    """E' = E / (1 - nu^2) at rest, Pa, from shear and bulk modulus."""
    return 4 * mu * (bulk + mu / 3) / (bulk + 4 * mu / 3)


def refuse_joules(energy: float) -> None:
    """Raise on an energy per area that can only be an energy."""
    if energy < LEAST_SHARE:
        raise InputError(
            f"energy {energy:.3g} J/m^2: tissue has {TOUGH[0]:g} to {TOUGH[1]:g} J/m^2. Is it an energy in J (the "
            "integral of a force over a path)? Divide by the area cut, path times depth: 0.125 mJ over 1 mm by 5 mm "
            "are 25 J/m^2"
        )
