"""Predictors: a model and the recordings of a sample, made ready for many predictions with different values."""

import abc
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from tissuejax import experiments as package
from tissuejax.effects.catalogue import effects
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.catalogue import experiment
from tissuejax.families import lookup, members
from tissuejax.model import Model
from tissuejax.parameters import Values
from tissuejax.recordings.recording import Recording, Sample

WORDS = {"homogeneous": "material tests", "probing": "probings", "cutting": "cuts"}
Tangents = dict[str, dict[str, dict[str, Array]]]


class Predictor(eqx.Module):
    """From parameter values to recordings, and to their derivatives.

    Class data:
        name: the kind of experiments it serves, "homogeneous" or "probing".

    Attributes:
        model: the model; it knows the recordings, so its `parameters` are all there are.
        sample: the sample, measurement included.
        names: recordings that are predicted.
    """

    name: ClassVar[str]
    model: eqx.AbstractVar[Model]
    sample: eqx.AbstractVar[Sample]
    names: eqx.AbstractVar[tuple[str, ...]]

    @property
    def paths(self) -> tuple[str, ...]:
        """All parameter paths, in the order of the model."""
        return tuple(self.model.parameters)

    @classmethod
    @abc.abstractmethod
    def prepare(cls, model: Model, sample: Sample, names: tuple[str, ...], **options) -> "Predictor":
        """A predictor of recordings `names`, which are all of its kind; see `predictor`."""

    @abc.abstractmethod
    def predict(self, values: Values) -> dict[str, Recording]:
        """Predicted recordings by name, at the times of the measured ones.

        Args:
            values: parameter values by dotted path; a missing one takes its default.

        Raises:
            InputError: a path that the model doesn't know.
        """

    @abc.abstractmethod
    def jacobian(self, values: Values, paths: Sequence[str]) -> tuple[dict[str, Recording], Tangents]:
        """The prediction, and its derivative by each of `paths` as `[path][recording][channel]`, in forward mode."""

    @abc.abstractmethod
    def of(self, names: Sequence[str]) -> "Predictor":
        """The same model for other recordings of the same sample."""


def predictor(model: Model, sample: Sample, names: Sequence[str] | None = None, **options) -> Predictor:
    """The predictor that fits the kind of `names`.

    Args:
        model: energy and effects.
        sample: recordings, and the body if they are probings.
        names: recordings to predict; all by default.
        options: passed to the predictor (mesh and time step of a probing).

    Raises:
        InputError: an unknown recording, none at all, recordings of different kinds, an effect of another kind, or one
            without parameters.
    """
    names = tuple(sample.recordings if names is None else names)
    for name in names:
        if name not in sample.recordings:
            raise unknown("recording", name, sample.recordings)
    kinds = {name: experiment(sample.recordings[name].experiment).kind for name in names}
    if len(set(kinds.values())) != 1:
        found = ", ".join(f"{name} ({kind})" for name, kind in kinds.items()) or "none"
        raise InputError(f"recordings of one kind can be predicted together, got {found}; choose with names")
    kind = next(iter(kinds.values()))
    for effect in model.effects:
        if kind not in effect.kinds:
            known = ", ".join(sorted(effects(kind)))
            raise InputError(
                f"effect {effect.name} does nothing in {WORDS.get(kind, kind)}; what can act there: {known}"
            )
        if not effect.parameters:
            raise InputError(
                f"effect {effect.name} has no parameters: there is nothing to predict or to fit. It is a part of what "
                f"any law leaves, which `tissuejax diagnose` weighs. {effect.remedy}"
            )
    return lookup("kind of experiment", kind, members(package, Predictor)).prepare(model, sample, names, **options)
