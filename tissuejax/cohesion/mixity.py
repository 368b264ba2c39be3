"""Opening and sliding together: which strength and energy a face has between the two.

Start of damage where (t_n / tau)^2 + (t_s / tau_s)^2 = 1 (quadratic), energy by Benzeggagh & Kenane 1996:
G = G_I + (G_II - G_I) B^eta, B the share of sliding. With one stiffness for both directions that share is
d_s^2 / (d_n^2 + d_s^2) along a straight path of opening (Turon et al. 2006, Mech. Mater. 38).
"""

from typing import NamedTuple

from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.parameters import Constants, Parameter

PARAMETERS = (
    Parameter("shear_strength", "1", 1.0, 1e-3, 1e3, "strength in sliding over that in opening", frozen=True),
    Parameter("shear_energy", "1", 1.0, 1e-3, 1e3, "energy in sliding over that in opening", frozen=True),
    Parameter("exponent", "1", 1.5, 0.1, 10.0, "eta of Benzeggagh and Kenane", frozen=True),
)


class Mixed(NamedTuple):
    """Strength, Pa, and energy, J/m^2, at a share of sliding."""

    strength: Float[Either, "..."]
    energy: Float[Either, "..."]


def mixed(p: Constants, sliding: Float[Either, "..."]) -> Mixed:
    """Strength and energy with `sliding` = B in [0, 1]; ratios left out are 1 (no difference)."""
    strength, energy = p["strength"], p["energy"]
    if "shear_strength" in p:
        strength = strength / (1 - sliding + sliding / p["shear_strength"] ** 2) ** 0.5
    if "shear_energy" in p:
        some = sliding > 0  # the power's derivative at 0 is infinite for eta < 1
        share = (sliding * some + (1 - some)) ** p.get("exponent", 1.5) * some
        energy = energy * (1 + (p["shear_energy"] - 1) * share)
    return Mixed(strength, energy)
