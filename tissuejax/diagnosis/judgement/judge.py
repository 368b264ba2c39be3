"""From evidence to a verdict, by the rules of probability alone: the same evidence, the same answer, in milliseconds.

The posterior of a set is its prior times its evidence, to a power (`Criteria.coarse`), over the sum of all that were
weighed (what was never tried has none, and that is said). Effects are named that are likelier present than not. The
five answers divide what may be true:

- nothing-missing: no effect of the catalogue, and a rest that is negligible;
- unexplained: no effect of the catalogue, and a rest that is not negligible;
- found: exactly the effects named, and a negligible rest;
- found-in-part: the effects named, and more: a rest of note, or further effects;
- ambiguous: effects of the catalogue, but not those named.

Their probabilities add up to one and the most probable is given.

Where every prediction is a simulation and sets are searched with few of them, evidence may be about nothing: the search
missed, or the simulation errs as no part of the discrepancy does. With probability `Criteria.lapse` it says nothing,
and what was held for probable beforehand stands: a mixture, no surer than such evidence can be.
"""

import enum
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp, ndtr

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence, SetEvidence


class Kind(enum.StrEnum):
    """The five answers."""

    NOTHING = "nothing-missing"
    FOUND = "found"
    IN_PART = "found-in-part"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"

    @property
    def speaks(self) -> bool:
        """Whether effects stand in the answer: named, or offered as alternatives."""
        return self in (Kind.FOUND, Kind.IN_PART, Kind.AMBIGUOUS)


@dataclass(frozen=True)
class Judgement:
    """The answer and all probabilities behind it.

    Attributes:
        kind: the most probable answer; probabilities: of all five.
        names: effects named (likelier present than not); none unless the answer is found or found-in-part.
        inclusion: by effect, the probability that it is present.
        missing: probability that something is missing at all.
        exact: probability that exactly the effects named are present.
        chosen: the set whose fit is shown: of the answer, or the best attempt.
        alternatives: named sets beside the chosen one, with their probabilities, most probable first.
        posterior: by set of names ("" for none) of those that were weighed, its probability; sets that were never
            tried have what is wanting to one.
        negligible: probability that what the chosen set leaves is negligible.
    """

    kind: Kind
    probabilities: Mapping[Kind, float]
    names: tuple[str, ...]
    inclusion: Mapping[str, float]
    missing: float
    exact: float
    chosen: SetEvidence
    alternatives: tuple[tuple[SetEvidence, float], ...]
    posterior: Mapping[str, float]
    negligible: float

    @property
    def confidence(self) -> float:
        """Probability of the answer given."""
        return self.probabilities[self.kind]


@dataclass(frozen=True)
class Beforehand:
    """What is held for probable before a recording is seen.

    Attributes:
        sizes: probability that so many effects act.
        odds: of every effect that is offered; in sets of one size the product counts.
        forms: in how many forms each is offered.
    """

    sizes: tuple[float, ...]
    odds: Mapping[str, float]
    forms: Mapping[str, int]

    @classmethod
    def of(cls, forms: Mapping[str, int], faults: Collection[str], criteria: Criteria) -> "Beforehand":
        """With these effects offered, `faults` of a test machine among them; more than there are can't act."""
        possible = criteria.sizes[: len(forms) + 1]
        odds = {n: criteria.fault if n in faults else 1.0 for n in forms}
        return cls(tuple(x / sum(possible) for x in possible), odds, forms)

    def exactly(self, names: Collection[str]) -> float:
        """Probability of a set of effects."""
        return self._share(names, len(names)) if len(names) < len(self.sizes) else 0.0

    def with_all(self, names: Collection[str]) -> float:
        """Probability that these act, beside whatever others."""
        return sum(self._share(names, k) for k in range(len(names), len(self.sizes)))

    def log_prior(self, s: SetEvidence) -> float:
        """Log probability of a set in its forms."""
        share = self.exactly(s.names)
        return (math.log(share) if share else -math.inf) - sum(math.log(self.forms[n]) for n in s.names)

    def _share(self, names: Collection[str], size: int) -> float:
        """Probability that so many act, and these among them."""
        others = self._products(n for n in self.odds if n not in names)[size - len(names)]
        odds = math.prod(self.odds[n] for n in names)
        return self.sizes[size] * odds * float(others / self._products(self.odds)[size])

    def _products(self, names: Iterable[str]) -> Float[np.ndarray, " m"]:
        """Sums of the products of the odds of all sets of 0, 1, 2, ... of these effects."""
        return np.append(np.poly([-self.odds[n] for n in names]), np.zeros(len(self.sizes)))


def negligible(s: SetEvidence, criteria: Criteria) -> float:
    """Probability that the rest's root mean square is below `Criteria.negligible` of the peak, beside what
    is laid to the simulation: a rest as small as that says nothing of the tissue."""
    mean, std = s.rest
    chance, square = s.scattered
    smooth, whole = ndtr((criteria.negligible**2 + s.numerical**2 - mean - np.array([0.0, square])) / max(std, 1e-300))
    return float((1 - chance) * smooth + chance * whole)


def left(s: SetEvidence) -> float:
    """The share of what a set leaves that is a rest and no noise, of the squares: 0 where it leaves noise alone."""
    return max(1.0 - s.n / max(s.chi2, 1e-300), 0.0)


def weighted(evidence: Evidence, criteria: Criteria) -> list[tuple[float, SetEvidence]]:
    """Of every set that may be true the log of its prior times its evidence, to the power that all are compared by."""
    before = Beforehand.of(evidence.forms, evidence.faults, criteria)
    usable = [s for s in evidence.sets if not s.void and math.isfinite(s.log_evidence)]
    power = criteria.power(max(s.n for s in usable), left(max(usable, key=lambda s: s.log_evidence)))
    return [(power * s.log_evidence + before.log_prior(s), s) for s in usable]


def judge(evidence: Evidence, criteria: Criteria | None = None) -> Judgement:
    """The verdict that the evidence asks for; see the module's text."""
    criteria = criteria or Criteria()
    before = Beforehand.of(evidence.forms, evidence.faults, criteria)
    groups: dict[frozenset, list[tuple[float, SetEvidence]]] = {}
    for weight, s in weighted(evidence, criteria):
        groups.setdefault(frozenset(s.names), []).append((weight, s))
    weights = {k: float(logsumexp([w for w, _ in rows])) for k, rows in groups.items()}
    whole = float(logsumexp(list(weights.values())))
    sound = {k: math.exp(w - whole) for k, w in weights.items()}
    best = {k: max(rows, key=lambda r: r[0])[1] for k, rows in groups.items()}
    empty = frozenset()
    named = [k for k in sound if k != empty]
    lapse = criteria.lapse if evidence.simulated else 0.0

    def mixed(sound: float, before: float) -> float:
        return (1 - lapse) * sound + lapse * before

    p = {k: mixed(x, before.exactly(k)) for k, x in sound.items()}
    inclusion = {n: mixed(sum(sound[k] for k in named if n in k), before.with_all((n,))) for n in evidence.forms}
    stated = frozenset(n for n, x in inclusion.items() if x > criteria.named)
    something = mixed(sum(sound[k] for k in named), 1 - before.exactly(()))
    with_them = mixed(sum(sound[k] for k in named if stated <= k), before.with_all(stated)) if stated else 0.0
    quiet = {k: negligible(best[k], criteria) for k in p}
    exact = p.get(stated, 0.0) if stated else 0.0
    chances = {
        Kind.NOTHING: p.get(empty, 0.0) * quiet.get(empty, 0.0),
        Kind.FOUND: exact * quiet.get(stated, 0.0) if stated else 0.0,
        Kind.AMBIGUOUS: something - with_them,
        Kind.UNEXPLAINED: p.get(empty, 0.0) * (1 - quiet.get(empty, 0.0)),
    }
    chances[Kind.IN_PART] = max(1.0 - sum(chances.values()), 0.0)
    kind = max(Kind, key=lambda k: chances[k])
    chosen = _chosen(kind, stated, named, p, best, empty)
    ranked = sorted((k for k in named if best[k] is not chosen), key=lambda k: -p[k])
    chosen = _plainest(groups[frozenset(chosen.names)], criteria.strong)
    return Judgement(
        kind,
        chances,
        tuple(n for n in chosen.names if n in stated) if kind in (Kind.FOUND, Kind.IN_PART) else (),
        {n: float(x) for n, x in sorted(inclusion.items(), key=lambda kv: -kv[1])},
        1.0 - chances[Kind.NOTHING],
        exact,
        chosen,
        tuple((best[k], p[k]) for k in ranked[:10]),
        {" + ".join(sorted(k)): p[k] for k in sorted(p, key=lambda k: -p[k])},
        negligible(chosen, criteria),
    )


def _chosen(kind, stated, named, p, best, empty) -> SetEvidence:
    if kind is Kind.NOTHING or not named:
        return best[empty]
    if kind in (Kind.FOUND, Kind.IN_PART):
        if p.get(stated, 0.0) > 0:
            return best[stated]
        return best[max((k for k in named if stated <= k), key=p.get)]
    return best[max(named, key=p.get)]


def _plainest(forms: Sequence[tuple[float, SetEvidence]], strong: float) -> SetEvidence:
    """The form of a set that is shown, of (weight, form): the likeliest, or one inside it that it hardly beats.

    What is named does not depend on it. A third relaxation time that is no more than likely has no error to show; a
    form of other parameters is another law, and fewer of them make it no plainer.
    """
    top, likeliest = max(forms, key=lambda form: form[0])
    inside = [(w, s) for w, s in forms if w > top - math.log(strong) and set(s.free) < set(likeliest.free)]
    return min((len(s.free), -w, i, s) for i, (w, s) in enumerate([(top, likeliest), *inside]))[-1]


def covering(judgement: Judgement, criteria: Criteria | None = None) -> tuple[tuple[SetEvidence, float], ...]:
    """Alternatives that, with the chosen set, cover `Criteria.covered` of the probability of named sets."""
    criteria = criteria or Criteria()
    total = sum(p for name, p in judgement.posterior.items() if name)
    at = judgement.posterior.get(" + ".join(sorted(judgement.chosen.names)), 0.0)
    out = []
    for s, p in judgement.alternatives:
        if at >= criteria.covered * total:
            break
        out.append((s, p))
        at += p
    return tuple(out)


def undecided(judgement: Judgement, criteria: Criteria | None = None) -> tuple[tuple[str, ...], ...]:
    """What a further recording would have to decide between, beside the chosen set: sets by their candidates, most
    probable first, none for the base alone.

    Of all accounts that say what would be recorded next those that, with the chosen one, cover `Criteria.covered` of
    their probability: sets that have a name, and the base where it leaves nothing of note (what something without a
    name would do nobody knows). None where all of these together are as improbable as what is not covered.
    """
    criteria = criteria or Criteria()
    chances, base = judgement.probabilities, judgement.posterior.get("", 0.0)
    accounts: list[tuple[float, tuple[str, ...]]] = [(p, s.keys) for s, p in judgement.alternatives]
    total = sum(judgement.posterior.values())
    if chances[Kind.NOTHING] <= chances[Kind.UNEXPLAINED]:
        total -= base
    elif judgement.chosen.names:
        accounts.append((base, ()))
    if total <= 1 - criteria.covered:
        return ()
    at, out = judgement.posterior.get(" + ".join(sorted(judgement.chosen.names)), 0.0), []
    for p, keys in sorted(accounts, key=lambda a: -a[0]):
        if at >= criteria.covered * total:
            break
        out.append(keys)
        at += p
    return tuple(out)


def entropy(judgement: Judgement) -> float:
    """How undecided the posterior over sets is, nats."""
    p = np.array(list(judgement.posterior.values()))
    return float(-np.sum(p * np.log(np.maximum(p, 1e-300))))
