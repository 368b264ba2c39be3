"""A search whose sets come to what a table says, for tests of its course."""

import math
from types import SimpleNamespace

import numpy as np

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.score import Score

FORMS = {"hum": ["hum"], "gap": ["gap", "gap/late", "gap/twice"], "drift": ["drift"], "wide": ["law"]}
NAMES = {form: name for name, forms in FORMS.items() for form in forms}


def candidate(form: str) -> SimpleNamespace:
    return SimpleNamespace(
        key=form,
        name=NAMES[form],
        widens={"law": 0.1} if form == "law" else {},
        amplitudes=() if form == "law" else (f"{form}.size",),
        shapes=(),
        nominated=form in ("hum", "gap", "drift", "law"),
        grid=[{f"{form}.edge": float(k)} for k in range(5)],
        beside={"gap": ("gap/late",), "gap/late": ("gap", "gap/twice"), "gap/twice": ("gap/late",)}.get(form, ()),
    )


def weighed(keys: tuple[str, ...], worth: float, void: bool = False, **values: float) -> SimpleNamespace:
    evidence = SimpleNamespace(keys=keys, names=keys, void=void, log_evidence=worth, amplitudes={})
    fit = SimpleNamespace(values=values, prediction=np.zeros(1))
    return SimpleNamespace(
        evidence=evidence, v=np.array([1e-6]), bench=f"bench of {keys}", refit=fit, idle=(), settled=True, begun={}
    )


class Known(Kept):
    """Weighing comes to what a table says, and to -1000 nats where it says nothing."""

    def __init__(self, table: dict[tuple[str, ...], float]):
        super().__init__()
        self.table, self.asked, self.courses = {frozenset(k): x for k, x in table.items()}, [], []

    def weigh(self, scales, keys, start, criteria, course):
        self.courses.append(course)
        self.asked.append((tuple(keys), dict(start.values), start.v, start.bench))
        return weighed(tuple(keys), self.table.get(frozenset(keys), -1000.0), **start.values)

    @property
    def order(self) -> list[frozenset]:
        return list(dict.fromkeys(frozenset(keys) for keys, *_ in self.asked))


def score(form: str, gain: float, settings: int = 1) -> Score:
    trials = tuple((gain - k, {f"{form}.size": 2.0}, {f"{form}.edge": float(k)}) for k in range(settings))
    return Score(form, gain, 0.5, {}, {}, np.zeros(0), trials)


def explored(table, scored=None, costly=False, nested=lambda keys: 0, **effort) -> Exploration:
    """A search that has weighed the base alone, at -100 nats."""
    free = {f"{f}.size": SimpleNamespace(lower=-math.inf, upper=math.inf, scale=1.0) for f in NAMES}
    bench = SimpleNamespace(
        candidates={f: candidate(f) for f in NAMES},
        costly=costly,
        spent=0.0,
        start={f"{f}.size": 0.0 for f in NAMES},
        free=free,
        base=("mu",),
        nested=nested,
    )
    scales = Scales(bench, None, ("slow",), None, None, {}, np.zeros(1), 1.0)
    base = weighed((), -100.0, mu=1.0)
    e = Exploration(bench, Criteria(), Effort(**effort), scales, weighed={frozenset(): base}, kept=Known(table))
    e.__dict__["before"] = SimpleNamespace(log_prior=lambda evidence: 0.0)
    e.scored |= {frozenset(k): rows for k, rows in (scored or {}).items()}
    return e


def sets(*keys: str) -> list[frozenset]:
    return [frozenset(k.split("+")) for k in keys]
