"""From effects to candidates: which parameters an effect frees, where its shapes are scanned, which bounds hold.

Most effects are one candidate. Some come in forms, from spare to rich (one relaxation time, two, three; one offset for
all recordings or one each), all under one name: a spare form is nominated, and where it stands it is tried with its
richer and its poorer neighbour, so that a law that differs from ours bends the effect's own form before another
effect is called to help.
"""

import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.effects.aging import Aging
from tissuejax.effects.anisotropy import Anisotropy
from tissuejax.effects.catalogue import effects
from tissuejax.effects.compressibility import Compressibility
from tissuejax.effects.drift import Drift
from tissuejax.effects.effect import Effect
from tissuejax.effects.energy_form import EnergyForm
from tissuejax.effects.machine_compliance import MachineCompliance
from tissuejax.effects.nonlinear_viscosity import NonlinearViscosity
from tissuejax.effects.periodic import Periodic
from tissuejax.effects.permanent_set import PermanentSet
from tissuejax.effects.platen_friction import PlatenFriction
from tissuejax.effects.slack import Slack
from tissuejax.effects.softening import Softening
from tissuejax.effects.viscoelasticity import Viscoelasticity
from tissuejax.model import Model
from tissuejax.parameters import Parameter

MOST = 24  # settings of one candidate's shapes at most
ENERGY_FORM = EnergyForm(terms=("C30", "C01", "C02", "exponential", "ogden"))
FIBRES = Anisotropy(families=2, crimped=True)
SPARE = {  # principal stretches cost as much as all the rest, a second family half as much again
    "energy-form": EnergyForm(terms=("C30", "C01", "C02", "exponential")),
    "anisotropy": Anisotropy(),
}
SEARCHED = ("machine-compliance", "nonlinear-viscosity", "compressibility")  # a search inside every prediction


@dataclass(frozen=True)
class Form:
    """Which parameters of an effect are free in one form of it.

    Attributes:
        name: of the form; "" for the only one.
        free: parameter names, amplitudes and shapes.
        grid: shapes to scan.
        nominated: False for forms that are only reached from a neighbour.
        each: parameters with a value of their own in every recording.
        reach: how many times beyond the values scanned (or the default) a positive shape may go.
        most: limits of exponents, which run away where the fitted recordings hardly reach them.
        beside: names of forms that it is tried beside, whatever the order.
    """

    name: str
    free: tuple[str, ...]
    grid: Mapping[str, tuple[float, ...]]
    nominated: bool = True
    each: tuple[str, ...] = ()
    reach: float = 10.0
    most: Mapping[str, float] = field(default_factory=dict)
    beside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Entry:
    """An effect with its forms, spare to rich, and the name under which it is reported.

    Attributes:
        spare: the effect without what makes every prediction a search, for sets that don't use that.
    """

    effect: Effect
    forms: tuple[Form, ...]
    title: str
    spare: Effect | None = None

    @property
    def searches(self) -> bool:
        """Whether it turns every prediction into a search."""
        return self.effect.name in SEARCHED or not self.effect.isotropic

    def declare(
        self, model: Model, fitted: tuple[str, ...], held_out: tuple[str, ...]
    ) -> tuple[dict[str, Free], dict[str, float], list[Candidate]]:
        """Free parameters, their neutral values, and the candidates, for these recordings."""
        prefix = f"effects.{self.effect.name}"
        known = {p.name: p for p in self.effect.parameters}
        free, start, candidates = {}, {}, []
        for form in self.forms:
            amplitudes, shapes, held, paths = [], [], [], {}
            for name in form.free:
                p, shape = known[name], name not in self.effect.amplitudes
                own = [f"{prefix}.{name}.{r}" for r in fitted] if name in form.each else [f"{prefix}.{name}"]
                paths[name] = own
                (shapes if shape else amplitudes).extend(own)
                if name in form.each:
                    held += [f"{prefix}.{name}.{r}" for r in held_out]
                for path in (*own, *(h for h in held if h.startswith(f"{prefix}.{name}."))):
                    f = limits(p, shape, form.grid.get(name, self.effect.grid.get(name, ())), form.reach)
                    if name in self.effect.misjudged:
                        f = replace(f, prior=(0.0, self.effect.misjudged[name]))
                    if name in form.most:
                        f = held_in(f, form.most[name])
                    elif path in free:  # what one form may reach all may
                        f = wider(f, free[path])
                    free[path] = f
                    start[path] = float(self.effect.neutral[name])
            candidates.append(
                Candidate(
                    self.title,
                    tuple(amplitudes),
                    tuple(shapes),
                    settings(form.grid, paths),
                    form=form.name,
                    held=tuple(held),
                    nominated=form.nominated,
                    rig=self.effect.order == 0,
                )
            )
        times = [p for p in free if p.startswith(f"{prefix}.tau") and p[-1].isdigit()]
        for path in times:  # which time is called the first means nothing
            free[path] = functools.reduce(wider, (free[p] for p in times), free[path])
        for i, c in enumerate(candidates):
            beside = [candidates[j].key for j in range(len(candidates)) if self.near(i, j)]
            candidates[i] = replace(c, beside=tuple(beside))
        return free, start, candidates

    def near(self, i: int, j: int) -> bool:
        """Whether forms i and j are tried beside each other: next in the order, or one freeing all the other frees."""
        one, other = self.forms[i], self.forms[j]
        a, b = set(one.free), set(other.free)
        linked = one.name in other.beside or other.name in one.beside
        return i != j and (abs(i - j) == 1 or a < b or b < a or linked)


def settings(grid: Mapping[str, tuple[float, ...]], paths: Mapping[str, list[str]]) -> tuple[dict[str, float], ...]:
    """Combinations of the values to scan, thinned to at most MOST."""
    combinations = list(itertools.product(*grid.values()))
    every = max(1, math.ceil(len(combinations) / MOST))
    return tuple(
        {path: float(v) for name, v in zip(grid, values) for path in paths[name]} for values in combinations[::every]
    ) or ({},)


def limits(p: Parameter, shape: bool, grid: tuple[float, ...], reach: float = 10.0) -> Free:
    """Range and scale of a parameter in a refit: declared bounds, and for shapes at most `reach` beyond the grid."""
    lower, upper = p.lower, p.upper
    log = shape and p.lower >= 0 and p.default > 0
    if log:
        known = [v for v in (*grid, p.default) if v > 0]
        lower, upper = max(lower, min(known) / reach), min(upper, max(known) * reach)
    return Free(lower, upper, p.typical, p.unit, log=log)


def wider(f: Free, other: Free) -> Free:
    """`f` with a range that holds that of the other too."""
    return replace(f, lower=min(f.lower, other.lower), upper=max(f.upper, other.upper))


def held_in(f: Free, most: float) -> Free:
    """`f` with a limit (both ways if it has a sign); a positive one drawn weakly, a factor of 5, to a tenth of it."""
    if not f.log:
        return replace(f, lower=-most, upper=most, limited=True)
    return replace(f, upper=most, lower=min(f.lower, 1e-3 * most), prior=(math.log(most / 10), SPREAD), limited=True)


SPREAD = math.log(5.0)
OFF_AXES = (0.4, 1.2, 2.0, 2.7)
TIMES = tuple(float(t) for t in np.geomspace(0.0025, 1.5, 7))  # of the longest recording: what it can show


@dataclass(frozen=True)
class Sizes:
    """What a sample's recordings are like, so that shapes are scanned where they can be seen.

    Attributes:
        energy: typical strain energy, Pa: damage scales are scanned around it.
        strain: largest |ln stretch|: exponents of exponential terms bend within it.
        force: largest force, N: a rig stiffens within it.
        session: time from the first recording to the last, s: drifts die out within it.
        recording: duration of one, s.
    """

    energy: float
    strain: float
    force: float
    session: float
    recording: float


def entries(sizes: Sizes) -> list[Entry]:
    """All effects that act in material tests, in their forms."""
    last = sizes.recording
    once = tuple(last * t for t in TIMES)
    pairs = {"tau1": tuple(last * t for t in (0.005, 0.015, 0.05)), "tau2": tuple(last * t for t in (0.1, 0.3, 1.0))}
    third = {"tau3": (0.025 * last, 1.5 * last, 0.0025 * last)}  # between the two that are there, slower, faster
    damage = {"m": tuple(sizes.energy * x for x in (0.02, 0.1, 0.4))}
    exponent = {"exponent": tuple(x / sizes.strain**2 for x in (0.3, 1.5))}
    steepest = {"exponent": 4 / sizes.strain**2}  # e^12 at the largest strain: I1bar - 3 is about 3 strain^2
    stretched = math.expm1(2 * sizes.strain)  # the largest squared stretch less 1
    fibres = 10 / stretched**2  # e^10 there
    mild = {"k2": (min(1.0, fibres / 10),)}  # steep fibres can't be told that they are crimped: nothing is left of them
    special = {
        "viscoelasticity": (
            Viscoelasticity(terms=3),
            (
                Form("one time", ("g1", "tau1"), {"tau1": once}),
                Form("two times", ("g1", "g2", "tau1", "tau2"), pairs),
                Form("two times of the moduli", ("g1", "g2", "tau1", "tau2", "moduli"), {**pairs, "moduli": (1.0,)}),
                Form("three times", ("g1", "g2", "g3", "tau1", "tau2", "tau3"), third, nominated=False),
                Form(
                    "three times of the moduli",
                    ("g1", "g2", "g3", "tau1", "tau2", "tau3", "moduli"),
                    {**third, "moduli": (1.0,)},
                    nominated=False,
                ),
                Form(
                    "two times of the nominal stress",
                    ("g1", "g2", "tau1", "tau2", "nominal"),
                    {**pairs, "nominal": (1.0,)},
                ),
                Form(
                    "three times of the nominal stress",
                    ("g1", "g2", "g3", "tau1", "tau2", "tau3", "nominal"),
                    {**third, "nominal": (1.0,)},
                    nominated=False,
                ),
            ),
        ),
        "softening": (
            Softening(loading=True),
            (
                Form("", ("r", "m"), damage),
                Form("with growth", ("r", "m", "beta"), {}, nominated=False),
                Form("with loading", ("r", "d", "m", "beta"), {}, nominated=False),
            ),
        ),
        "drift": (
            Drift(separate=True),
            (
                Form("offset", ("offset",), {}),
                Form("offset and rate", ("offset", "rate"), {}),
                Form("each recording", ("offset", "rate"), {}, each=("offset", "rate")),
                Form("dying", ("offset", "rate", "settling"), {"settling": (4 / sizes.recording,)}, nominated=False),
            ),
        ),
        "periodic": (
            Periodic(separate=True),
            (
                Form("", ("sin", "cos", "frequency"), {}, each=("sin", "cos")),
                Form(
                    "two harmonics",
                    ("sin", "cos", "sin2", "cos2", "frequency"),
                    {},
                    nominated=False,
                    each=("sin", "cos", "sin2", "cos2"),
                ),
            ),
        ),
        "permanent-set": (
            PermanentSet(),
            (
                Form("", ("amount",), {}),
                Form(
                    "with threshold",
                    ("amount", "threshold", "measure"),
                    {"threshold": (0.0, 0.2 * sizes.strain), "measure": (0.1,)},
                    nominated=False,
                ),
            ),
        ),
        "slack": (
            Slack(),
            (
                Form("", ("gap",), {}),
                Form("rounded", ("gap", "roundness"), {"roundness": (0.4, 1.0)}, nominated=False),
                Form("loaded before", ("preload",), {}),
            ),
        ),
        "machine-compliance": (
            MachineCompliance(),
            (
                Form("", ("compliance",), {}),
                Form("stiffening", ("compliance", "bend"), {"bend": (3 / sizes.force,)}, nominated=False),
            ),
        ),
        "anisotropy": (  # along an axis of the test an angle has no slope to leave it by
            FIBRES,
            (
                Form(
                    "in the xy plane",
                    ("k1", "k2", "angle"),
                    {"angle": tuple(0.15 + np.arange(4) * np.pi / 4), **mild},
                    most={"k2": fibres},
                ),
                Form(
                    "any direction",
                    ("k1", "k2", "angle", "elevation"),
                    {"elevation": (0.3, -0.8)},
                    nominated=False,
                    most={"k2": fibres},
                ),
                Form(
                    "two families",
                    ("k1", "k2", "angle", "spread"),
                    {"spread": (0.4,), "angle": OFF_AXES},  # one family may lie along an axis, and two alike about it
                    nominated=False,
                    most={"k2": fibres},
                ),
                Form(
                    "crimped",
                    ("k1", "k2", "angle", "onset"),
                    {"onset": (0.1 * stretched, 0.4 * stretched), **mild},
                    nominated=False,
                    most={"k2": fibres},
                ),
                Form(
                    "crimped, two families",
                    ("k1", "k2", "angle", "spread", "onset"),
                    {"onset": (0.05 * stretched,), "spread": (0.05, 0.4), **mild},
                    nominated=False,
                    most={"k2": fibres},
                ),
            ),
        ),
        "aging": (
            Aging(),
            (
                Form("", ("rate",), {}),
                Form("straight", ("rate", "straight"), {"straight": (1.0,)}, nominated=False),
                Form(
                    "settling",
                    ("rate", "settling"),
                    {"settling": (1 / sizes.session, -0.5 / sizes.session)},
                    nominated=False,
                ),
            ),
        ),
        "compressibility": (
            Compressibility(),
            (
                Form("", ("immediate", "drained", "time"), dict(Compressibility.grid)),
                Form(
                    "another volumetric law",
                    ("immediate", "drained", "time", "power"),
                    {"power": (1.0,)},
                    nominated=False,
                ),
            ),
        ),
        "platen-friction": (
            PlatenFriction(),
            (
                Form("", ("friction",), {}),
                Form("another aspect", ("friction", "flattening"), {"flattening": (0.0,)}, nominated=False),
            ),
        ),
        "energy-form": (
            ENERGY_FORM,
            (
                Form("cubic", ("C30",), {}),
                Form("second invariant", ("C01",), {}),
                Form("exponential", ("exponential", "exponent"), exponent, most=steepest),
                Form("cubic and second invariant", ("C30", "C01"), {}, nominated=False),
                Form("all", ("C30", "C01", "C02", "exponential", "exponent"), {}, nominated=False, most=steepest),
                Form(
                    "stretch power",
                    ("ogden", "power"),
                    {"power": (-8.0, 10.0)},
                    nominated=False,
                    most={"power": 8 / sizes.strain},
                    beside=("cubic", "second invariant", "exponential"),
                ),
            ),
        ),
    }
    out = []
    for name, kind in effects("homogeneous").items():
        if name == "nonlinear-viscosity":
            grid = {"tau": (1.0, 10.0), "stress": (1.0,), "exponent": (3.0,)}
            form = Form("load-dependent", ("g", "tau", "stress", "exponent"), grid, nominated=False)
            out.append(Entry(NonlinearViscosity(), (form,), "viscoelasticity"))
        elif name in special:
            effect, forms = special[name]
            out.append(Entry(effect, forms, name, SPARE.get(name)))
        else:
            effect = kind()
            free = tuple(p.name for p in effect.parameters if not p.frozen)
            each = tuple(p.name for p in effect.parameters if p.each)
            out.append(Entry(effect, (Form("", free, dict(effect.grid), each=each),), name))
    return out
