"""How often answers of each kind were true in sealed cases, beside what they stated; said on every page.

The numbers are those of `fits/challenge/pooled.json` ("by_answer"), of the newest sets of each kind of experiment; a
test holds them against it.
"""

from typing import NamedTuple

LEAST = 5  # answers below which a share says nothing


class Held(NamedTuple):
    """Answers of one kind that were graded: how many, how many were true, and what they stated on average."""

    of: int
    true: int
    stated: float


RECORD = {
    "homogeneous": {
        "ambiguous": Held(12, 2, 0.61),
        "found": Held(400, 373, 0.95),
        "found-in-part": Held(157, 111, 0.93),
        "nothing-missing": Held(166, 151, 0.96),
        "unexplained": Held(129, 96, 0.82),
    },
    "probing": {
        "ambiguous": Held(1, 0, 0.59),
        "found": Held(18, 16, 0.75),
        "found-in-part": Held(3, 2, 0.77),
        "nothing-missing": Held(10, 7, 0.78),
        "unexplained": Held(6, 4, 0.73),
    },
}


def sentence(experiment: str, verdict: str) -> str:
    """What to make of a stated probability; empty where too few answers of the kind were graded, or none."""
    held = RECORD.get(experiment, {}).get(verdict)
    if held is None or held.of < LEAST:
        return ""
    return (
        f"In sealed cases that other simulators made, graded blind, {held.true} of {held.of} answers of this kind "
        f"were true, where {held.stated:.2f} was stated on average."
    )
