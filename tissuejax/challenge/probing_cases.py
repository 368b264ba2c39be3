"""Draws and solves whole probing cases: lobe, tissue, three recordings, effects, noise, and the file."""

from dataclasses import dataclass, replace
from pathlib import Path as File

import h5py
import numpy as np
from threadpoolctl import threadpool_limits

from tissuejax.challenge.lobe import Lobe, uniform
from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probe_paths import draw as draw_path
from tissuejax.challenge.probing_aims import COARSE, Aim, aim
from tissuejax.challenge.probing_bench import MESH, Record, Setup, Visit, record
from tissuejax.challenge.probing_menu import CATALOGUED, LOUD, STRAY, Course
from tissuejax.challenge.probing_rest import beside
from tissuejax.challenge.probing_sizes import by_channel, parts, where
from tissuejax.challenge.rest_cases import category as rest_category
from tissuejax.challenge.sensor_noise import correlated
from tissuejax.challenge.solid import Tissue
from tissuejax.errors import NotConverged
from tissuejax.storage import replacing

CATEGORIES = ("none", "one", "two", "unknown")
SHARES = (0.17, 0.53, 0.15, 0.15)
SITES = ((-9.5e-3, -2e-3), (7.5e-3, -7e-3), (4e-3, 8e-3))


@dataclass(frozen=True)
class Probing:
    """A made case: what the file holds, and its key."""

    name: str
    energy: str
    lobe: Lobe
    records: list[Record]
    noise: tuple[float, float]
    key: dict


def category(index: int) -> str:
    """Category of the case with this number; fixed shares spread evenly."""
    grid = (index * 0.6180339887498949) % 1.0
    return CATEGORIES[int(np.searchsorted(np.cumsum(SHARES), grid, side="right"))]


ATTEMPTS = 10
STRONG, LOUDEST = 3, 8  # draws of which a strong case takes the strongest, and a pair that should be seen


def strong_category(index: int) -> tuple[str, int]:
    """Of a challenge of strong effects alone: two singles in turn, then a pair; category and turn."""
    block, place = divmod(index, 3)
    return ("one", 2 * block + place) if place < 2 else ("two", 5 * block)


def courses(rng: np.random.Generator, kind: str, turn: int, menu: tuple[Course, ...] = CATALOGUED) -> list[Course]:
    """Effects of a case; single ones take their turn."""
    if kind in ("none", "rest"):
        return []
    if kind == "unknown":
        return [STRAY[turn % len(STRAY)]]
    first = menu[turn % len(menu)]
    if kind == "one":
        return [first]
    alike = {"friction": ("adhesion",), "contact-offset": ("machine-compliance",), "base-slip": ("capsule",)}
    others = [
        c
        for c in menu
        if c.name != first.name and c.name not in alike.get(first.name, ()) and not (first.history and c.history)
    ]
    return [first, others[int(rng.integers(len(others)))]]


def body(rng: np.random.Generator) -> Lobe:
    """A smooth lobe of about 62 x 54 x 20 mm."""
    bumps = tuple(
        (
            float(rng.uniform(-0.6, 0.6)),
            float(rng.uniform(-0.6, 0.6)),
            float(rng.uniform(0.25, 0.5)),
            float(rng.uniform(-6e-4, 8e-4)),
        )
        for _ in range(int(rng.integers(0, 3)))
    )
    return Lobe(
        a=float(rng.uniform(0.029, 0.034)),
        b=float(rng.uniform(0.026, 0.029)),
        c=float(rng.uniform(0.07, 0.11)),
        H=float(rng.uniform(0.0185, 0.0212)),
        rim=float(rng.uniform(0.46, 0.6)),
        p=float(rng.uniform(0.75, 1.05)),
        tilt=(float(rng.uniform(-0.03, 0.03)), float(rng.uniform(-0.03, 0.03))),
        bumps=bumps,
    )


def draw(
    name: str,
    seed: int,
    index: int,
    kind: str | None = None,
    turn: int | None = None,
    mesh: tuple[int, int, int] = MESH,
    strong: bool = False,
    pairs: bool = False,
    rest: bool = False,
    aimed: bool = False,
) -> Probing:
    """The case with this seed and number (minutes of one core); redrawn if a body finds no equilibrium.

    Args:
        rest: one or two effects beside a rest in the force that no catalogue has, or the rest alone.
        aimed: effects at sizes where it is open whether they can be told (`probing_aims`), which take turns.
    """
    menu, draws = (LOUD, LOUDEST) if pairs else (CATALOGUED, STRONG if strong or rest else 1)
    if strong:
        kind, turn = strong_category(index)
    if pairs:
        kind, turn = "two", index
    if rest:
        kind = rest_category(index)
    goal = aim(index) if aimed else None
    if goal:
        kind = {1: "one", 2: "two"}[len(goal.effects)]
    with threadpool_limits(1):
        for attempt in range(ATTEMPTS):
            rng = np.random.default_rng([seed, index, attempt, 2])
            try:
                kind, turn = kind or category(index), index if turn is None else turn
                return _draw(name, rng, kind, turn, mesh, menu, draws, rest, goal)
            except NotConverged:
                continue
    raise NotConverged(f"probing case {name}: no equilibrium in {ATTEMPTS} draws; choose another seed")


def _draw(
    name: str,
    rng: np.random.Generator,
    kind: str,
    turn: int,
    mesh: tuple[int, int, int],
    menu: tuple[Course, ...],
    draws: int,
    rest: bool = False,
    goal: Aim | None = None,
) -> Probing:
    lobe = body(rng)
    C10 = float(np.exp(rng.uniform(np.log(400), np.log(1000))))
    tissue = Tissue(C10, C10 * float(rng.uniform(0.3, 1.1)), float(np.exp(rng.uniform(np.log(1.8e4), np.log(4.2e4)))))
    radius = float(rng.choice([0.0095, 0.0095, 0.0095, 0.00625]))
    added = [c.ingredient(rng, C10, draws) for c in (goal.courses if goal else courses(rng, kind, turn, menu))]
    sites = [(x + rng.uniform(-1.5e-3, 1.5e-3), y + rng.uniform(-1.5e-3, 1.5e-3)) for x, y in rng.permutation(SITES)]
    styles = [str(s) for s in rng.permutation(["side", "twice", "once"])]
    if rng.random() < 0.3:
        styles[2] = "oblique"
    paths = [draw_path(rng, lobe, s, radius, style) for s, style in zip(sites, styles)]
    places = markers(rng, lobe, sites, int(rng.choice([8, 10, 11, 11, 12])))
    starts = np.cumsum([0.0, *rng.uniform(150, 500, 2)])
    phases = rng.uniform(0, 2 * np.pi, 3)
    noise = (0.003, float(np.round(rng.uniform(50e-6, 85e-6), 6)))
    rho = float(rng.uniform(0.4, 0.85)) if rng.random() < 0.3 else 0.0

    setup, solved = Setup(lobe, tissue, sites, radius, places, mesh), {}
    visits = [Visit(i, paths[i], (float(starts[i]), float(starts[-1])), float(phases[i])) for i in range(3)]

    def recorded(ingredients: list[Ingredient], count: int = 3) -> list[Record]:
        return [record(setup, visit, ingredients, solved) for visit in visits[:count]]

    if goal:
        added = aimed_at(rng, goal, added, replace(setup, mesh=COARSE), visits[:2], noise)
        goal.check({i.name: parts(recorded([], 2), recorded([i], 2), noise) for i in added})
    clean = recorded(added)
    sizes, more = {}, {}
    if added:
        bare = recorded([], 2)
        more, each = {"where": where(by_channel(bare, clean[:2], noise))}, {}
        for one in added:
            alone = clean[:2] if len(added) == 1 else recorded([one], 2)
            each[one.name] = parts(bare, alone, noise)
        sizes = {name: max(pair) for name, pair in each.items()}
        if goal:
            more |= {"aim": goal.name, "sizes_of_force_and_markers": each}
    if rest:
        found = beside(rng, clean, recorded([]) if added else clean, list(sizes.values()), noise)
        clean, more = found.presses, found.key
    noisy, errors = [], {}
    for r in clean:
        e = np.stack([correlated(rng, r.force_time, rho) for _ in range(3)], -1)
        m = rng.standard_normal(r.markers.shape)
        lost = rng.random(r.markers.shape[:2]) < 0.025
        shown = np.where(lost[..., None], np.nan, r.markers + noise[1] * m)
        path = r.probe + 5e-6 * rng.standard_normal(r.probe.shape)
        noisy.append(replace(r, force=r.force + noise[0] * e, markers=shown, probe=path))
        kept = m[~lost]
        errors[r.name] = {"force": float(np.sqrt(np.mean(e**2))), "markers": float(np.sqrt(np.mean(kept**2)))}
    key = {
        "category": kind,
        "effects": [i.name for i in added],
        "plain": {i.name: True for i in added},
        "ingredients": [{"name": i.name, "amount": i.amount, **i.shape} for i in added],
        "tolerated": [],
        "size_over_noise": sizes,
        "base": {"energy": "reduced-polynomial-2", "C10": tissue.C10, "C20": tissue.C20, "K": tissue.K},
        "sites": [list(map(float, s)) for s in sites],
        "phases": phases.tolist(),
        "noise": {"force": noise[0], "markers": noise[1], "correlation": rho},
        "truth_error_over_noise": errors,
        "peak_force": {r.name: float(np.abs(r.force).max()) for r in clean},
        "held_out": clean[-1].name,
        "mesh": list(mesh),
    } | more
    return Probing(name, "reduced-polynomial-2", lobe, noisy, noise, key)


def aimed_at(
    rng: np.random.Generator,
    goal: Aim,
    drawn: list[Ingredient],
    setup: Setup,
    visits: list[Visit],
    noise: tuple[float, float],
) -> list[Ingredient]:
    """The drawn effects, each at the amount that its aim asks of it alone, as found on the mesh of `setup`."""
    solved: dict = {}
    bare = [record(setup, v, [], solved) for v in visits]

    def sizes(one: Ingredient) -> tuple[float, float]:
        return parts(bare, [record(setup, v, [one], solved) for v in visits], noise)

    return [goal.sized(rng, one, setup.tissue.C10, sizes) for one in drawn]


def markers(rng: np.random.Generator, lobe: Lobe, sites: list, count: int) -> list[tuple[float, float]]:
    """Parameters of surface markers, away from where the probe touches and from each other."""
    found: list[tuple[float, float]] = []
    for _ in range(5000):
        xi, eta = rng.uniform(-0.85, 0.85, 2)
        here = lobe.point(xi, eta, 1.0)[:2]
        apart = all(np.linalg.norm(here - lobe.point(*f, 1.0)[:2]) > 5e-3 for f in found)
        if apart and all(np.linalg.norm(here - np.array(s)) > 9e-3 for s in sites):
            found.append((float(xi), float(eta)))
        if len(found) == count:
            break
    return found


def write(case: Probing, path: File) -> None:
    """The case as a bench would have recorded it: uniform mesh of the body, probe, force, markers."""
    mesh = uniform(case.lobe)
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update({"format": "tissue-recording", "version": 1, "sample": case.name, "density": 1060.0})
        file["geometry/points"], file["geometry/cells"], file["geometry/fixed"] = mesh.points, mesh.cells, mesh.base
        file["geometry/cells"].attrs["cell_type"] = "hexahedron"
        for r in case.records:
            group = file.create_group(f"recordings/{r.name}")
            group.attrs["experiment"], group.attrs["start"] = "probing", r.start
            group["probe/time"], group["probe/position"] = r.time, r.probe
            group["probe"].attrs["radius"] = r.radius
            group["force/time"], group["force/value"] = r.force_time, r.force
            group["force"].attrs["noise_std"] = case.noise[0]
            group["markers/time"], group["markers/position"] = r.marker_time, r.markers
            group["markers"].attrs["noise_std"] = case.noise[1]
