"""Soft-tissue mechanics in JAX: identify the material from recordings by gradients, and find what the model left out.

import tissuejax as tj
found = tj.fit("sample.h5", energy="reduced-polynomial-2", holdout=["r3"])

The verbs (`read`, `material`, `fit`, `diagnose`, `write`, `sensitivity`, `catalogue`) load on first use, so that
importing a single module of the package stays cheap. Rooms are imported by their path,
`from tissuejax.energies.strain import Strain`.
"""

import importlib

VERBS = ("catalogue", "diagnose", "fit", "material", "read", "sensitivity", "write")


def __getattr__(name: str):
    if name in VERBS:
        return getattr(importlib.import_module("tissuejax.verbs"), name)
    raise AttributeError(f"module 'tissuejax' has no attribute {name!r}; its verbs are {', '.join(VERBS)}")


def __dir__():
    return sorted({*globals(), *VERBS})
