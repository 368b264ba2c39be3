"""Random evidence judged, and judged again by counting: every set that may act, every form, every rest, one by one."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from weighed_sets import weighed

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.evidence import Evidence
from tissuejax.diagnosis.judgement.judge import Kind, covering, entropy, judge, left, negligible
from tissuejax.diagnosis.judgement.marginal import Widths

FORMS = {"relaxation": 2, "slack": 1, "drift": 3, "hum": 1}
FAULTS = ("slack", "hum")
SIZES = (0.4, 0.4, 0.15, 0.05)


def drawn(seed: int, simulated: bool) -> Evidence:
    """Sets of none to three effects in some of their forms; a few of them are void or impossible."""
    rng = np.random.default_rng(seed)
    names = [s for k in range(4) for s in itertools.combinations(FORMS, k)]
    some = [(), *(names[i] for i in rng.choice(np.arange(1, len(names)), 8, replace=False))]
    sets = []
    for chosen in some:
        for form in range(1 + int(rng.integers(0, 2)) if chosen else 1):
            s = weighed(chosen, float(rng.normal(0, 2.5)), chi2=float(rng.uniform(60, 400)))
            sets.append(
                replace(
                    s,
                    keys=tuple(f"{n}/{form}" for n in chosen),
                    rest=(10 ** rng.uniform(-6, -3.5), 10 ** rng.uniform(-6, -4)),
                    scattered=(float(rng.uniform(0, 0.3)), 10 ** rng.uniform(-6, -4)),
                    numerical=float(rng.uniform(0, 0.004)),
                    free=("mu", *(f"{n}.{form}" for n in chosen)),
                    void=bool(chosen and rng.random() < 0.15),
                    log_evidence=-math.inf if chosen and rng.random() < 0.1 else s.log_evidence,
                )
            )
    return Evidence(tuple(sets), FORMS, ("r1",), ("r2",), simulated=simulated, faults=FAULTS)


def beforehand(criteria: Criteria) -> dict[frozenset, float]:
    """Of every set that may act: of its size in proportion to the product of its odds."""
    odds = {n: criteria.fault if n in FAULTS else 1.0 for n in FORMS}
    out = {}
    for k, share in enumerate(SIZES):
        sets = list(itertools.combinations(FORMS, k))
        products = [math.prod(odds[n] for n in s) for s in sets]
        out |= {frozenset(s): share * x / sum(products) for s, x in zip(sets, products, strict=True)}
    return out


@pytest.mark.parametrize("simulated", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_all_probabilities_are_those_that_counting_gives(seed, simulated):
    criteria = Criteria(lapse=0.3, coarse=60.0)
    given, before = drawn(seed, simulated), beforehand(criteria)
    sets = [s for s in given.sets if not s.void and s.log_evidence > -math.inf]
    likeliest = max(sets, key=lambda s: s.log_evidence)
    strange = max(1 - likeliest.n / likeliest.chi2, 0.0)
    assert left(likeliest) == pytest.approx(strange)
    power = 60.0 / (60.0 + 100 * strange)
    odds = {}
    for s in sets:
        prior = before[frozenset(s.names)] / math.prod(FORMS[n] for n in s.names)
        odds[s.keys] = prior * math.exp(power * s.log_evidence)
    whole, lapse = sum(odds.values()), 0.3 if simulated else 0.0
    groups, best = {}, {}
    for s in sets:
        name = frozenset(s.names)
        groups[name] = groups.get(name, 0.0) + odds[s.keys] / whole
        if name not in best or odds[s.keys] > odds[best[name].keys]:
            best[name] = s
    posterior = {k: (1 - lapse) * x + lapse * before[k] for k, x in groups.items()}
    every = {k: (1 - lapse) * groups.get(k, 0.0) + lapse * x for k, x in before.items()}  # tried or not
    j = judge(given, criteria)
    assert j.posterior == pytest.approx({" + ".join(sorted(k)): x for k, x in posterior.items()})
    assert list(j.posterior.values()) == sorted(j.posterior.values(), reverse=True)
    assert j.inclusion == pytest.approx({n: sum(x for k, x in every.items() if n in k) for n in FORMS})
    assert list(j.inclusion.values()) == sorted(j.inclusion.values(), reverse=True)
    stated = frozenset(n for n, x in j.inclusion.items() if x > 0.5)
    exact = posterior.get(stated, 0.0) if stated else 0.0
    quiet = {k: below(s, criteria) for k, s in best.items()}
    base = frozenset()
    expected = {
        Kind.NOTHING: posterior[base] * quiet[base],
        Kind.UNEXPLAINED: posterior[base] * (1 - quiet[base]),
        Kind.FOUND: exact * quiet.get(stated, 0.0),
        Kind.AMBIGUOUS: sum(x for k, x in every.items() if k and not (stated and stated <= k)),
    }
    expected[Kind.IN_PART] = max(1 - sum(expected.values()), 0.0)
    assert j.probabilities == pytest.approx(expected, abs=1e-12)
    assert j.kind is max(expected, key=expected.get)
    assert j.exact == pytest.approx(exact)
    assert j.missing == pytest.approx(1 - expected[Kind.NOTHING])
    assert_chosen(j, stated, posterior, best, sets, odds)
    shares = np.array(list(posterior.values()))
    assert entropy(j) == pytest.approx(-np.sum(shares * np.log(shares)))
    assert j.negligible == pytest.approx(below(j.chosen, criteria))


def below(s, criteria: Criteria) -> float:
    """Probability that a rest of this size, normal about it, is of no note: with what scatters, and without."""
    most = criteria.negligible**2 + s.numerical**2
    alone, whole = (norm.cdf(most, s.rest[0] + extra, s.rest[1]) for extra in (0.0, s.scattered[1]))
    found = (1 - s.scattered[0]) * alone + s.scattered[0] * whole
    assert negligible(s, criteria) == pytest.approx(found)
    return found


def assert_chosen(j, stated, posterior, best, sets, odds) -> None:
    """The set that is shown, its names, and what stands beside it."""
    named = [k for k in posterior if k]
    if j.kind is Kind.NOTHING or not named:
        name = frozenset()
    elif j.kind in (Kind.FOUND, Kind.IN_PART):
        name = stated if stated in posterior else max((k for k in named if stated <= k), key=posterior.get)
    else:
        name = max(named, key=posterior.get)
    assert frozenset(j.chosen.names) == name
    top = best[name]
    plainer = [
        s
        for s in sets
        if frozenset(s.names) == name and set(s.free) < set(top.free) and odds[s.keys] > odds[top.keys] / 20
    ]
    assert j.chosen == min([top, *plainer], key=lambda s: (len(s.free), -odds[s.keys]))
    speaks = j.kind in (Kind.FOUND, Kind.IN_PART)
    assert j.names == (tuple(n for n in j.chosen.names if n in stated) if speaks else ())
    others = sorted((k for k in named if k != name), key=posterior.get, reverse=True)[:10]
    assert [s for s, _ in j.alternatives] == [best[k] for k in others]
    assert [x for _, x in j.alternatives] == pytest.approx([posterior[k] for k in others])


@pytest.mark.parametrize("seed", range(20))
def test_the_fewest_alternatives_that_cover_nine_tenths_are_offered(seed):
    j = judge(drawn(seed, False))
    named = sum(x for name, x in j.posterior.items() if name)
    own = j.posterior[" + ".join(sorted(j.chosen.names))]
    offered = covering(j)
    assert offered == j.alternatives[: len(offered)]
    sums = own + np.cumsum([0.0, *(x for _, x in j.alternatives)])
    assert len(offered) == int(np.argmax(sums >= 0.9 * named))


def test_the_prior_of_one_part_is_its_own():
    w = Widths(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), np.array([10.0, 20.0, 30.0]))
    own = w.part(1)
    assert (own.width.tolist(), own.chance.tolist(), own.factor.tolist()) == ([2.0], [0.2], [20.0])
    assert Widths(w.width, w.chance, 7.0).part(2).factor.tolist() == [7.0]


def test_an_amplitude_is_likelier_a_wide_one_from_where_the_densities_cross():
    """Of (1 - c) HN(w) and c HN(f w): a^2 / w^2 = 2 log((1 - c) f / c) / (1 - 1 / f^2)."""
    width, chance, factor = np.array([2.0, 0.01, 1.0]), np.array([0.1, 0.3, 0.0]), np.array([10.0, 4.0, 10.0])
    w = Widths(width, chance, factor)
    cross = 2 * np.log((1 - chance[:2]) * factor[:2] / chance[:2]) / (1 - factor[:2] ** -2.0) * width[:2] ** 2
    assert w.wider(np.array([*0.99 * cross, 1e3])).tolist() == [False, False, False]
    assert w.wider(np.array([*1.01 * cross, 1e9])).tolist() == [True, True, False]
