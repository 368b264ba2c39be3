"""The criteria of a judgement with one number changed: what an ablation goes through."""

from collections.abc import Iterator
from dataclasses import replace

from tissuejax.diagnosis.judgement.criteria import Criteria

# What sets are fitted and weighed by is in their evidence already: these want the diagnoses run again.
WEIGHED = (
    "unknown",
    "shares",
    "strange",
    "partly",
    "sudden",
    "recurs",
    "change",
    "rig",
    "shape",
    "loose",
    "alike",
    "misstated",
)
WEIGHED += ("unseen", "smooth", "shown", "means", "simulated", "strokes")  # fits/real-panel/matters.py asks these


def settings(simulated: bool) -> Iterator[tuple[str, Criteria]]:
    """The criteria as they are, and with one number changed, of all that a judge reads (all but `WEIGHED`).

    Args:
        simulated: whether predictions were simulations, which alone have a lapse.
    """
    usual = Criteria()
    yield "as they are", usual
    for coarse in (25.0, 50.0, 100.0, 150.0, 300.0, 1000.0, 1e9):
        yield f"coarse {coarse:g}", replace(usual, coarse=coarse)
    for named in (0.3, 0.4, 0.7, 0.9):
        yield f"named from {named}", replace(usual, named=named)
    for negligible in (0.0025, 0.01, 0.02):
        yield f"negligible below {negligible}", replace(usual, negligible=negligible)
    for sizes in ((0.25, 0.25, 0.25, 0.25), (0.6, 0.3, 0.08, 0.02), (0.8, 0.18, 0.018, 0.002)):
        yield f"sizes {sizes}", replace(usual, sizes=sizes)
    for fault in (1.0, 0.3, 0.02):
        yield f"fault {fault:g}", replace(usual, fault=fault)
    for lapse in (0.0, 0.1, 0.4) if simulated else ():
        yield f"lapse {lapse:g}", replace(usual, lapse=lapse)
    for covered in (0.45, 0.99):
        yield f"covered {covered:g}", replace(usual, covered=covered)
