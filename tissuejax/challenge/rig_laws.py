"""What rig and sensor add to a challenge recording: on the drive before the specimen, on the stress after it."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.specimen import Trial
from tissuejax.errors import NotConverged

History = Float[np.ndarray, "n ..."]


def slack(x: History, kind: str, gap: float) -> History:
    """Strain-like quantity (stretch - 1 or shear) that reaches the specimen through a loose grip, both ways.

    kind: "sharp": nothing until `gap`; "smooth": sqrt(x^2 + gap^2) - gap; "toe": x - gap (1 - exp(-|x| / gap)).
    All lag by `gap` in the end.
    """
    size = np.abs(x)
    left = {
        "sharp": np.maximum(size - gap, 0),
        "smooth": np.sqrt(size**2 + gap**2) - gap,
        "toe": size - gap * -np.expm1(-size / gap),
    }[kind]
    return np.sign(x) * left


def through_spring(
    drive: History, respond: Callable[[History], History], give: Callable[[History], History]
) -> tuple[History, History]:
    """(drive of the specimen, its stress) in series with a rig: x + give(P(x)) = drive, histories included.

    Damped fixed point over the whole history, Anderson-accelerated by the secant of each sample.

    Raises:
        NotConverged: not within 1e-9 after 200 rounds.
    """
    x = np.array(drive)
    P = respond(x)
    r = drive - give(P) - x
    step = 0.5 * r
    for _ in range(200):
        if np.max(np.abs(r)) < 1e-9:
            return x, P
        trial = x + step
        P = respond(trial)
        new = drive - give(P) - trial
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (new - r) / (trial - x)
        slope = np.where(np.isfinite(slope), np.clip(slope, -8.0, -0.9), -1.0)
        x, r = trial, new
        step = np.clip(-r / slope, -0.05, 0.05)
    raise NotConverged(f"challenge rig in series with the specimen: residual {np.max(np.abs(r)):g} after 200 rounds")


def rig_strain(P: History, kind: str, amount: float, area: float, height: float, knee: float) -> History:
    """Part of the nominal strain taken by the rig. kind: "linear" amount (m/N) x force / height; "stiffening"
    the same for small forces, knee asinh(F / knee) in place of F for large ones."""
    force = P * area
    if kind == "stiffening":
        force = knee * np.arcsinh(force / knee)
    return amount * force / height


def platen_factor(stretch: Float[np.ndarray, " n"], kind: str, mu: float, diameter: float, height: float) -> np.ndarray:
    """Factor by which rubbing platens raise the pressure of a pushed disc; 1 in tension. x = mu d / h, both current.

    kind: "mean" 1 + x / 3; "slab" 2 (exp(x) - 1 - x) / x^2 (Siebel 1923; Avitzur 1968); "reference" 1 + x / 3 with
    the undeformed d / h.
    """
    pushed = np.minimum(stretch, 1.0)
    x = mu * diameter / height * (np.ones_like(pushed) if kind == "reference" else pushed**-1.5)
    if kind == "slab":
        small = np.maximum(x, 1e-8)
        factor = 2 * (np.expm1(small) - small) / small**2
    else:
        factor = 1 + x / 3
    return np.where(stretch < 1, factor, 1.0)


def aging_factor(trial: Trial, kind: str, amount: float, time: float) -> Float[np.ndarray, " n"]:
    """Stiffness over its first value. kind: "linear" 1 + amount t / time; "settling" 1 + amount (1 - exp(-t / time));
    "exponential" exp(amount t / time)."""
    t = trial.start + trial.time - trial.time[0]
    if kind == "settling":
        return 1 + amount * -np.expm1(-t / time)
    return np.exp(amount * t / time) if kind == "exponential" else 1 + amount * t / time


def drift(trial: Trial, kind: str, offset: float, rate: float) -> Float[np.ndarray, " n"]:
    """Force channel's zero, Pa, by t from each recording's begin. kind: "linear" offset + rate t; "warming" offset +
    rate (1 - exp(-t / 8 s)) 8 s."""
    t = trial.time - trial.time[0]
    return offset + rate * (8 * -np.expm1(-t / 8) if kind == "warming" else t)


def periodic(trial: Trial, kind: str, amount: float, period: float, phase: float, second: float) -> np.ndarray:
    """Added periodic stress, Pa. kind: "triggered": one phase in all recordings; "free": each starts elsewhere (`phase`
    + its start time / period, an absolute clock); "pulse": triggered with a second harmonic `second` times as large."""
    t = trial.time - trial.time[0] + (trial.start if kind == "free" else 0.0)
    angle = 2 * np.pi * t / period + phase
    return amount * (np.sin(angle) + (second * np.sin(2 * angle + 1.0) if kind == "pulse" else 0.0))
