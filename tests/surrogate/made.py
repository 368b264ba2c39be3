"""Surrogates for tests: one from formulas, whose every force is known, and one small one from statics."""

from functools import cache

import jax.numpy as jnp
import numpy as np

from tissuejax.energies import catalogue
from tissuejax.mesh.columns import box, lobe_of_mesh
from tissuejax.model import Model
from tissuejax.surrogate import drag
from tissuejax.surrogate.cardinal import energy_from_force, from_depths, table, through
from tissuejax.surrogate.places import Box
from tissuejax.surrogate.precompute import precompute
from tissuejax.surrogate.ramp import Matter
from tissuejax.surrogate.site_mesh import Grid
from tissuejax.surrogate.surrogate import Memory, Rig, Surface, Surrogate

RADIUS, DEPTH, TOP = 5e-3, 6e-3, 0.03
BOX = Box(np.array([-0.01, -0.008]), np.array([0.01, 0.008]), DEPTH, (6, 5), 8)
SLIP = (0.2, 0.1, 0.15)
STIFF, LEAN = 300.0, 20.0  # N / m^1.5 and per metre


def height(x, y):
    """Of the ball's centre at first contact: a gently curved top."""
    return TOP + RADIUS - 0.5 * (x**2 + 2 * y**2) + 0.05 * x


def vertical(x, y, d):
    """Force over place and depth, N; its energy over depth is known in closed form."""
    return STIFF * (1 + LEAN * x + LEAN**2 * y**2) * (d**1.5 + 40 * d**2.5)


def work(x, y, d):
    """Integral of `vertical` over depth, J."""
    return STIFF * (1 + LEAN * x + LEAN**2 * y**2) * (d**2.5 / 2.5 + 40 * d**3.5 / 3.5)


def field(f, matrices, spacing, origin):
    """A table through a function of x, y, d or of x, y."""
    axes = [np.linspace(a, b, n) for a, b, n in zip(BOX.low, BOX.high, BOX.counts)]
    if len(matrices) == 3:
        axes.append(BOX.levels)
    grids = np.meshgrid(*axes, indexing="ij")
    values = np.stack(np.broadcast_arrays(*f(*grids)), -1) if isinstance(f(*grids), tuple) else f(*grids)[..., None]
    return table(origin, spacing, values, matrices)


def formula(g=(), tau=(), friction=0.0, strength=0.0, modulus=0.0) -> Surrogate:
    """A surrogate of `vertical`, with one stress mode that grows with depth where g is given."""
    plan = [through(n) for n in BOX.counts]
    origin, spacing = np.append(BOX.low, 0), np.append(BOX.spacing, 1 / BOX.depths)
    law = field(lambda x, y, d: vertical(x, y, d) / d**1.5, [*plan, energy_from_force(8)], spacing, origin)
    shape = field(lambda x, y, d: (1 + 0 * x, x + d), [*plan, from_depths(8)], spacing, origin)
    touch = field(lambda x, y: height(x, y), plan, BOX.spacing, BOX.low)
    memory = None
    if len(g):
        stress = field(lambda x, y, d: STIFF**0.5 * d**0.5 * (1 + LEAN * x), [*plan, from_depths(8)], spacing, origin)
        memory = Memory(stress, stress, np.array(g), np.array(tau))
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    surface = Surface((1, 1, 0), shape, np.ones((2, 4, 3)), field(lambda x, y: 1 + 0 * x, plan, BOX.spacing, BOX.low),
        rest[None], field(lambda x, y: (0 * x, 1 + 0 * x, 0 * x, 1 + 0 * x), plan, BOX.spacing, BOX.low),
    )  # fmt: skip
    rub = drag.Rub(*(np.asarray(v) for v in (friction, 0.0, strength, 2e-4)), np.array(SLIP), np.asarray(modulus))
    rig = Rig(np.zeros(3), np.asarray(0.0), np.asarray(0.0))
    return Surrogate(
        BOX.low, BOX.high, np.asarray(DEPTH), np.asarray(RADIUS), touch, law, surface, memory, rub, rig, np.asarray(1.0)
    )


def at(x, y, d):
    """A ball at depth d below first contact over (x, y)."""
    return jnp.array([x, y, height(x, y) - d])


SLAB = lobe_of_mesh(box((0.04, 0.04, 0.014), (4, 4, 2)))
SMALL = Grid((8, 8, 2), 4e-3)


def matter(*effects, **values) -> Matter:
    """A slab of a reduced polynomial and a ball of 4 mm."""
    model = Model(catalogue.energy("reduced-polynomial-2"), catalogue.volumetric("quadratic"), effects)
    given = {"energy.C10": 600.0, "energy.C20": 300.0, "volumetric.K": 10e3}
    return Matter(model, model.defaults | given | values, SLAB, 4e-3, 1000.0)


SMALL_BOX = Box(np.array([-0.003, -0.003]), np.array([0.003, 0.003]), 2e-3, (2, 2), 4)


@cache
def small():
    """A surrogate of the slab from statics, relaxing; coarse, a matter of seconds."""
    from tissuejax.effects.viscoelasticity import Viscoelasticity

    prony = {"g1": 0.2, "g2": 0.15, "tau1": 0.5, "tau2": 5.0}
    tissue = matter(Viscoelasticity(terms=2), **{f"effects.viscoelasticity.{k}": v for k, v in prony.items()})
    return precompute(tissue, SMALL_BOX, SMALL, processes=1, numerical=False)
