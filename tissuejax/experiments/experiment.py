"""What every experiment is: a kind of recording that a Model can predict."""

import abc
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from tissuejax.model import Model
from tissuejax.recordings.recording import Recording


class Experiment(eqx.Module):
    """One kind of experiment: what was done to the sample, and what a Model says would have been recorded.

    Class data:
        name: the `experiment` attribute of its recordings.
        kind: "homogeneous" (a material test: one strain state in the specimen) or "probing"; which effects can act.
    """

    name: ClassVar[str]
    kind: ClassVar[str]

    @abc.abstractmethod
    def predict(self, model: Model, values: Mapping[str, Array], recording: Recording) -> Recording:
        """The recording that `model` with `values` would have given: same inputs, predicted channels.

        Args:
            model: energy and effects.
            values: parameter values by dotted path; a path that is missing takes its default.
            recording: what was done; its channels only say when the sensors were read.
        """
