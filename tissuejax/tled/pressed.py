"""What a probe's path will make of the tissue under it, foreseen: how far squeezed, and how stiff and quick then.

Step and penalty are chosen once, before a run, but the tissue under a ball that goes deep is not the tissue at rest:
elements shorten, so waves cross them sooner, and laws that stiffen do so there first. Two compressions matter.

The shortest stretch of any element under a ball of radius R at depth d bounds the step: about exp(-0.85 d/R) (measured
with neo-Hookean tissue, R 4.75 mm on a layer of 20 mm: 0.69, 0.53 and 0.35 at 2, 4 and 6 mm deep). A law that stiffens
spreads the strain (in vivo 3: 0.64, 0.50, 0.45), so it is followed only until it is `SPREAD` times as stiff as at rest.

The pressure goes by what the tissue as a whole is compressed to: the layer's own compression, and the representative
strain 0.2 a/R of a ball with contact radius a (Tabor 1951, The Hardness of Metals). The penalty follows the stiffness
there. Both are estimates: `simulate.run` halves the step of a run that breaks down, and refuses deep penetration.
"""

import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.energies.strain import Strain
from tissuejax.tensors import Sym
from tissuejax.tled.scene import Scene
from tissuejax.tled.shapes import Shape

UNDER_BALL = 0.85  # logarithmic compression of the shortest element per depth over radius
MOST_PRESSED = 1.1  # where balls go deeper than their radius the tissue flows aside and is not squeezed much further
LAYER = 1.2  # greatest logarithmic compression under the probe over that of the whole layer
TABOR = 0.2  # representative strain of a ball over contact radius per radius
SPREAD = 30.0  # stiffening beyond which strain goes elsewhere
STIFFEST = 300.0  # laws that end at some strain (log, exp, Gent) are not followed beyond this
LOOKS = 16  # stretches between rest and the shortest at which stiffness is looked at


def depth(points: Float[np.ndarray, "N 3"], shape: Shape, position: Float[np.ndarray, "n 3"]) -> tuple[float, float]:
    """How deep the probe goes into the undeformed body, m, and the body's thickness there, m."""
    points, position = np.asarray(points), np.asarray(position)
    lowest = position[np.argmin(position[:, 2])]
    reach = float(shape.reach())
    tip = lowest[2] - (reach if math.isfinite(reach) else 0.0)
    away = np.linalg.norm(points[:, :2] - lowest[:2], axis=1)
    near = away <= np.sort(away)[: max(8, len(points) // 200)][-1] if math.isfinite(reach) else np.full(len(away), True)
    column = points[near, 2]
    return max(0.0, float(column.max() - tip)), float(column.max() - points[:, 2].min())


def shortest_stretch(points: Float[np.ndarray, "N 3"], shape: Shape, position: Float[np.ndarray, "n 3"]) -> float:
    """Smallest principal stretch to expect in an element under the probe; 1 where it does not press."""
    deep, thick = depth(points, shape, position)
    reach = float(shape.reach())
    layer = -LAYER * math.log(max(1.0 - deep / thick, 0.05))
    ball = min(UNDER_BALL * deep / reach, MOST_PRESSED) if math.isfinite(reach) else 0.0
    return math.exp(-max(ball, layer))


def typical_stretch(points: Float[np.ndarray, "N 3"], shape: Shape, position: Float[np.ndarray, "n 3"]) -> float:
    """Compression that stands for the whole of the tissue under the probe, and goes with the pressure on it."""
    deep, thick = depth(points, shape, position)
    reach = float(shape.reach())
    contact = min(1.0, math.sqrt(2 * deep / reach)) if math.isfinite(reach) else 0.0
    return math.exp(math.log(max(1.0 - deep / thick, 0.05)) - TABOR * contact)


def near(points: Float[np.ndarray, "N 3"], cells, shape: Shape, position: Float[np.ndarray, "n 3"]) -> np.ndarray:
    """Which elements (E,) lie in plan within two radii of the probe's path: those that it may squeeze."""
    reach = 2 * float(shape.reach())
    centres = np.asarray(points)[np.asarray(cells)].mean(1)[:, :2]
    some = np.asarray(position)[:: max(1, len(position) // 50), :2]
    away = np.min([np.linalg.norm(centres - p, axis=1) for p in some], axis=0)
    return away <= max(reach, float(away.min()))


def _slopes(scene: Scene, stretch: float) -> tuple[np.ndarray, np.ndarray]:
    """Stretches from rest to `stretch`, and the slope of Cauchy stress over logarithmic strain there over that at rest
    (uniaxial compression at constant volume)."""
    energy, values = scene.tissue.energy, scene.tissue.energy_values

    def psi(e):
        a, b, zero = jnp.exp(2 * e), jnp.exp(-e), jnp.zeros_like(e)
        strain = Strain.of(Sym(b, b, a, zero, zero, zero))
        return energy.isochoric(values, strain) + sum((more(strain) for more in scene.tissue.added), zero)

    logs = jnp.linspace(-1e-3, math.log(min(stretch, 0.998)), LOOKS)
    slopes = np.asarray(jax.jit(jax.vmap(jax.grad(jax.grad(psi))))(logs))
    return np.exp(np.asarray(logs)), np.nan_to_num(slopes / slopes[0], nan=STIFFEST, posinf=STIFFEST)


def stiffening(scene: Scene, stretch: float) -> float:
    """Greatest stiffness down to a compression of `stretch` over that at rest; from 1 to `STIFFEST`."""
    return float(np.clip(_slopes(scene, stretch)[1].max(), 1.0, STIFFEST))


def spread(scene: Scene, stretch: float) -> float:
    """`stretch`, or the longer one at which the law has become `SPREAD` times as stiff."""
    stretches, slopes = _slopes(scene, stretch)
    beyond = np.flatnonzero(slopes > SPREAD)
    return float(stretches[beyond[0]]) if len(beyond) else stretch


def quickening(scene: Scene, stretch: float) -> float:
    """By what factor the fastest waves cross an element sooner once it is squeezed to `stretch`; at least 1.

    The root of the ratio of the largest acoustic moduli: eigenvalues of d2Psi/dF2 for waves along the axes.
    """
    tissue = scene.tissue

    def psi(F):
        C = F.T @ F
        strain = Strain.of(Sym(C[0, 0], C[1, 1], C[2, 2], C[0, 1], C[0, 2], C[1, 2]))
        total = tissue.energy.isochoric(tissue.energy_values, strain)
        total = total + tissue.volumetric.energy(tissue.volumetric_values, strain.J)
        return total + sum((more(strain) for more in tissue.added), jnp.zeros_like(strain.J))

    def modulus(l: Float[Array, ""]):
        A = jax.hessian(psi)(jnp.diag(jnp.stack([l**-0.5, l**-0.5, l])))
        return jnp.max(jnp.stack([jnp.linalg.eigvalsh(A[:, k, :, k])[-1] for k in (0, 2)]))

    stretches = jnp.linspace(0.9999, min(stretch, 0.9999), LOOKS)
    moduli = np.asarray(jax.jit(jax.vmap(modulus))(stretches))
    grown = np.nan_to_num(moduli / moduli[0], nan=STIFFEST, posinf=STIFFEST)
    return float(math.sqrt(np.clip(grown.max(), 1.0, STIFFEST)))
