"""The sentences a user reads when something is refused, and the exit codes that go with them.

Every message says what came, what is allowed and what to do.
"""

import difflib
from collections.abc import Iterable


class TissueError(Exception):
    """Anything tissuejax refuses or gives up on; `exit_code` is what the command line returns."""

    exit_code = 1


class InputError(TissueError):
    """The input can't be used as it is: what came, what is allowed, what to do."""

    exit_code = 2


class NotConverged(TissueError):
    """A fit, a root find or an equilibrium search ended without an answer."""

    exit_code = 3


class UnstableSimulation(TissueError):
    """An explicit run blew up or inverted an element: the time, the element and the advice."""

    exit_code = 3


def unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """The error for a name that is not in `known`, with the nearest valid names.

    Args:
        kind: what the name should have been, e.g. "energy" or "parameter".
        name: what came.
        known: the names that are allowed.
    """
    known = sorted(known)
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.4)
    hint = f"Did you mean {' or '.join(repr(c) for c in close)}?" if close else ""
    return InputError(f"unknown {kind} {name!r}. {hint} Known: {', '.join(known)}.".replace("  ", " "))


class CoarseMesh(UserWarning):
    """A simulation ran, and its elements are too few or too soft in bending for what was asked of them."""
