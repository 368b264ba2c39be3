"""Candidates of probings: every effect in the forms that it says itself (`effects.form`).

Gravity is no candidate: its size is known (9.81 m/s^2), so it is stated (`--with gravity`) and not looked for.
"""

from tissuejax.diagnosis.catalogue import Entry
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Probed


def probing_entries(sizes: Probed) -> list[Entry]:
    """All effects that act in probings, in their forms."""
    return [Entry.of(kind.in_probings(sizes)) for kind in effects("probing").values() if kind.candidate]
