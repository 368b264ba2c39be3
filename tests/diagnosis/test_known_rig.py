"""What a user knows of the test machine, and how likely a fault of it is held then."""

import dataclasses

import pytest
from weighed_sets import evidence, weighed

from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.judge import judge
from tissuejax.errors import InputError


def test_what_is_known_of_a_machine_is_how_likely_a_fault_of_it_is():
    """Of two names with the same evidence, one a fault: where nobody looked at the machine both are as likely, where it
    was verified the fault has a hundredth of the other's odds. Of a drift one of three forms was weighed."""
    sets = evidence(weighed([], -20.0), weighed(["slack"], 0.0), weighed(["drift"], 0.0))
    sets = dataclasses.replace(sets, faults=("slack",))
    for known, odds in (("verified", 0.01), ("usual", 0.1), ("unchecked", 1.0)):
        j = judge(sets, Criteria.of_rig(known))
        assert j.posterior["slack"] / j.posterior["drift"] == pytest.approx(3 * odds)
    assert Criteria.of_rig("usual") == Criteria()
    with pytest.raises(InputError, match="knowledge of a rig .*verified"):
        Criteria.of_rig("good")
