"""A blade through two elastic foundations glued by a cohesive law: implicit, quasi-static, in one dimension.

Each half of the tissue is a Pasternak foundation (stiffness k = M / W across, shear layer mu W / 3 along the path) that
hardens with compression; the faces are held together by an exponential law with memory, and pushed apart by a wedge
with a rounded shoulder. Every position of the blade is an equilibrium, found by Newton's method on a tridiagonal
system; the force follows from virtual work, 2 sum p w'(s) dx, and friction m turns it: N is what presses on a face of
slope w', p = N (cos - m sin) of it acts across and N (sin + m cos) along, so 2 sum p (w' + m) / (1 - m w') dx. Nothing
is shared with the explicit finite elements or the balance of energies that a diagnosis uses.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_banded

STRIDE = 1e-4  # m: the blade moves no farther from one equilibrium to the next
SPACING = 2.5e-5  # m: the force has a ripple of this period, 11 % of it at 0.2 mm and a blade of 0.35 mm, 0.1 % here
ROUNDS = 60


class Slab(NamedTuple):
    """length, half: of the tissue, m. mu: shear modulus. wave: across, Pa. hardening: of the layer with compression."""

    length: float
    half: float
    mu: float
    wave: float
    hardening: float


class Knife(NamedTuple):
    """thickness, m; slope of a bevel; penalty, Pa/m."""

    thickness: float
    slope: float
    penalty: float


def wedge(knife: Knife, s: Float[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Half width of the blade at distance s behind the edge, and its slope; ahead the bevel goes on below zero."""
    half, soft = knife.thickness / 2, 0.05 * knife.thickness
    a, b = knife.slope * s, half
    h = np.clip(0.5 + 0.5 * (b - a) / soft, 0, 1)
    return h * a + (1 - h) * b - soft * h * (1 - h), h * knife.slope


def draw(
    slab: Slab,
    knife: Knife,
    edge: Float[np.ndarray, " n"],
    toughness,
    strength,
    spacing: float = SPACING,
    notch: float = 0.0,
    friction: Float[np.ndarray, " n"] | float = 0.0,
) -> Float[np.ndarray, " n"]:
    """Force per depth at each place of the edge, in the order given, N/m.

    Args:
        edge: places along x, m; tissue lies from 0 to `slab.length`.
        toughness, strength: J/m^2 and Pa as functions of place. notch: parted up to here from the start.
        friction: coefficient at each place of the edge, positive where the blade goes on, negative on the way back.
    """
    x = (np.arange(round(slab.length / spacing)) + 0.5) * spacing
    G, tau = toughness(x), strength(x)
    peak = G / (np.e * tau)
    shear = slab.mu * slab.half / 3 / spacing**2
    v, most = np.zeros_like(x), np.where(x < notch, 60 * peak, 0.0)
    force = np.zeros(len(edge))
    before, rub = edge[0], np.broadcast_to(friction, len(edge))
    for i, target in enumerate(edge):
        count = max(1, int(np.ceil(abs(target - before) / STRIDE)))
        for place in before + (target - before) * np.arange(1, count + 1) / count:
            w, slope = wedge(knife, place - x)
            v = _balanced(slab, knife, v, w, most, tau, peak, shear)
            most = np.maximum(most, 2 * v)
        before = target
        p = knife.penalty * np.maximum(w - v, 0.0)
        force[i] = 2 * np.sum(p * (slope + rub[i]) / (1 - rub[i] * slope)) * spacing
    return force


def _balanced(slab, knife, v, w, most, tau, peak, shear):
    """Half opening in equilibrium, from the last one; a step is halved until the residual falls."""
    k = slab.wave / slab.half

    def residual(v):
        opening = 2 * v
        reach = np.maximum(opening, most)
        secant = tau / peak * np.exp(1 - reach / peak)
        slope = 2 * np.where(opening > most, secant * (1 - opening / peak), secant)
        shut, touch = v < 0, w > v
        T, slope = np.where(shut, knife.penalty * v, secant * opening), np.where(shut, knife.penalty, slope)
        hard = slab.hardening * np.abs(v) / slab.half
        bend = np.zeros_like(v)
        bend[1:] += v[1:] - v[:-1]
        bend[:-1] += v[:-1] - v[1:]
        r = k * v * (1 + hard) + T - knife.penalty * np.where(touch, w - v, 0.0) + shear * bend
        return r, k * (1 + 2 * hard) + slope + knife.penalty * touch

    r, d = residual(v)
    side = np.full(len(v), -shear)
    for _ in range(ROUNDS):
        if np.abs(r).max() < 1e-6 * np.max(tau):
            break
        middle = np.maximum(d, k) + 2 * shear  # softening points are stiffened: the step still goes downhill
        step = solve_banded((1, 1), np.stack([side, middle, side]), -r)
        share = 1.0
        for _ in range(6):
            new, slope = residual(v + share * step)
            if np.linalg.norm(new) < np.linalg.norm(r):
                break
            share *= 0.5
        v, r, d = v + share * step, new, slope
    return v
