"""From effects to candidates: which parameters an effect frees, where its shapes are scanned, which bounds hold.

What is offered, and in which forms, every effect says itself (`effects.form`).
"""

import functools
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from tissuejax.diagnosis.bench import Candidate, Free
from tissuejax.effects.catalogue import effects
from tissuejax.effects.form import Form, Offer, Sizes
from tissuejax.model import Model
from tissuejax.parameters import Parameter

MOST = 24  # settings of one candidate's shapes at most
SPREAD = math.log(5.0)  # standard deviation of the logarithm of what has a limit


@dataclass(frozen=True)
class Entry(Offer):
    """What an effect offers, under the name by which it is reported, to be declared to a bench."""

    @classmethod
    def of(cls, offer: Offer) -> "Entry":
        """Of what an effect offers."""
        return cls(**{**vars(offer), "title": offer.title or offer.effect.name})

    @property
    def searches(self) -> bool:
        """Whether it turns every prediction into a search."""
        return self.effect.searches or not self.effect.isotropic

    def declare(
        self, model: Model, fitted: tuple[str, ...], held_out: tuple[str, ...]
    ) -> tuple[dict[str, Free], dict[str, float], list[Candidate]]:
        """Free parameters, their neutral values, and the candidates, for these recordings."""
        prefix = f"effects.{self.effect.name}"
        known = {p.name: p for p in self.effect.parameters}
        free, start, candidates = {}, {}, []
        for form in self.forms:
            amplitudes, shapes, held, paths, grid = [], [], [], {}, self.scanned_in(form)
            for name in form.free:
                p, shape = known[name], name not in self.effect.amplitudes
                own = [f"{prefix}.{name}.{r}" for r in fitted] if name in form.each else [f"{prefix}.{name}"]
                paths[name] = own
                (shapes if shape else amplitudes).extend(own)
                if name in form.each:
                    held += [f"{prefix}.{name}.{r}" for r in held_out]
                for path in (*own, *(h for h in held if h.startswith(f"{prefix}.{name}."))):
                    f = limits(p, shape, grid.get(name, self.effect.grid.get(name, ())), form.reach)
                    if name in self.effect.shares:
                        f = replace(f, whole=prefix)
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
                    settings(grid, paths),
                    form=form.name,
                    held=tuple(held),
                    nominated=form.nominated,
                    rig=self.effect.order == 0,
                    spectral=form.spectral and (f"{prefix}.{form.spectral[0]}", form.spectral[1]),
                    corners={f"{prefix}.{name}": sizes for name, sizes in form.corners.items()},
                    placed=form.placed,
                    heard=form.heard,
                    brief=self.effect.brief,
                    widens=dict(form.widens),
                    lacking=dict(form.lacking),
                )
            )
        times = [p for p in free if p.startswith(f"{prefix}.tau") and p[-1].isdigit()]
        for path in times:  # which time is called the first means nothing
            free[path] = functools.reduce(wider, (free[p] for p in times), free[path])
        for path, f in free.items():
            name = path.split(".")[2]
            lower, upper, start[path] = self.ranges.get(name, (f.lower, f.upper, start[path]))
            scale, prior = self.scales.get(name, f.scale), self.priors.get(name, f.prior)
            if name in self.effect.times:
                lower, start[path] = max(lower, self.quickest), max(start[path], self.quickest)
            free[path] = replace(f, lower=lower, upper=upper, scale=scale, prior=prior)
        for i, c in enumerate(candidates):
            beside = [candidates[j].key for j in range(len(candidates)) if self.near(i, j)]
            candidates[i] = replace(c, beside=tuple(beside))
        return free, start, candidates

    def scanned_in(self, form: Form) -> dict[str, tuple[float, ...]]:
        """Values of a form's shapes that are scanned, no time among them that is quicker than what is seen here."""
        seen = {n: tuple(dict.fromkeys(max(v, self.quickest) for v in form.grid.get(n, ()))) for n in self.effect.times}
        return {name: seen.get(name, values) for name, values in form.grid.items()}

    def near(self, i: int, j: int) -> bool:
        """Whether forms i and j are tried beside each other: next in the order, or one freeing all the other frees.

        A form that widens the discrepancy is weighed in any case, and is nobody's neighbour.
        """
        one, other = self.forms[i], self.forms[j]
        if one.widens or other.widens:
            return False
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


def entries(sizes: Sizes) -> list[Entry]:
    """All effects that act in material tests, in their forms."""
    return [Entry.of(kind.in_material_tests(sizes)) for kind in effects("homogeneous").values()]


def linked(found: Iterable[Entry], candidates: Mapping[str, Candidate]) -> dict[str, Candidate]:
    """The candidates, those that two effects have under one name beside each other where a form says so."""
    keys = {(c.name, c.form): k for k, c in candidates.items()}
    near: dict[str, list[str]] = {}
    for entry in found:
        for form in entry.forms:
            one = keys.get((entry.title, form.name))
            for other in (keys.get((entry.title, name)) for name in form.beside):
                if one and other:
                    near.setdefault(one, []).append(other)
                    near.setdefault(other, []).append(one)
    more = {k: (*candidates[k].beside, *beside) for k, beside in near.items()}
    return candidates | {k: replace(candidates[k], beside=tuple(dict.fromkeys(b))) for k, b in more.items()}
