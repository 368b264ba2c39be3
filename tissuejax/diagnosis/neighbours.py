"""Sets next to a set: the same effects in other forms, and one effect less.

Each effect of a set may be there in the wrong form (one relaxation time where there are two), and an effect may have
been only a stepping stone. Every form is given a few steps, of a single effect from more starts, and only the best are
finished: what the other forms of one effect would cost is better spent on the forms of pairs, and on sets of three.
Where predictions are cheap all are finished, also beside a set that leaves noise: one of them may be its rival.
"""

from tissuejax.diagnosis.quality import quality
from tissuejax.diagnosis.refit import Refit

ROUNDS = 4
FINISHED = 2  # neighbours of a set that are fitted to the end in a round
PROMISING = 30.0  # by which the criterion of a neighbour may exceed that of the set after a few steps
LOST = 0.4  # share of the misfit: a set that leaves so much more than one effect more does isn't saved by other forms


def reshape(s, keys: frozenset) -> None:
    """Try every effect of a set in its neighbouring forms, as long as that lowers the criterion of the search `s`."""
    at = keys
    for _ in range(ROUNDS):
        parent = s.refits[at]
        if quality(s, parent).noise:
            return
        known = neighbours(s, parent)
        best = min([at, *(k for k in known if not s.doubts(k))], key=lambda k: s.criterion(s.refits[k]))
        if best == at:
            return
        at = best


def neighbours(s, parent: Refit) -> list[frozenset]:
    """Sets that differ from `parent` in the form of one effect and have been fitted, now or before."""
    at, known, begun = frozenset(parent.keys), [], []
    for old in parent.keys:
        for new in s.bench.candidates[old].beside:
            key = at - {old} | {new}
            if key in s.refits:
                known.append(key)
            elif key not in s.dropped and s.bench.burden(key) <= s.budget.burden and not s.exhausted:
                order = tuple(new if k == old else k for k in parent.keys)
                s.report(" + ".join(order))
                starts = [{**parent.values, **setting} for setting in s.bench.candidates[new].grid]
                if s.bench.dear:
                    s.refits[key] = s.finished(order, starts[: s.budget.starts])
                    known.append(key)
                else:
                    # of one effect no score tells which start of such a form is promising
                    whole = len(at) == 1 and not s.bench.candidates[new].nominated
                    most = len(starts) if whole else s.budget.starts + (len(at) == 1)
                    begun.append(s.begun(order, starts[:most], held=True))
    for rank, r in enumerate(sorted(begun, key=s.criterion)):
        key = frozenset(r.keys)
        near = s.criterion(r) < s.criterion(parent) + PROMISING and (rank < FINISHED or s.patient)
        if near or s.early:
            s.refits[key] = s.finished(r.keys, [r.values])
            known.append(key)
        else:
            s.dropped.add(key)
    return known


def leave_out(s) -> None:
    """Refit the best set without each of its effects in turn, in all forms; go on from the best of these.

    From where the larger set came to rest, also if that was refitted before: an effect may have been called only
    because the smaller set's own descent had stopped early.
    """
    at = None
    while at != (at := frozenset(s.best.keys)):
        parent = s.refits[at]
        missing = max(s.empty.chi2 - s.empty.n, 1.0)
        for key in parent.keys if len(parent.keys) > 1 else ():
            smaller = at - {key}
            order = tuple(k for k in parent.keys if k != key)
            s.report(" + ".join(order))
            known, begun = s.refits.get(smaller), s.begun(order, [parent.values])
            if known is None or begun.chi2 < known.chi2 - 1.0:
                s.refits[smaller] = s.finished(order, [begun.values])
            if s.refits[smaller].chi2 - parent.chi2 < LOST * missing:
                reshape(s, smaller)
