"""Candidates of probings: every effect in the forms that it says itself (`effects.form`).

Gravity is no candidate: its size is known (9.81 m/s^2), so it is stated (`--with gravity`) and not looked for.
"""

import numpy as np
from jaxtyping import Float

from tissuejax.diagnosis.catalogue import Entry
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Probed


def probing_entries(sizes: Probed) -> list[Entry]:
    """All effects that act in probings, in their forms."""
    return [Entry.of(kind.in_probings(sizes)) for kind in effects("probing").values() if kind.candidate]


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
