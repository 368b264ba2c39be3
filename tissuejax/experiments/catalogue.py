"""Experiments by the names that recordings carry."""

from tissuejax import experiments as package
from tissuejax.experiments.experiment import Experiment
from tissuejax.families import lookup, members


def experiments() -> dict[str, type[Experiment]]:
    """All experiment kinds by name."""
    return members(package, Experiment)


def experiment(name: str) -> Experiment:
    """The experiment called `name`, e.g. "uniaxial".

    Raises:
        InputError: no such kind; the nearest names are offered.
    """
    return lookup("experiment", name, experiments())()
