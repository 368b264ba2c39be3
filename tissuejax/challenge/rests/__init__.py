"""What real recordings hold beside any effect: one small file a law, found by walking this folder.

Every law is non-smooth, multiplicative or a share of something foreign, so that no smooth random function has it. The
laws work on the stress that the rest-free specimen gives and return a change of it; how much of it is added is chosen
afterwards (`rest.together`).
"""

import importlib
import pkgutil

from tissuejax.challenge.rests.rest import Rest


def rests() -> dict[str, Rest]:
    """All laws of rest by name, in the order of their names."""
    found = {}
    for info in pkgutil.iter_modules(__path__):
        law = getattr(importlib.import_module(f"{__name__}.{info.name}"), "REST", None)
        if isinstance(law, Rest):
            found[law.name] = law
    return dict(sorted(found.items()))
