"""Sets as a search would have weighed them, for tests of the judge."""

from tissuejax.diagnosis.judgement.evidence import Evidence, SetEvidence

FORMS = {"relaxation": 2, "slack": 1, "drift": 3}


def weighed(names, log_evidence, rest=1e-8, void=False, chi2=1e9):
    keys = tuple(names)
    numbers = {"fit": 0.0, "parameters": 0.0, "discrepancy": 0.0, "amplitudes": {}, "k": 2, "at_bound": ()}
    more = {"chi2": chi2, "n": 100, "kurtosis": 0.0, "explained": 0.5, "rest": (rest, 1e-2 * rest)}
    return SetEvidence(keys, keys, log_evidence, void=void, **numbers, **more)


def evidence(*sets):
    return Evidence(tuple(sets), FORMS, ("r1", "r2"), ("r3",))
