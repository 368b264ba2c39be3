"""The verbs of the front door: what the command line does, in Python.

import tissuejax as tj
found = tj.fit("liver.h5", energy="reduced-polynomial-2", holdout=["r3"])
tj.write(found, "out")

Importing this module switches JAX to double precision, which fits need; a simulation can ask for single precision
itself.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import jax

from tissuejax.energies import catalogue as names
from tissuejax.energies.energy import Energy
from tissuejax.errors import UnstableSimulation
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.predictor import predictor
from tissuejax.experiments.probing_slips import all_slips, warned
from tissuejax.families import lookup, members
from tissuejax.fitting import kinds
from tissuejax.fitting.kinds.fitted import Fitted
from tissuejax.fitting.options import Objective, Search, Unknowns
from tissuejax.fitting.result import Fit
from tissuejax.fitting.setup import problem, split
from tissuejax.model import Model
from tissuejax.progress import Progress
from tissuejax.recordings.files import read
from tissuejax.recordings.plausible import refuse_unusable
from tissuejax.recordings.recording import Sample

if TYPE_CHECKING:
    from tissuejax.diagnosis.result import Diagnosis

jax.config.update("jax_enable_x64", True)

__all__ = ["catalogue", "compare", "diagnose", "fit", "material", "read", "sensitivity", "write"]


def catalogue() -> dict[str, type[Energy]]:
    """The catalogue: all strain energies by name."""
    return names.energies()


def material(
    energy: str | Energy,
    *,
    ogden_form: str | None = None,
    volumetric: str | None = None,
    effects: Sequence[str] = (),
) -> Model:
    """A Model from names.

    Args:
        energy: e.g. "reduced-polynomial-2", "ogden-3", "demiray+fibre".
        ogden_form: for "ogden-N" only: which form the constants mean.
        volumetric: e.g. "quadratic"; None is incompressible.
        effects: names of effects to switch on.
    """
    if not isinstance(energy, Energy):
        energy = names.energy(energy, ogden_form=ogden_form)
    bulk = names.volumetric(volumetric) if volumetric else None
    if effects:
        from tissuejax.effects.catalogue import effect

        return Model(energy, bulk, tuple(effect(name) for name in effects))
    return Model(energy, bulk)


def fit(
    data: str | os.PathLike | Sample,
    energy: str | Energy | Model,
    *,
    ogden_form: str | None = None,
    volumetric: str | None = None,
    effects: Sequence[str] = (),
    only: Sequence[str] = (),
    holdout: Sequence[str] = (),
    unknowns: Unknowns | None = None,
    objective: Objective | None = None,
    search: Search | None = None,
    first: str | os.PathLike | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Estimate the parameters of a strain energy (and effects) from the recordings of a sample.

    Args:
        data: a recording file (HDF5), a side file (TOML) of tables, or a Sample.
        energy: a name, an Energy or a whole Model; see `material` for ogden_form, volumetric, effects.
        only, holdout: recordings to fit, and to predict only.
        unknowns: what is estimated, from where, within which limits.
        objective: what a unit of misfit means.
        search: method, number of starts and steps.
        first: for probings, the file of a surrogate (`tissuejax precompute`): it is fitted to the forces first, which
            takes seconds, and the simulations begin where it ends.
        progress: advanced after every accepted step.

    Probings are fitted by `fitting.probed.fit_probed` (forward-mode least squares): from one start, whatever
    `multistart` says, with a volumetric energy K/2 (J-1)^2 if none is named.

    Returns:
        The fit: `values`, `std`, `channels`, `holdout`, `warnings`, `record()`.

    Raises:
        InputError: anything that can't be used as it is, with what to do.
    """
    sample = data if isinstance(data, Sample) else read(Path(data))
    if not isinstance(energy, Model):
        energy = material(energy, ogden_form=ogden_form, volumetric=volumetric, effects=effects)
    fitted, held = split(sample, tuple(only), tuple(holdout))
    refuse_unusable(sample, fitted)
    kind = lookup(
        "kind of experiment", experiment(sample.recordings[fitted[0]].experiment).kind, members(kinds, Fitted)
    )
    search, start = search or Search(), (unknowns or Unknowns()).start
    posed = problem(predictor(kind.completed(energy), sample, fitted), unknowns, objective)
    begun = None
    if first is not None:
        begun = kind.begin(posed, first, start or {})
        posed = replace(posed, start=dict(posed.start) | begun.start)
    said = all_slips(sample, (*fitted, *held))
    try:
        found = kind.fit(posed, held, search, frozenset(start or ()), progress)
    except UnstableSimulation as error:
        raise UnstableSimulation(f"{error}{'. First look at the data: ' if said else ''}{'; '.join(said)}") from error
    found.warnings.extend(warned(said))
    return found if begun is None else replace(found, first=begun)


def diagnose(
    data: str | os.PathLike | Sample,
    energy: str | Energy | Model,
    *,
    holdout: str | Sequence[str] | None = None,
    **options,
) -> "Diagnosis":
    """What the model of a sample lacks: where it misses, which effect, how sure; see `diagnosis.diagnose.diagnose`.

    Args:
        data: a recording file or a Sample.
        energy: base model: a strain energy by name or as an object, or a Model whose effects are known to act.
        holdout: recordings to predict from a fit to the others; the last one by default. They too choose the set.
        options: `effects` to try, `known` physics, `unread` recordings, `ogden_form`, `progress`, `effort`.
    """
    from tissuejax.diagnosis.diagnose import diagnose as run

    return run(data, energy, holdout=holdout, **options)


def compare(*fits: Fit):
    """Fits of the same recordings side by side: AIC, BIC, Akaike weights, held-out error; see `fitting.comparison`.

    Raises:
        InputError: none, or fits of different data.
    """
    from tissuejax.fitting.comparison import compare as compared
    from tissuejax.fitting.comparison import name_of

    records = [found.record() for found in fits]
    labels = [name_of(record) for record in records]
    labels = [name if labels.count(name) == 1 else f"{name} ({i})" for i, name in enumerate(labels, start=1)]
    return compared(dict(zip(labels, records, strict=True)), None, dict(zip(labels, fits, strict=True)))


def write(found: "Fit | Diagnosis", out: str | os.PathLike) -> dict[str, Path]:
    """Write result.json, report.html and figures of a fit or a diagnosis into a folder; returns their paths by name."""
    if isinstance(found, Fit):
        from tissuejax.report.page import write_fit

        return write_fit(found, Path(out))
    from tissuejax.report.diagnosis_page import write_diagnosis

    return write_diagnosis(found, Path(out))


def sensitivity(found: Fit, **options):
    """What each parameter does to each channel, and what the data can tell apart; see `fitting.sensitivity.local`."""
    from tissuejax.fitting.sensitivity import local

    return local(found.problem.predictor, found.values, found.free, found.problem.noise, **options)
