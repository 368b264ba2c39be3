"""How a simulation of a probing went, in numbers and in sentences: for a fit, a prediction, a diagnosis."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tissuejax.recordings.recording import Recording

if TYPE_CHECKING:
    from tissuejax.experiments.probing import Simulated

NUMERICS = "numerics/"  # attributes of a simulated recording that say how its run went
COARSE = 0.05  # share from which a numerical check of a simulation is a warning
CHECKS = {  # of a simulation: what the share is of, and what to do
    "hourglass": ("of the strain energy is that of the hourglass control", "take a finer mesh"),
    "penetration": ("of the probe's radius is sunk into the surface", "raise `penalty`"),
    "inertia": ("of the strain energy is kinetic", "lower `compression`"),
}


def checks(run: "Simulated", reach: float) -> dict[str, float]:
    """The worst of each numerical check: shares (energy of the hourglass control over internal energy, penetration over
    the probe's radius `reach`, m, kinetic over internal energy), and the least volume ratio at an element's corner."""
    return {
        "hourglass": float(run.hourglass),
        "penetration": max(0.0, float(run.depth)) / reach,
        "inertia": float(run.inertia),
        "corner": float(run.corner),
    }


def numerics(predictions: Mapping[str, Recording]) -> dict[str, dict[str, float]]:
    """`checks` of the simulated ones among predictions, which carry them as attributes."""
    kept = {
        name: {k[len(NUMERICS) :]: float(v) for k, v in r.attributes.items() if k.startswith(NUMERICS)}
        for name, r in predictions.items()
    }
    return {name: own for name, own in kept.items() if own}


def sentences(found: Mapping[str, Mapping[str, float]]) -> list[str]:
    """What is wrong with the simulations, the worst recording of each check.

    Args:
        found: `checks` by recording.
    """
    said = []
    for check, (what, remedy) in CHECKS.items():
        shares = {name: own[check] for name, own in found.items() if check in own}
        worst = max(shares, key=lambda name: shares[name], default=None)
        if worst is not None and shares[worst] > COARSE:
            said.append(f"In the simulation of {worst} {shares[worst]:.0%} {what}: {remedy}.")
    folded = [name for name, own in found.items() if own.get("corner", 1.0) <= 0]
    if folded:
        said.append(
            f"In the simulation of {', '.join(folded)} elements are folded: edges at a corner have changed sides, and "
            "the tissue gives way there without force. Take a finer mesh or more `hourglass` stiffness, or press less "
            "deep."
        )
    return said
