"""What can't be tabulated: anything that makes the force depend on more than the ball's place and stress that relaxes.

An effect says what it does by the slots of the scene that it fills, so a new effect is judged by what it does.
"""

from tissuejax.errors import InputError
from tissuejax.model import Model
from tissuejax.surrogate.ramp import Matter
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.surrogate.tabulate import full_scene

WAY = "play it with `tissuejax play --direct`, which simulates in the loop"


def untabulated(scene) -> dict[str, str]:
    """Filled slots of a scene that no table can hold, and why."""
    tissue, support = scene.tissue, scene.support
    found = {}
    if tissue.damage is not None and float(abs(tissue.damage.amount)) + _size(tissue.damage.recoverable) > 0:
        found["tissue.damage"] = "the tissue stays softer where it was pressed"
    if tissue.drain is not None and _size(tissue.drain.g) > 0:
        found["tissue.drain"] = "fluid that leaves is not in the memory of isochoric stress"
    if support.displacement is not None and _size(support.displacement) > 0:
        found["support.displacement"] = "the support moves by itself"
    if _size(support.compliance) + _size(support.fluidity) > 0:
        found["support.compliance"] = "the base slides"
    if tissue.prony is not None and _size(tissue.prony.g) > 0 and scene.gravity is not None:
        found["tissue.prony"] = "weight that the tissue carries has relaxed before the ball comes"
    return found


def _size(x) -> float:
    return 0.0 if x is None else float(abs(x).max())


def refuse(matter: Matter, grid: Grid, place) -> None:
    """Nothing, if the model can be tabulated.

    Raises:
        InputError: an effect that can't, by its name, with the way that works.
    """
    for slot, why in untabulated(full_scene(matter, grid, place)).items():
        name = _culprit(matter, grid, place, slot)
        raise InputError(f"effect {name} can't be tabulated: {why}; {WAY}")


def _culprit(matter: Matter, grid: Grid, place, slot: str) -> str:
    for effect in matter.model.ordered:
        rest = tuple(e for e in matter.model.effects if e.name != effect.name)
        model = Model(matter.model.energy, matter.model.volumetric, rest, matter.model.recordings)
        values = {k: v for k, v in matter.values.items() if k in model.declared}
        if slot not in untabulated(full_scene(matter._replace(model=model, values=values), grid, place)):
            return effect.name
    return slot
