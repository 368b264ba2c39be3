"""Soft-tissue mechanics in JAX: identify the material from recordings by gradients, and find what the model left out.

import tissuejax as tj
found = tj.fit("sample.h5", energy="reduced-polynomial-2", holdout=["r3"])

Verbs and nouns load on first use, so that importing a single module of the package stays cheap. Everything else is
imported by its path, `from tissuejax.energies.strain import Strain`.
"""

import importlib

from tissuejax.cache import source as _source  # noqa: F401  hashes the code before any of it is loaded

VERBS = ("catalogue", "compare", "diagnose", "fit", "material", "read", "sensitivity", "write")
NOUNS = {
    "Channel": "recordings.recording",
    "Diagnosis": "diagnosis.result",
    "Effect": "effects.effect",
    "Energy": "energies.energy",
    "Fit": "fitting.result",
    "InputError": "errors",
    "Model": "model",
    "NotConverged": "errors",
    "Objective": "fitting.options",
    "ProbingSettings": "experiments.probing_settings",
    "Recording": "recordings.recording",
    "Sample": "recordings.recording",
    "Search": "fitting.options",
    "Unknowns": "fitting.options",
    "predictor": "experiments.predictor",
}

__all__ = [*VERBS, *NOUNS, "__version__"]


def __getattr__(name: str):
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("tissuejax")
    if name in VERBS:
        return getattr(importlib.import_module("tissuejax.verbs"), name)
    if name in NOUNS:
        return getattr(importlib.import_module(f"tissuejax.{NOUNS[name]}"), name)
    raise AttributeError(
        f"module 'tissuejax' has no attribute {name!r}; its verbs are {', '.join(VERBS)}, its nouns {', '.join(NOUNS)}"
    )


def __dir__():
    return sorted({*globals(), *__all__})
