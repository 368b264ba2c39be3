"""How large a concealed effect is in a probing, over the noise: in force and markers, and channel by channel."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from tissuejax.challenge.places import most_of
from tissuejax.challenge.probing_bench import Record

DEPTHS = 41  # edges of the depths at which a bare force is known
CHANNELS = ("force x", "force y", "force z", "markers")
SEEN = 1.0  # times the noise, in some channel: below, no place of a misfit is asked for


def missing(
    bare: Sequence[Record], full: Sequence[Record]
) -> tuple[Float[np.ndarray, "f 3"], Float[np.ndarray, "m 3"]]:
    """What the bare body, its force scaled to fit, leaves of force (N) and markers (m), recording after recording.

    The bare force is that along the path that was recorded, which is another one where the rig gives.
    """
    a = np.concatenate([along(e, f) for e, f in zip(bare, full, strict=True)])
    b = np.concatenate([f.force for f in full])
    scale = np.sum(a * b) / np.sum(a * a)
    seen = np.concatenate([(f.markers - e.markers).reshape(-1, 3) for e, f in zip(bare, full)])
    return b - a * scale, seen


def parts(bare: Sequence[Record], full: Sequence[Record], noise: tuple[float, float]) -> tuple[float, float]:
    """Rms over noise of what an effect leaves, in force and in markers, once the bare force is scaled to fit."""
    force, markers = (float(np.sqrt(np.mean(x**2)) / s) for x, s in zip(missing(bare, full), noise))
    return force, markers


def by_channel(
    bare: Sequence[Record], full: Sequence[Record], noise: tuple[float, float]
) -> dict[str, tuple[float, float]]:
    """(rms over noise, sum of squares over the noise's variance) of what is missing in every channel."""
    force, seen = missing(bare, full)
    over = [*(force / noise[0]).T, seen / noise[1]]
    return {n: (float(np.sqrt(np.mean(x**2))), float(np.sum(x**2))) for n, x in zip(CHANNELS, over)}


def where(channels: dict[str, tuple[float, float]]) -> dict:
    """The key's word on it: sizes over the noise, and the fewest channels that hold most of what is missing.

    The list is empty where no channel has it above the noise: nothing can be asked of such a case.
    """
    sizes = {name: rms for name, (rms, _) in channels.items()}
    told = most_of({name: squares for name, (_, squares) in channels.items()}) if max(sizes.values()) >= SEEN else []
    return {"channel_sizes": sizes, "channels": told}


def along(bare: Record, full: Record) -> Float[np.ndarray, "f 3"]:
    """Force of the bare body, which is elastic, where `full` says the probe was: its vertical part by depth."""
    here, there = (np.interp(bare.force_time, r.time, r.probe[:, 2]) for r in (bare, full))
    if np.array_equal(here, there):
        return bare.force
    bins = np.digitize(here, np.linspace(here.min(), here.max(), DEPTHS)) - 1
    filled = np.unique(bins)
    depth, force = (np.array([np.mean(x[bins == k]) for k in filled]) for x in (here, bare.force[:, 2]))
    by_depth = PchipInterpolator(depth, force)  # which goes on a little below the deepest
    return bare.force + (by_depth(there) - by_depth(here))[:, None] * np.array([0.0, 0.0, 1.0])
