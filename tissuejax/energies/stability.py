"""Material stability after Drucker: more strain must cost more stress, in every direction from every state of a path.

For an incompressible solid the work in logarithmic principal strains is W(e1, e2) with e3 = -e1 - e2. Its Hessian D
relates increments of Kirchhoff stress differences to increments of strain, and Drucker's d tau : d e > 0 says that D is
positive definite (the test of ABAQUS too). The least eigenvalue of D is 0 at the first unstable stretch
and enters a fit as a constraint or a penalty.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.arrays import Either
from tissuejax.energies.energy import Energy
from tissuejax.energies.paths import SECOND, along, principal
from tissuejax.energies.validity import check_stretches, valid_stretches
from tissuejax.parameters import Constants

PATHS = tuple(SECOND)


@dataclass(frozen=True)
class PathStability:
    """Stability along one path.

    Attributes:
        path: "uniaxial", "planar" or "equibiaxial".
        stretch: where it was looked at, rising.
        least: least eigenvalue of D there, Pa; positive where stable.
        ranges: the stable ranges of stretch.
        unstable_below, unstable_above: nearest unstable stretch on either side of 1, None where there is none.
    """

    path: str
    stretch: Float[np.ndarray, "n"]
    least: Float[np.ndarray, "n"]
    ranges: tuple[tuple[float, float], ...]
    unstable_below: float | None
    unstable_above: float | None

    @property
    def stable(self) -> bool:
        """Stable all along what was looked at."""
        return self.unstable_below is None and self.unstable_above is None


@dataclass(frozen=True)
class Stability:
    """Stability of an energy over the paths and stretches asked for."""

    paths: dict[str, PathStability]

    @property
    def stable(self) -> bool:
        """Stable along every path."""
        return all(path.stable for path in self.paths.values())

    @property
    def sentence(self) -> str:
        """The finding in words, for warnings and reports."""
        bad = []
        for path in self.paths.values():
            low, high = path.unstable_below, path.unstable_above
            sides = [f"from stretch {high:.3f} up"] if high is not None else []
            sides += [f"from {low:.3f} down"] if low is not None else []
            if sides:
                bad.append(f"{path.path} {' and '.join(sides)}")
        first = next(iter(self.paths.values()))
        span = f"between stretches {first.stretch[0]:.3g} and {first.stretch[-1]:.3g}"
        if not bad:
            return f"The material is stable (Drucker) in {', '.join(self.paths)} {span}."
        return f"The material is unstable (Drucker), looked at {span}: {'; '.join(bad)}."


def log_strain_tangent(energy: Energy, p: Constants, path: str, stretch: Float[Either, "n"]) -> Float[Either, "n 2 2"]:
    """D = d2W/de_i de_j, Pa, at each stretch along `path`; at rest 2 G [[2, 1], [1, 2]].

    Principal axes stay along 1, 2, 3; an energy with fibres is tested for increments along these axes only.
    """
    C = along(path, stretch).C
    start = 0.5 * jnp.stack([jnp.log(C.xx), jnp.log(C.yy)], -1)

    def work(e: Float[Either, "2"]) -> Either:
        return energy.isochoric(p, principal(jnp.exp(e[0]), jnp.exp(e[1])))

    return jax.vmap(jax.hessian(work))(start)


def least_eigenvalue(energy: Energy, p: Constants, path: str, stretch: Float[Either, "n"]) -> Float[Either, "n"]:
    """Least eigenvalue of D, Pa, at each stretch; stable where positive. Differentiable in `p`: a constraint."""
    D = log_strain_tangent(energy, p, path, stretch)
    middle, half, off = 0.5 * (D[:, 0, 0] + D[:, 1, 1]), 0.5 * (D[:, 0, 0] - D[:, 1, 1]), D[:, 0, 1]
    square = half**2 + off**2
    some = square > 0
    return middle - jnp.where(some, jnp.sqrt(jnp.where(some, square, 1.0)), 0.0)


def penalty(energy: Energy, p: Constants, stretches: Mapping[str, Float[Either, "n"]]) -> Float[Either, ""]:
    """Mean square of the unstable part of the least eigenvalue over the mean size of D: 0 where stable, dimensionless.

    Args:
        stretches: by path, the stretches that must be stable. Differentiable in `p`, once continuously.
    """
    total: Any = 0.0
    for path, stretch in stretches.items():
        size = jax.lax.stop_gradient(jnp.mean(jnp.abs(log_strain_tangent(energy, p, path, stretch))))
        unstable = jnp.maximum(-least_eigenvalue(energy, p, path, stretch) / jnp.where(size > 0, size, 1.0), 0.0)
        total = total + jnp.mean(unstable**2)
    return total


def stability(
    energy: Energy,
    p: Constants,
    within: tuple[float, float] = (0.5, 2.0),
    paths: tuple[str, ...] = PATHS,
    points: int = 201,
) -> Stability:
    """Where the material is stable along `paths` between two stretches, to 1e-6 in stretch.

    Of an energy that ends (log-Ogden, Gent) the valid part of the range is looked at.

    Args:
        p: parameters by name, concrete.
        within: smallest and largest stretch, e.g. those of the recordings.

    Raises:
        InputError: a stretch <= 0, an unknown path.
    """
    check_stretches(np.asarray(within), "stability, range of stretch")
    return Stability({path: _look(energy, p, path, _grid(energy, p, path, within, points)) for path in paths})


def _grid(energy: Energy, p: Constants, path: str, within: tuple[float, float], points: int) -> np.ndarray:
    """Stretches even in ln l, with 1 as a point of its own so that "nearest to rest" is well defined on both sides."""
    ends = valid_stretches(energy, p, path)
    low, high = (np.log(np.clip(w, *ends)) for w in sorted(within))
    return np.exp(np.unique(np.append(np.linspace(low, high, points), 0.0 if low < 0 < high else low)))


@eqx.filter_jit
def _least(energy, p, path, stretch):
    return least_eigenvalue(energy, p, path, stretch)


def _look(energy: Energy, p: Constants, path: str, stretch: np.ndarray) -> PathStability:
    p = {name: jnp.asarray(value) for name, value in p.items()}
    least = np.asarray(_least(energy, p, path, jnp.asarray(stretch)))
    good = least > 0
    ends = np.flatnonzero(good[1:] != good[:-1])
    if ends.size:  # all sign changes are bisected together
        a, b = np.log(stretch[ends]), np.log(stretch[ends + 1])
        for _ in range(20):
            middle = 0.5 * (a + b)
            as_left = (np.asarray(_least(energy, p, path, jnp.asarray(np.exp(middle)))) > 0) == good[ends]
            a, b = np.where(as_left, middle, a), np.where(as_left, b, middle)
        crossings = np.exp(0.5 * (a + b))
    else:
        crossings = np.array([])
    edges = [stretch[0], *crossings, stretch[-1]]
    pieces = [(float(a), float(b), bool(good[0]) == (k % 2 == 0)) for k, (a, b) in enumerate(zip(edges, edges[1:]))]
    unstable = [(a, b) for a, b, fine in pieces if not fine]
    return PathStability(
        path=path,
        stretch=stretch,
        least=least,
        ranges=tuple((a, b) for a, b, fine in pieces if fine),
        unstable_below=max((min(b, 1.0) for a, b in unstable if a < 1.0), default=None),
        unstable_above=min((max(a, 1.0) for a, b in unstable if b > 1.0), default=None),
    )
