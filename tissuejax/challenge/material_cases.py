"""Draws whole material-test cases: body, recordings, effects at chosen sizes, noise. A seed gives the same case."""

from dataclasses import asdict, dataclass, replace

import numpy as np

from tissuejax.challenge.material import Ingredient, Specimen, reported
from tissuejax.challenge.menu import CATALOGUED, NAMES, STRAY, Choice, Setting
from tissuejax.challenge.protocols import trials
from tissuejax.challenge.sensor_noise import STEP, chain, misstated
from tissuejax.challenge.specimen import Trial
from tissuejax.challenge.strain_laws import Body
from tissuejax.challenge.strengths import beyond, reach
from tissuejax.errors import NotConverged

CATEGORIES = ("none", "one", "two", "three", "unknown")
SHARES = (0.20, 0.45, 0.14, 0.06, 0.15)
NOTHING = 1e-3  # size over noise: the told energy has that very term
NOMINAL = next(c for c in CATALOGUED if c.name == "viscoelasticity" and c.law == "nominal")
ALIKE = ({"slack", "machine-compliance"}, {"anisotropy", "aging"}, {"compressibility", "platen-friction"})


@dataclass(frozen=True)
class Case:
    """A made case.

    Attributes:
        name: file name without ending.
        energy: base model told to the diagnosis.
        trials: what was done.
        stress: recorded nominal stress with noise by recording, Pa.
        noise: what is stated of its standard deviation, Pa; None if nothing is.
        key: the truth, ready for JSON.
    """

    name: str
    energy: str
    trials: list[Trial]
    stress: dict[str, np.ndarray]
    noise: float | None
    key: dict


def category(index: int) -> str:
    """Category of the case with this number: fixed shares, spread evenly over the numbers."""
    grid = (index * 0.6180339887498949) % 1.0
    return CATEGORIES[int(np.searchsorted(np.cumsum(SHARES), grid, side="right"))]


def body(rng: np.random.Generator) -> tuple[Body, str]:
    """A base and the energy told to the diagnosis, which can express it: mostly reduced polynomial of order 2."""
    c10 = float(np.exp(rng.uniform(np.log(250), np.log(1500))))
    energy = str(rng.choice(["reduced-polynomial-2", "mooney-rivlin", "neo-hookean"], p=[0.85, 0.08, 0.07]))
    if energy == "reduced-polynomial-2" and rng.random() < 0.9:
        return Body({"10": c10, "20": c10 * float(rng.uniform(0.15, 1.3))}), energy
    if energy == "mooney-rivlin":
        return Body({"10": c10, "01": c10 * float(rng.uniform(0.1, 0.6))}), energy
    return Body({"10": c10}), energy


def choices(rng: np.random.Generator, kind: str, turn: int, alike: bool = False) -> list[Choice]:
    """Effects of a case; single ones take their turn so that all are met equally often.

    Args:
        alike: draw pairs that look alike as well; without, no rate of pairs says anything about them.
    """
    if kind == "none":
        return []
    if kind == "unknown":
        return [STRAY[turn % len(STRAY)]]
    count = {"one": 1, "two": 2, "three": 3}[kind]
    first = NAMES[turn % len(NAMES)]
    others = rng.permutation([n for n in NAMES if n != first])
    picked = [first]
    for name in others:
        if len(picked) < count and (alike or not any({name, p} in ALIKE for p in picked)):
            picked.append(str(name))
    found = []
    for name in picked:
        laws = [c for c in CATALOGUED if c.name == name]
        weights = np.array([2.0 if c.plain else 1.0 for c in laws])
        found.append(laws[int(rng.choice(len(laws), p=weights / weights.sum()))])
    fibres = any(c.name == "anisotropy" for c in found)
    # relaxation beside fibres acts on the nominal stress: a spectrum, which has no such form, becomes a Prony series
    return [
        (NOMINAL if c.law == "spectrum" else replace(c, law="nominal"))
        if fibres and c.law in ("pk2", "spectrum", "strained")
        else c
        for c in found
    ]


def draw(name: str, seed: int, index: int, kind: str | None = None, turn: int | None = None) -> Case:
    """The case with this seed and number; redrawn with the next sub-seed if a specimen can't be loaded that way.

    Args:
        kind: a category in place of the one that the number gives.
        turn: which effect a case of one begins with, in place of the one that the number gives.
    """
    for attempt in range(20):
        rng = np.random.default_rng([seed, index, attempt])
        try:
            return _draw(name, rng, kind or category(index), index if turn is None else turn)
        except (NotConverged, np.linalg.LinAlgError):
            continue
    raise NotConverged(f"challenge case {name}: no loadable specimen in 20 draws; choose another seed")


def _draw(name: str, rng: np.random.Generator, kind: str, turn: int) -> Case:
    base, energy = body(rng)
    picked = choices(rng, kind, turn)
    plan = trials(rng, rare=rng.random() < 0.25)
    clean = [reported(Specimen(base), t) for t in plan]
    top = max(float(np.abs(c).max()) for c in clean)
    noise = float(f"{top * np.exp(rng.uniform(np.log(0.004), np.log(0.012))):.3g}")
    sensor = chain(rng)
    level = noise * sensor.level
    setting = Setting(base, plan, level, top)
    fitted = plan[:-1]

    def size(specimen: Specimen) -> float:
        return beyond(energy, fitted, [reported(specimen, t) for t in fitted], level)

    added, sizes = [], {}
    low, high = (1.5, 30.0) if kind == "unknown" else (0.5, 30.0) if kind == "one" else (1.5, 25.0)
    for choice in picked:
        made, least, most = choice.ingredient(rng, setting)
        alone = Specimen(base, (made,))
        sign = (
            -1.0 if choice.name in ("aging", "energy-form") and choice.law == "linear" and rng.random() < 0.5 else 1.0
        )
        target = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        amount, sizes[made.name] = reach(
            lambda a, alone=alone, made=made, sign=sign: size(alone.scaled(made.name, sign * a)), target, least, most
        )
        if sizes[made.name] < NOTHING:
            raise NotConverged(f"{made.name}/{made.law} is a part of {energy}: there would be nothing to find")
        added.append(replace(made, amount=sign * amount))
    tolerated = []
    if kind in ("one", "two") and rng.random() < 0.15 and all(c.name != "energy-form" for c in picked):
        added.append(Ingredient("slightly-wrong", str(rng.choice(["c01", "c30"])), float(rng.uniform(0.01, 0.04))))
        tolerated = ["energy-form"]
    specimen = Specimen(base, tuple(added))
    truth = [reported(specimen, t) for t in plan]
    stress = {
        t.name: np.stack([sensor.read(rng, t.time, c, noise) for c in x.reshape(len(x), -1).T], -1).reshape(x.shape)
        for t, x in zip(plan, truth)
    }
    stated = float(f"{level * misstated(rng):.3g}")
    errors = {t.name: (stress[t.name] - x) / stated for t, x in zip(plan, truth)}  # as a diagnosis counts them
    key = {
        "category": kind,
        "effects": [c.name for c in picked],
        "plain": {c.name: c.plain for c in picked},
        "member": {c.name: c.member for c in picked},
        "ingredients": [{"name": i.name, "law": i.law, "amount": i.amount, **i.shape} for i in added],
        "tolerated": tolerated,
        "size_over_noise": sizes,
        "all_over_noise": size(specimen),
        "base": {"energy": energy, **base.terms},
        "noise": {"std": level, "stated": stated / level, "over": STEP, **asdict(sensor)},
        "truth_error_over_noise": {name: float(np.sqrt(np.mean(e**2))) for name, e in errors.items()},
        "held_out": plan[-1].name,
    }
    return Case(name, energy, plan, stress, stated, key)
