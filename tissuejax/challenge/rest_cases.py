"""Draws material tests of one or two known effects beside a rest that no catalogue has, and rests alone.

The rest is a mix of two or three laws of `rests`, brought to a share of the weakest effect: both measured as what they
leave once the told energy has been refitted. One recording more than the file holds is kept back for the score.
"""

from dataclasses import replace

import numpy as np

from tissuejax.challenge.material import Ingredient, Specimen, reported
from tissuejax.challenge.material_cases import ALIKE, NOTHING, Case, body, choices
from tissuejax.challenge.measured import kept_rows, noise, sampled, sensor
from tissuejax.challenge.menu import Choice, Setting
from tissuejax.challenge.places import PHASES, missing, most_of, shares
from tissuejax.challenge.protocols import trials
from tissuejax.challenge.rests import rests
from tissuejax.challenge.rests.rest import Record, together
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strengths import beyond, reach
from tissuejax.errors import NotConverged

CATEGORIES = ("one", "two", "rest")
SHARES = (0.45, 0.25, 0.30)
RATIO = (0.05, 0.5)  # of the rest to the weakest effect
SIZE = (6.0, 30.0)  # of an effect over the noise: it is to be seen, what is asked is whether the rest hides it
KEPT = "kept"


def category(index: int) -> str:
    """Category of the case with this number: fixed shares, spread evenly over the numbers."""
    return CATEGORIES[int(np.searchsorted(np.cumsum(SHARES), (index * 0.6180339887498949) % 1.0, side="right"))]


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw(name: str, seed: int, index: int) -> tuple[Case, Trial, np.ndarray]:
    """The case with this seed and number, and the recording kept back: what is done in it and its true stress.

    Redrawn with the next sub-seed if a specimen can't be loaded that way.
    """
    for attempt in range(20):
        rng = np.random.default_rng([seed, index, attempt, 2])
        try:
            return _draw(name, rng, category(index), index)
        except (NotConverged, np.linalg.LinAlgError):
            continue
    raise NotConverged(f"challenge case {name}: no loadable specimen in 20 draws; choose another seed")


def _draw(name: str, rng: np.random.Generator, kind: str, turn: int) -> tuple[Case, Trial, np.ndarray]:
    base, energy = body(rng)
    picked = [] if kind == "rest" else choices(rng, kind, turn, alike=True)
    plan = trials(rng, rare=rng.random() < 0.25)
    plan.append(replace(trials(rng, rare=False)[-1], name=KEPT, start=plan[-1].start + 600.0))
    clean = [reported(Specimen(base), t) for t in plan]
    top = max(float(np.abs(c).max()) for c in clean)
    std = float(f"{top * _log(rng, 0.002, 0.008):.3g}")
    setting, fitted = Setting(base, plan[:-1], std, top), slice(0, len(plan) - 2)

    def size(stresses: list[np.ndarray]) -> float:
        return beyond(energy, plan[fitted], stresses[fitted], std)

    added, sizes = _effects(rng, picked, setting, lambda s: size([reported(s, t) for t in plan]), base)
    specimen = Specimen(base, tuple(added))
    truth = [reported(specimen, t) for t in plan]
    strength = min(sizes.values()) if sizes else _log(rng, *SIZE)
    ratio = _log(rng, *RATIO)
    laws = rests()
    chosen = [str(n) for n in rng.choice(list(laws), size=int(rng.integers(2, 4)), replace=False)]
    records = [Record(t, x, base, top) for t, x in zip(plan, truth)]
    parts = [laws[n].change(rng, records) for n in chosen]
    weights = [float(w) for w in rng.dirichlet(np.full(len(chosen), 3.0))]
    alone = [size(part) for part in parts]
    if min(alone) < NOTHING:
        raise NotConverged(f"{name}: a law of the rest is a part of {energy}")
    mixed = together(parts, weights, alone)
    rest = [ratio * strength / size(mixed) * x for x in mixed]
    cell = sensor(rng, std)
    rows = [kept_rows(rng, t) for t in plan[:-1]]
    seen = [sampled(t, r) for t, r in zip(plan[:-1], rows)]
    whole = [(x + d)[r] for x, d, r in zip(truth, rest, rows)]
    errors = [np.stack([noise(rng, cell, t.time) for _ in range(x[:1].size)], -1).reshape(x.shape)
              for t, x in zip(seen, whole)]  # fmt: skip
    stress = {t.name: x + e for t, x, e in zip(seen, whole, errors)}
    lacking = missing(energy, plan[fitted], [x[r] for x, r in zip(rest, rows)], seen, rows)
    gap = shares(seen, missing(energy, plan[fitted], whole, seen, rows))
    key = {
        "category": kind,
        "effects": [c.name for c in picked],
        "alike": any(pair <= {c.name for c in picked} for pair in ALIKE),
        "member": {c.name: c.member for c in picked},
        "ingredients": [{"name": i.name, "law": i.law, "amount": i.amount, **i.shape} for i in added],
        "tolerated": sorted({n for law in chosen for n in laws[law].true_names}),
        "size_over_noise": sizes,
        "rest": {
            "laws": dict(zip(chosen, weights)),
            "ratio": ratio,
            "over_noise": ratio * strength,
            "rms": {t.name: float(np.sqrt(np.mean(d[r] ** 2))) for t, d, r in zip(seen, rest, rows)},
            "beyond_rms": {t.name: float(np.sqrt(np.mean(x**2))) for t, x in zip(seen, lacking)},
        },
        "where": {
            "shares": gap,
            "recordings": most_of(gap["recordings"]),
            "phases": most_of(gap["phases"]),
            "order": list(PHASES),
        },
        "base": {"energy": energy, **base.terms},
        "noise": {"std": cell.std, "share": cell.share, "time": cell.time, "stated": cell.stated},
        "peak": max(float(np.abs(x).max()) for x in whole),
        "samples": {t.name: len(t.time) for t in seen},
        "truth_error_over_noise": {t.name: float(np.sqrt(np.mean((e / std) ** 2))) for t, e in zip(seen, errors)},
        "held_out": seen[-1].name,
        "kept_rms": {
            "rest": float(np.sqrt(np.mean(rest[-1] ** 2))),
            "stress": float(np.sqrt(np.mean(truth[-1] ** 2))),
        },
    }
    return Case(name, energy, seen, stress, cell.stated, key), plan[-1], truth[-1] + rest[-1]


def _effects(
    rng: np.random.Generator, picked: list[Choice], setting: Setting, size, base
) -> tuple[list[Ingredient], dict[str, float]]:
    """Ingredients of drawn sizes, and those sizes."""
    added, sizes = [], {}
    for choice in picked:
        made, least, most = choice.ingredient(rng, setting)
        alone, target = Specimen(base, (made,)), _log(rng, *SIZE)
        amount, sizes[made.name] = reach(
            lambda a, alone=alone, made=made: size(alone.scaled(made.name, a)), target, least, most
        )
        if sizes[made.name] < 3.0:
            raise NotConverged(f"{made.name}/{made.law} can't be made large enough to be seen here")
        added.append(replace(made, amount=amount))
    return added, sizes
