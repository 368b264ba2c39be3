"""From the states of the sites to the tables of a surrogate."""

from collections.abc import Mapping

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Float

from tissuejax.surrogate import drag
from tissuejax.surrogate import memory as stress_memory
from tissuejax.surrogate.cardinal import energy_from_force, from_depths, table, through
from tissuejax.surrogate.modes import modes
from tissuejax.surrogate.places import Box, first_contact
from tissuejax.surrogate.ramp import Matter, Ramp, scene_at
from tissuejax.surrogate.site_mesh import Grid, lines, nodes
from tissuejax.surrogate.surrogate import Memory, Rig, Surface, Surrogate
from tissuejax.tled.scene import Tissue

SHAPES, SHAPE_ERROR = 40, 2e-3  # modes of displacement at most, and share of the displacements left out
SETTLED = 1e-5  # share left out of the nodes' places
FINE = 3e-3  # m, spacing of the tables of the moving mesh


def surrogate(matter: Matter, box: Box, grid: Grid, ramps: list[Ramp], prony: tuple | None) -> Surrogate:
    """The tables through the states of all sites, in the order of `box.sites()`.

    Args:
        prony: shares and times of the material's relaxation, or None.
    """
    plan, floor = [through(n) for n in box.counts], from_depths(box.depths)
    spacing = np.append(box.spacing, 1 / box.depths)
    origin = np.append(box.low, 0.0)
    shape = (*box.counts, box.depths)

    def over(values, depth_matrix=floor):
        return table(origin, spacing, values.reshape(*shape, -1), [*plan, depth_matrix])

    levels = box.levels
    force = np.array([r.force[:, 2] for r in ramps])
    law = over(force / levels**1.5, energy_from_force(box.depths))
    moved = np.concatenate([r.displacement.reshape(len(levels), -1) for r in ramps])
    found = modes(moved, SHAPE_ERROR, SHAPES)
    deep = np.tile(levels, len(ramps))[:, None]
    memory = None
    if prony is not None:
        material = stress_memory.material(matter.lobe, box, grid)
        dense = stress_memory.between_sites(box, ramps)
        counts = dense.counts
        kept = stress_memory.projected(material, matter.lobe, grid, dense)
        close = box._replace(counts=counts)
        fine = [*(through(n) for n in counts), floor]
        below = np.tile(levels, len(dense.places))[:, None]

        def everywhere(values):
            gaps = np.append(close.spacing, 1 / box.depths)
            return table(origin, gaps, (values / below).reshape(*counts, box.depths, -1), fine)

        memory = Memory(everywhere(kept.stress), everywhere(kept.strain), *(np.asarray(v, float) for v in prony))
    settled, settled_shapes, where = _moving_mesh(matter, box, grid)
    surface = Surface(
        grid.counts, over(moved @ found.shapes.T / deep), found.shapes.reshape(len(found.shapes), -1, 3),
        settled, settled_shapes, where,
    )  # fmt: skip
    rub, rig, radius = contact_extras(matter, grid, (box.low + box.high) / 2)
    fitted = slip_fitted(levels / box.depth, np.array([r.slip for r in ramps]))
    rub = eqx.tree_at(lambda r: r.slip, rub, fitted)
    touch = first_contact(matter.lobe, box, radius)
    return Surrogate(
        box.low, box.high, np.asarray(box.depth), np.asarray(radius), touch, law, surface, memory, rub, rig,
        np.asarray(1.0),
    )  # fmt: skip


def _moving_mesh(matter: Matter, box: Box, grid: Grid):
    """Node places in modes over (x, y), the modes, and the grid lines over (x, y)."""
    counts = [max(2, int(np.ceil(w / FINE - 1e-9)) + 1) for w in box.high - box.low]
    axes = [np.linspace(a, b, n) for a, b, n in zip(box.low, box.high, counts)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
    found = [lines(matter.lobe, p, grid) for p in places]
    at = np.array([nodes(matter.lobe, s, t, grid.counts[2]).ravel() for s, t in found])
    mean = at.mean(0)
    kept = modes(at - mean, SETTLED, 24)
    coefficients = np.concatenate([np.ones((len(at), 1)), (at - mean) @ kept.shapes.T], 1)
    spacing = [a[1] - a[0] for a in axes]
    matrices = [through(n) for n in counts]
    shapes = np.concatenate([mean[None], kept.shapes]).reshape(len(kept.shapes) + 1, -1, 3)
    both = np.array([np.concatenate(f) for f in found])
    return (
        table(box.low, spacing, coefficients.reshape(*counts, -1), matrices),
        shapes,
        table(box.low, spacing, both.reshape(*counts, -1), matrices),
    )


def slip_fitted(q: Float[np.ndarray, " k"], slips: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "3"]:
    """c_1 to c_3 of `drag.slipping` by least squares over all sites; none where the vertical force is not positive."""
    columns = np.tile(np.stack([q, q**2, q**3], 1), (len(slips), 1))
    good = np.isfinite(slips.ravel()) & (slips.ravel() > 0)
    return np.linalg.lstsq(columns[good], slips.ravel()[good] - 1, rcond=None)[0]


def contact_extras(matter: Matter, grid: Grid, place: Float[np.ndarray, "2"]) -> tuple[drag.Rub, Rig, float]:
    """Friction, adhesion, the rig's part, and the ball's true radius, from the model's own scene."""
    scene = full_scene(matter, grid, place)
    probe, modulus = scene.probe, reduced_modulus(scene.tissue)
    number = lambda x: np.asarray(0.0 if x is None else float(x))  # noqa: E731
    rub = drag.Rub(
        number(probe.friction), number(probe.give), number(probe.adhesion), number(probe.reach), np.zeros(3),
        np.asarray(modulus),
    )  # fmt: skip
    offset = np.zeros(3) if probe.offset is None else np.asarray(probe.offset, float)
    rig = Rig(offset, np.asarray(float(probe.time[0])), number(probe.compliance))
    return rub, rig, float(probe.shape.radius)


def reduced_modulus(tissue: Tissue) -> float:
    """E / (1 - nu^2) of the tissue at rest before it relaxes, Pa: 4 mu (3 K + mu) / (3 K + 4 mu)."""
    mu = float(tissue.energy.initial_shear_modulus(tissue.energy_values))
    bulk = jax.grad(jax.grad(lambda J: tissue.volumetric.energy(tissue.volumetric_values, J)))(1.0)
    return 4 * mu * (3 * float(bulk) + mu) / (3 * float(bulk) + 4 * mu)


def full_scene(matter: Matter, grid: Grid, place):
    """The scene of a place with everything the model has, tabulated or not."""
    return scene_at(matter, grid, place, float(matter.lobe.top(0.5, 0.5)[0, 0]) + 5 * matter.radius, whole=True)


def summary(surrogate: Surrogate) -> Mapping[str, int]:
    """Numbers of modes, for the record."""
    memory = surrogate.memory
    return {
        "shape_modes": len(surrogate.surface.modes),
        "stress_modes": 0 if memory is None else int(memory.stress.coefficients.shape[-1]),
        "settled_modes": len(surrogate.surface.settled) - 1,
    }
