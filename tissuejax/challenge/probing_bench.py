"""One probing recording: what moves, the equilibrium along the way, and what sensors and clocks make of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tissuejax.challenge.lobe import Lobe, graded
from tissuejax.challenge.material import Ingredient
from tissuejax.challenge.probe_paths import Path, between, gap, stops
from tissuejax.challenge.quasistatic import Bed, Bench
from tissuejax.challenge.solid import Solid, Tissue
from tissuejax.challenge.touch import Membrane, Sphere

# Hexes along each direction, and their spacing under a large and a small probe over that far away. Of a press this
# leaves an error of 0.4 % of the force (1 % where shallow) and 4 um of the markers (`fits/challenge/mesh.py`). 16 x 16
# x 6 graded to a seventh, with which the sets up to probing-fourth were made, left 2 %, and of one marker a fifth of
# what it moves.
MESH = (24, 24, 8)
FINE, FINER, SMALL = 0.25, 0.18, 0.007
REACH = 0.3
STRIDE = 1e-3  # the force between stops is right to a fifth of its noise
SENSED = {  # no new solve
    "drift", "clock-lag", "aging", "machine-compliance", "cured", "torn", "shock", "rolls", "marker-jump"
}  # fmt: skip
JUMP = 0.2  # s in which a tracker slides to another marker
FORCE_RATE, MARKER_RATE, PROBE_RATE = 62.5, 15.0, 100.0


@dataclass(frozen=True)
class Record:
    """One probing recording, in the units of the file.

    Attributes:
        name: group name.
        start: s after the first recording.
        radius: of the tip, m.
        time, probe: of the tip's centre as recorded, s and m.
        force_time, force: on the probe, s and N.
        marker_time, markers: s and m.
    """

    name: str
    start: float
    radius: float
    time: Float[np.ndarray, " n"]
    probe: Float[np.ndarray, "n 3"]
    force_time: Float[np.ndarray, " f"]
    force: Float[np.ndarray, "f 3"]
    marker_time: Float[np.ndarray, " m"]
    markers: Float[np.ndarray, "m k 3"]


@dataclass(frozen=True)
class Setup:
    """What all recordings of a case share.

    Attributes:
        sites: place under the probe in each recording, m.
        radius: of the tip, m.
        places: surface parameters of the markers.
        mesh: hexes along each direction.
    """

    lobe: Lobe
    tissue: Tissue
    sites: list[tuple[float, float]]
    radius: float
    places: list[tuple[float, float]]
    mesh: tuple[int, int, int] = MESH


@dataclass(frozen=True)
class Visit:
    """One recording to be made.

    Attributes:
        number: of the recording, from 0.
        path: of the probe.
        clock: start of this recording and of the last one, s.
        phase: of a moving support in this recording.
    """

    number: int
    path: Path
    clock: tuple[float, float]
    phase: float = 0.0


def record(setup: Setup, visit: Visit, ingredients: list[Ingredient], solved: dict | None = None) -> Record:
    """Solve one recording without noise.

    Args:
        solved: what was solved before for the same paths: effects that only sensors feel find it there.
    """
    lobe, radius, places, path, clock = setup.lobe, setup.radius, setup.places, visit.path, visit.clock
    have = {i.name: i for i in ingredients}
    support = supported(have, path, visit.phase)
    offset = np.zeros(3)
    if "registration" in have:
        offset[:2] = have["registration"].amount * np.array(have["registration"].shape["way"])
    if "contact-offset" in have:
        offset[2] = have["contact-offset"].amount * have["contact-offset"].shape["signs"][visit.number]

    def motion(t: np.ndarray) -> np.ndarray:
        return path.at(t) + offset - support(t)

    history = bool(set(have) & {"viscoelasticity"}) or "periodic" in have
    every = 0.12 if "periodic" in have else 0.8 if history else None
    at, pieces = stops(path, motion, lobe, radius, 0.7 * STRIDE if history else STRIDE, every)
    solved = {} if solved is None else solved
    same = visit.number, tuple((i.name, i.amount) for i in ingredients if i.name not in SENSED)
    if same not in solved:
        where = motion(at)
        close = gap(lobe, where, radius) < (1e-3 if "adhesion" in have else 1e-4)
        force, moved = np.zeros((len(at), 3)), np.zeros((len(at), len(places), 3))
        if close.any():
            bench, watch = assembled(setup, visit, have, motion(path.time))
            force[close], moved[close] = bench.follow(at[close], where[close], watch)
        solved[same] = force, moved
    force, moved = solved[same]
    rest = lobe.point(*np.array(places).T, np.ones(len(places)))
    end = path.time[-1]
    time, ft, mt = (np.arange(a / r, end, 1 / r) for a, r in ((0, PROBE_RATE), (0.25, FORCE_RATE), (0.3, MARKER_RATE)))
    lag = have["clock-lag"].amount if "clock-lag" in have else 0.0
    seen = np.clip(mt - lag, 0, end)
    shown = rest + between(pieces, at, moved, seen) + support(seen)[:, None]
    if "marker-jump" in have:
        shown = slid(have["marker-jump"], visit, rest, mt, shown)
    felt = sensed(have, visit, between(pieces, at, force, ft), ft)
    probe = path.at(time)
    if "machine-compliance" in have:  # the tip went where it went; the actuator had to go further by c F
        probe = probe - have["machine-compliance"].amount * between(pieces, at, force, time)
    return Record(f"r{visit.number + 1}", float(clock[0]), radius, time, probe, ft, felt, mt, shown)


def supported(have: dict[str, Ingredient], path: Path, phase: float) -> Callable[[np.ndarray], np.ndarray]:
    """Motion of the support over time, m."""

    def support(t: np.ndarray) -> np.ndarray:
        shift = np.zeros((len(t), 3))
        if "periodic" in have:
            i = have["periodic"]
            angle = 2 * np.pi * t / i.shape["period"] + phase
            wave = np.sin(angle) + i.shape["second"] * np.sin(2 * angle + 1.9)
            shift += i.amount * wave[:, None] * np.array([-0.08, 0.06, 1.0])
        if "tissue-slip" in have:
            i = have["tissue-slip"]
            when = i.shape["where"] * path.time[-1]
            shift += i.amount / (1 + np.exp(-(t - when) / 0.02))[:, None] * np.array(i.shape["way"])
        return shift

    return support


def assembled(
    setup: Setup, visit: Visit, have: dict[str, Ingredient], way: Float[np.ndarray, "c 3"]
) -> tuple[Bench, Callable]:
    """The bench of one recording and the function that reads the markers' displacements.

    Args:
        way: corners of the tip's path relative to the body, m.
    """
    lobe, tissue, radius, sites = setup.lobe, setup.tissue, setup.radius, setup.sites
    if "viscoelasticity" in have:
        i = have["viscoelasticity"]
        split = i.shape["split"]
        tissue = replace(tissue, g=(i.amount * split, i.amount * (1 - split)), tau=tuple(i.shape["tau"]))
    if "softening" in have:
        tissue = replace(tissue, damage=have["softening"].amount, damage_energy=have["softening"].shape["energy"])
    if "energy-form" in have:
        tissue = replace(tissue, C30=have["energy-form"].amount)
    if "anisotropy" in have:
        tissue = replace(tissue, fibre=have["anisotropy"].amount, along=tuple(have["anisotropy"].shape["along"]))
    grid = graded(
        lobe, lobe.parameters(*sites[visit.number]), *setup.mesh, fine=FINE if radius > SMALL else FINER, reach=REACH
    )
    solid = Solid(grid, tissue)
    if "inclusion" in have:
        i = have["inclusion"]
        x, y = np.array(sites[i.shape["under"]]) + np.array(i.shape["aside"])
        top = float(lobe.height(*map(np.asarray, lobe.parameters(x, y))))
        far = np.linalg.norm((solid.places - [x, y, top - i.shape["depth"]]) / i.shape["axes"], axis=-1)
        solid = Solid(grid, tissue, i.amount ** (1 / (1 + np.exp(np.clip((far - 1) / 0.06, -60, 60)))))
    middle = grid.points[grid.top].mean(1)
    reach = radius + 7e-3
    near = np.min(np.linalg.norm(middle[:, None, :2] - way[None, :, :2], axis=-1), axis=1) < reach
    sphere = Sphere(grid, grid.top[near], radius)
    if "friction" in have:
        sphere.friction = have["friction"].amount
    if "adhesion" in have:
        sphere.pull, sphere.range = have["adhesion"].amount, have["adhesion"].shape["range"]
    bed = Bed(have["base-slip"].amount) if "base-slip" in have else Bed()
    skin = Membrane(grid, have["capsule"].amount) if "capsule" in have else None
    weights = [grid.on_top(*p) for p in setup.places]

    def watch(u: np.ndarray) -> np.ndarray:
        return np.array([w @ u[nodes] for nodes, w in weights])

    return Bench(solid, sphere, bed, skin), watch


def slid(i: Ingredient, visit: Visit, rest: np.ndarray, t: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Markers as shown by a tracker that slides a share of the way to the nearest neighbour of one of them, m."""
    if visit.number != i.shape["number"]:
        return shown
    one = int(i.shape["which"] * len(rest))
    away = np.linalg.norm(rest - rest[one], axis=-1)
    other = int(np.argsort(away)[1])
    gone = np.clip((t - i.shape["where"] * visit.path.time[-1]) / JUMP, 0, 1)
    shown = shown.copy()
    shown[:, one] += i.amount * gone[:, None] * (rest[other] - rest[one])
    return shown


def turned(i: Ingredient, F: Float[np.ndarray, "f 3"]) -> Float[np.ndarray, "f 3"]:
    """Force in the axes of a tip that rolls about a level axis by an angle that grows with the load (Rodrigues)."""
    k = np.array([*i.shape["axis"], 0.0])
    size = np.linalg.norm(F, axis=1)
    angle = (i.amount * size / max(size.max(), 1e-12))[:, None]
    return F * np.cos(angle) + np.cross(k, F) * np.sin(angle) + (F @ k)[:, None] * k * (1 - np.cos(angle))


def sensed(have: dict[str, Ingredient], visit: Visit, F: Float[np.ndarray, "f 3"], t: np.ndarray) -> np.ndarray:
    """Force as the sensor reports it, N."""
    path, clock = visit.path, visit.clock
    end = path.time[-1]
    if "torn" in have:
        i = have["torn"]
        torn = (visit.number > i.shape["number"]) | (
            (visit.number == i.shape["number"]) & (t >= i.shape["where"] * end)
        )
        F = F * (1 - i.amount * torn)[:, None]
    if "aging" in have:
        F = F * np.exp(have["aging"].amount * (clock[0] + t) / clock[1])[:, None]
    if "cured" in have:
        still = np.flatnonzero(
            (np.abs(np.diff(path.place[:, 2])) < 1e-9) & (path.place[1:, 2] < path.place[0, 2] - 2e-3)
        )
        since = np.maximum(t - path.time[still[0]], 0)
        F = F * (1 - have["cured"].amount * np.expm1(-since / have["cured"].shape["time"]))[:, None]
    if "rolls" in have:
        F = turned(have["rolls"], F)
    if "shock" in have and have["shock"].shape["number"] == visit.number:
        i = have["shock"]
        since = np.maximum(t - i.shape["where"] * end, 0) / i.shape["time"]
        F = F + (i.amount * since * np.exp(1 - since))[:, None] * np.array([0.2, -0.1, 1.0])
    if "drift" in have:
        i = have["drift"]
        zero = i.amount * (i.shape["mix"][0] + i.shape["mix"][1] * t / 10)
        F = F + zero[:, None] * np.array([0.2, -0.1, 1.0])
    return F
