"""Stress with a past: relaxation and damage laws for challenge specimens, several of each, none taken from `effects`.

Each works on a history of stress `s` (n, ...), be it the second Piola-Kirchhoff stress or the nominal stress.
"""

import numpy as np
from jaxtyping import Float
from scipy.special import erf

History = Float[np.ndarray, "n ..."]


def _along(x: Float[np.ndarray, " n"], like: History) -> History:
    return x.reshape(-1, *([1] * (like.ndim - 1)))


def prony(time: Float[np.ndarray, " n"], s: History, g: list[float], tau: list[float]) -> History:
    """s - sum g_i (s - h_i): h_i' = s' - h_i / tau_i, exact where s runs straight between samples.

    The response to a jump is the whole of s, and 1 - sum g_i of it after a long hold (Fung 1972; Simo 1987).
    """
    out = (1 - sum(g)) * s
    dt = np.diff(time)
    for weight, t in zip(g, tau):
        decay = np.exp(-dt / t)
        gain = -np.expm1(-dt / t) * t / dt
        h = np.empty_like(s)
        h[0] = s[0]
        for i in range(len(dt)):
            h[i + 1] = decay[i] * h[i] + gain[i] * (s[i + 1] - s[i])
        out = out + weight * h
    return out


def prony_strained(
    time: Float[np.ndarray, " n"],
    s: History,
    strain: Float[np.ndarray, " n"],
    g: list[float],
    tau: list[float],
    b: float,
) -> History:
    """As `prony`, with relaxation times tau_i exp(b |strain|): slower the further stretched for b > 0."""
    out = (1 - sum(g)) * s
    dt = np.diff(time)
    middle = np.abs(strain[1:] + strain[:-1]) / 2
    for weight, t in zip(g, tau):
        local = t * np.exp(b * middle)
        decay = np.exp(-dt / local)
        gain = -np.expm1(-dt / local) * local / dt
        h = np.empty_like(s)
        h[0] = s[0]
        for i in range(len(dt)):
            h[i + 1] = decay[i] * h[i] + gain[i] * (s[i + 1] - s[i])
        out = out + weight * h
    return out


def power_spectrum(total: float, fastest: float, slowest: float, exponent: float, modes: int = 14):
    """(g, tau) of a broad spectrum: g proportional to tau^exponent on logarithmically spaced times (Neubert 1963)."""
    tau = np.geomspace(fastest, slowest, modes)
    g = tau**exponent
    return (total * g / g.sum()).tolist(), tau.tolist()


def softening(W: Float[np.ndarray, " n"], strain: Float[np.ndarray, " n"], kind: str, r: float, m: float) -> np.ndarray:
    """Factor on the stress after damage by what the specimen has been through so far.

    kind: "tanh" and "erf": pseudo-elastic, 1 - r f((Wmax - W) / m), none on first loading (Ogden and Roxburgh 1999;
    Dorfmann and Ogden 2003); "discontinuous": 1 - r (1 - exp(-Wmax / m)), first loading included (Miehe 1995);
    "stretch": 1 - r (1 - exp(-(emax - e) / m)) with e the size of the strain, m a number.
    """
    if kind == "stretch":
        e = np.abs(strain)
        return 1 - r * -np.expm1(-(np.maximum.accumulate(e) - e) / m)
    top = np.maximum.accumulate(W)
    if kind == "discontinuous":
        return 1 - r * -np.expm1(-top / m)
    return 1 - r * {"tanh": np.tanh, "erf": erf}[kind]((top - W) / m)


def set_strain(strain: History, kind: str, share: float, threshold: float) -> History:
    """Permanent strain, of the same kind as `strain` (logarithmic stretch or shear), grown by the largest one so far.

    kind: "share": share of the largest pull and of the largest push; "threshold": share of what exceeds `threshold`.
    """
    pull = np.maximum.accumulate(np.maximum(strain, 0), 0)
    push = np.maximum.accumulate(np.maximum(-strain, 0), 0)
    if kind == "threshold":
        pull, push = np.maximum(pull - threshold, 0), np.maximum(push - threshold, 0)
    return share * (pull - push)


def drained(
    time: Float[np.ndarray, " n"], push: Float[np.ndarray, " n"], bulk: float, tau: float
) -> Float[np.ndarray, " n"]:
    """ln J of a specimen whose fluid leaves or enters: (ln J)' = -(push / bulk + ln J) / tau.

    `push` is the fluid's pressure were nothing to leave, Pa (linear poroelastic relaxation, one time: Armstrong 1984).
    """
    y = np.zeros(len(time))
    for i, dt in enumerate(np.diff(time)):
        goal = -(push[i] + push[i + 1]) / 2 / bulk
        y[i + 1] = goal + (y[i] - goal) * np.exp(-dt / tau)
    return y
