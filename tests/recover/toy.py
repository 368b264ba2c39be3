"""A predictor with a closed form, for tests of the fitting room alone: two decaying exponentials and an offset."""

import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.energies.energy import Energy
from tissuejax.estimation.problem import Problem
from tissuejax.estimation.weights import noise
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel, Recording, Sample

TRUE = {"energy.a": 80.0, "energy.b": 40.0, "energy.rate": 0.7, "energy.offset": 5.0}


class ToyEnergy(Energy):
    """Neo-Hookean in a, so that there is something to be stable."""

    name = "toy"
    formula = "a/2 (I1bar - 3)"
    shear_modulus = "a"
    source = "none"

    @property
    def parameters(self):
        return tuple(ToyModel.parameters.values())

    def isochoric(self, p, strain):
        return 0.5 * p["a"] * (strain.I1 - 3)

    def initial_shear_modulus(self, p):
        return p["a"]


class ToyModel:
    """Declares a, b (Pa), rate (1/s) and offset (Pa); y = a exp(-rate t) + b exp(-3 rate t) + offset."""

    parameters = {
        "energy.a": Parameter("a", "Pa", 100.0, lower=0.0),
        "energy.b": Parameter("b", "Pa", 100.0, lower=0.0),
        "energy.rate": Parameter("rate", "1/s", 1.0, lower=0.0, upper=20.0),
        "energy.offset": Parameter("offset", "Pa", 0.0, scale=10.0),
    }
    effects = ()
    volumetric = None

    energy = ToyEnergy()

    defaults = {path: d.default for path, d in parameters.items()}


@jax.jit
def curve(v, t):
    return (
        v["energy.a"] * jnp.exp(-v["energy.rate"] * t)
        + v["energy.b"] * jnp.exp(-3 * v["energy.rate"] * t)
        + v["energy.offset"]
    )


slopes_of = jax.jit(jax.jacfwd(curve))


class ToyPredictor:
    """The Predictor contract on the curve above."""

    model = ToyModel()

    def __init__(self, sample, names=None):
        self.sample, self.names = sample, tuple(names or sample.recordings)
        self.paths, self.calls = tuple(self.model.parameters), 0

    def predict(self, values):
        return {name: self._recording(name, curve(values, self._time(name))) for name in self.names}

    def jacobian(self, values, paths):
        self.calls += 1
        slopes = {path: {} for path in paths}
        for name in self.names:
            jac = slopes_of({k: float(v) for k, v in values.items()}, self._time(name))
            for path in paths:
                slopes[path][name] = {"nominal_stress": jac[path]}
        return self.predict(values), slopes

    def of(self, names):
        return type(self)(self.sample, names)

    def _time(self, name):
        return jnp.asarray(self.sample.recordings[name].channels["nominal_stress"].time)

    def _recording(self, name, values):
        r = self.sample.recordings[name]
        channel = Channel(r.channels["nominal_stress"].time, values, "Pa", None)
        return Recording(name, r.experiment, r.inputs, {"nominal_stress": channel}, r.attributes)


def toy_sample(rng, true, noise=1.0, recorded=True, n=400, names=("r1", "r2"), lost=0):
    """Noisy recordings of the curve; `lost` samples of each are NaN."""
    recordings = {}
    for k, name in enumerate(names):
        t = np.linspace(0, 3 + k, n)
        y = np.asarray(curve(true, t)) + noise * rng.normal(size=n)
        y[:lost] = np.nan
        channel = Channel(t, y, "Pa", noise if recorded else None)
        recordings[name] = Recording(name, "toy", {"time": t}, {"nominal_stress": channel}, {})
    return Sample("toy", recordings)


def problem(sample, free, kind=ToyPredictor, **options):
    predictor = kind(sample)
    start = {path: d.default for path, d in predictor.model.parameters.items()} | TRUE | options.pop("start", {})
    return Problem(predictor, free, start, noise(sample, predictor.names, "auto"), **options)
