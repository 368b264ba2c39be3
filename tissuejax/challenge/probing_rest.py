"""A rest beside the effects of a probing: laws of `rests` that act on the force, its markers left as they are."""

from dataclasses import dataclass, replace

import numpy as np

from tissuejax.challenge.places import most_of, shares
from tissuejax.challenge.probing_bench import Record as Press
from tissuejax.challenge.probing_sizes import by_channel, where
from tissuejax.challenge.rests import rests
from tissuejax.challenge.rests.rest import Record, together
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body

LAWS = ("coarse", "kinked-law", "play", "rate-gain", "rig-filter", "slips", "wander")  # need a force and a depth alone
RATIO, SIZE = (0.05, 0.5), (3.0, 15.0)


@dataclass(frozen=True)
class Beside:
    """Presses with their rest, and what the key says of it."""

    presses: list[Press]
    key: dict


def trial(press: Press) -> Trial:
    """The press as rests see it: force over time, driven by the depth from its highest place, in radii."""
    depth = np.interp(press.force_time, press.time, press.probe[0, 2] - press.probe[:, 2]) / press.radius
    return Trial(press.name, "simple-shear", press.force_time, depth, np.eye(3)[2], press.start, 1.0, 1.0, 1.0)


def beside(
    rng: np.random.Generator, clean: list[Press], bare: list[Press], sizes: list[float], noise: tuple[float, float]
) -> Beside:
    """Add a rest of two or three laws, a drawn share of the weakest effect; the last press is held out.

    Args:
        clean: with the effects; bare: without any.
        sizes: of the effects over the noise; none for a rest alone.
        noise: of force and markers, N and m.
    """
    own = [trial(p) for p in clean]
    top = max(float(np.abs(p.force).max()) for p in clean)
    laws, chosen = rests(), [str(n) for n in rng.choice(LAWS, size=int(rng.integers(2, 4)), replace=False)]
    records = [Record(t, p.force, Body({}), top) for t, p in zip(own, clean)]
    parts = [laws[n].change(rng, records) for n in chosen]
    base = [p.force for p in bare]

    def left(forces: list[np.ndarray]) -> list[np.ndarray]:
        """What a modulus that scales the bare force can't take up, fitted to all presses but the last."""
        a, b = (np.concatenate([x.ravel() for x in xs[:-1]]) for xs in (base, forces))
        scale = float(a @ b / (a @ a))
        return [f - scale * g for f, g in zip(forces, base)]

    def size(forces: list[np.ndarray]) -> float:
        return float(np.sqrt(np.mean(np.concatenate([x.ravel() for x in left(forces)[:-1]]) ** 2)) / noise[0])

    ratio = float(np.exp(rng.uniform(*np.log(RATIO))))
    strength = min(sizes) if sizes else float(np.exp(rng.uniform(*np.log(SIZE))))
    weights = [float(w) for w in rng.dirichlet(np.full(len(chosen), 3.0))]
    mixed = together(parts, weights, [size(p) for p in parts])
    rest = [ratio * strength / size(mixed) * x for x in mixed]
    presses = [replace(p, force=p.force + d) for p, d in zip(clean, rest)]
    gap = shares(own, left([p.force for p in presses]))
    lacking = left(rest)
    key = {
        "alike": False,
        "tolerated": sorted({n for law in chosen for n in laws[law].true_names}),
        "rest": {
            "laws": dict(zip(chosen, weights)),
            "ratio": ratio,
            "over_noise": ratio * strength,
            "beyond_rms": {p.name: float(np.sqrt(np.mean(x**2))) for p, x in zip(clean, lacking)},
        },
        "samples": {p.name: len(p.force_time) for p in clean},
        "where": where(by_channel(bare[:-1], presses[:-1], noise))
        | {
            "shares": gap,
            "recordings": most_of(gap["recordings"]),
            "phases": most_of(gap["phases"]),
        },
        "kept_rms": {"rest": None},  # a fourth press would cost as much again: none is kept back
    }
    return Beside(presses, key)
