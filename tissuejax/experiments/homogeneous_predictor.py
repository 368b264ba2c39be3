"""The predictor of material tests: one compiled function for all recordings of like mode and padded length.

Compilation is what costs, so it is shared: the model is static (two models of equal structure are one), everything
else is an argument, and time series are padded to multiples of 256 samples by repeating the last one. The next
recording, sample or start of a fit runs the same code.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.arrays import Given, traced
from tissuejax.effects.material_test import MaterialTest
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.homogeneous import local, material_test_kind, nominal_stress, reported
from tissuejax.experiments.predictor import Predictor, Tangents
from tissuejax.model import Model
from tissuejax.parameters import Values
from tissuejax.recordings.recording import Recording, Sample

BLOCK = 256


class HomogeneousPredictor(Predictor):
    """Predicts material tests; see `Predictor`.

    Attributes:
        tests: what was done in each recording, padded.
        reduced: models without their neutral effects, kept by what is zero and what is wanted.
    """

    name: ClassVar[str] = "homogeneous"
    model: Model
    sample: Sample
    names: tuple[str, ...]
    tests: Mapping[str, MaterialTest]
    reduced: dict = eqx.field(default_factory=dict)

    @classmethod
    def prepare(cls, model: Model, sample: Sample, names: tuple[str, ...], **options) -> "HomogeneousPredictor":
        """See `predictor`; takes no options."""
        if options:
            raise InputError(f"material tests take no option {', '.join(options)}; leave it out")
        tests = {}
        for name in names:
            recording = sample.recordings[name]
            tests[name] = padded(material_test_kind(recording.experiment).test(recording))
        return cls(model.across(names), sample, names, tests)

    def of(self, names: Sequence[str]) -> "HomogeneousPredictor":
        """The same model for other recordings of the sample."""
        return self.prepare(self.model, self.sample, tuple(names))

    def predict(self, values: Values) -> dict[str, Recording]:
        """Predicted recordings by name; see `Predictor.predict`."""
        found = {}
        for name, test in self.tests.items():
            model, known = self._within(values, name)
            found[name] = self._reported(name, _predict(model, _vector(known), test))
        return found

    def jacobian(self, values: Values, paths: Sequence[str]) -> tuple[dict[str, Recording], Tangents]:
        """Prediction and derivatives; see `Predictor.jacobian`."""
        for path in paths:
            if path not in self.model.parameters:
                raise unknown("parameter", path, self.model.parameters)
        recordings, tangents = {}, {path: {} for path in paths}
        for name, test in self.tests.items():
            model, known = self._within(values, name, paths)
            basis = np.zeros((len(paths), len(known)))
            for j, declared in enumerate(known):
                source = self.model.source_of(declared, name)
                basis[:, j] = [path in source for path in paths]
            stress, slopes = _linearised(model, _vector(known), test, basis)
            recordings[name] = self._reported(name, stress)
            slopes = slopes if traced(slopes) else np.asarray(slopes)
            for i, path in enumerate(paths):
                tangents[path][name] = {"nominal_stress": self._cut(name, slopes[i])}
        return recordings, tangents

    def _within(self, values: Values, name: str, wanted: Sequence[str] = ()) -> tuple[Model, dict[str, Given]]:
        """The model without effects that are off in recording `name`, and the value of each of its parameters."""
        known = local(self.model, values, name)
        if traced(*known.values()):
            return self.model.across(()), known
        off = tuple(path for path, value in known.items() if value == 0)
        key = off, tuple(wanted)
        if key not in self.reduced:  # building modules costs more than running them
            model = self.model.across(()).active(known, wanted)
            self.reduced[key] = model, tuple(model.declared)
        model, paths = self.reduced[key]
        return model, {path: known[path] for path in paths}

    def _cut(self, name: str, padded_series: Given) -> Given:
        """Without padding; on the host where possible, as a slice on the device is compiled for each length."""
        n = len(self.sample.recordings[name].inputs["time"])
        return padded_series[:n] if traced(padded_series) else np.asarray(padded_series)[:n]

    def _reported(self, name: str, stress: Given) -> Recording:
        return reported(self.sample.recordings[name], self._cut(name, stress))


def padded(test: MaterialTest) -> MaterialTest:
    """`test` with its series lengthened to a multiple of 256 by repeating the last sample."""
    extra = -len(test.time) % BLOCK

    def longer(series: Given) -> np.ndarray:
        return np.concatenate([series, np.repeat(series[-1:], extra, axis=0)])

    arrays = {name: getattr(test, name) for name in test.__dataclass_fields__}
    return MaterialTest(**{**arrays, "time": longer(test.time), "drive": longer(test.drive)})


@partial(jax.jit, static_argnums=0)
def _predict(model: Model, theta: Float[Array, " p"], test: MaterialTest) -> Float[Array, "n ..."]:
    return nominal_stress(model, dict(zip(model.declared, theta)), test)


@partial(jax.jit, static_argnums=0)
def _linearised(
    model: Model, theta: Float[Array, " p"], test: MaterialTest, basis: Float[Array, "k p"]
) -> tuple[Float[Array, "n ..."], Float[Array, "k n ..."]]:
    """Prediction and its derivative along each row of `basis`; vmap leaves the primal single."""
    return jax.vmap(lambda along: jax.jvp(lambda x: _predict(model, x, test), (theta,), (along,)), out_axes=(None, 0))(
        basis
    )


def _vector(known: Mapping[str, Given]) -> Float[Given, " p"]:
    """One array for all values: on the host unless one of them is traced."""
    values = list(known.values())
    return jnp.stack([jnp.asarray(v) for v in values]) if traced(*values) else np.array(values, float)
