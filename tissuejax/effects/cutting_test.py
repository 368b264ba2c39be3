"""A cut as effects see it: what the blade meets at each station along its path."""

import dataclasses

import equinox as eqx
from jaxtyping import Array, Float


class Cut(eqx.Module):
    """What is met where. Stations are places on the path (element faces in a simulation, samples in a force balance).

    Attributes:
        at: distance of each station from where the blade enters, m.
        share: the same over the length of the cut, 0 to 1.
        pace: speed of the blade there, m/s. elapsed: time since it entered, s.
        energy: toughness, J/m^2. strength: Pa. depth: in which the blade cuts there, m.
        friction: Coulomb coefficient between blade and tissue.
        onset: length over which the force sets in at the entry, m; only in a force balance, a simulation has its own.
        squeezing: factor on what the layers beside the blade take; only in a force balance.
        compliance: of the rig that holds the blade, m/N; None for a stiff one.
        relaxing: shares of the isochoric stress that relax, and their times (s); None for elastic tissue.
    """

    at: Float[Array, " P"]
    share: Float[Array, " P"]
    pace: Float[Array, " P"]
    elapsed: Float[Array, " P"]
    energy: Float[Array, " P"]
    strength: Float[Array, " P"]
    depth: Float[Array, " P"]
    friction: Float[Array, ""]
    onset: Float[Array, ""]
    squeezing: Float[Array, " P"] | float = 1.0
    compliance: Float[Array, ""] | None = None
    relaxing: tuple[Float[Array, " m"], Float[Array, " m"]] | None = None

    def with_(self, **changes) -> "Cut":
        """A copy with fields replaced."""
        return dataclasses.replace(self, **changes)
