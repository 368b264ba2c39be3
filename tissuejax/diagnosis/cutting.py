"""The bench of cuts: the force against the motion by the balance of energies, with every effect of cutting in it.

A prediction takes microseconds, so the search of material tests serves cuts as it is. The balance has no law of
parting: at the entry it lets the force set in over a length, which belongs to the base model with the toughness, and
where the blade rests, turns or comes to the end of an older cut its samples are left out.

The tissue's own modulus is scaled to the size of the force where it is not told, and wedging follows the volumetric
modulus, which is fitted with the base then: a return stroke or a second pass tells it from toughness. A friction
coefficient is relative to that modulus.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.cohesion.catalogue import law
from tissuejax.diagnosis.bench import Bench, Candidate, Free
from tissuejax.diagnosis.catalogue import settings
from tissuejax.diagnosis.next_cut import next_cut
from tissuejax.effects.catalogue import effects, suited
from tissuejax.effects.form import Offer
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import unknown
from tissuejax.estimation.series import Driven, Series
from tissuejax.experiments.cutting import balance_force
from tissuejax.experiments.cutting_layers import ages, layer
from tissuejax.experiments.cutting_record import FORCE, Path, bevel_of, steady
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.parameters import under
from tissuejax.recordings.recording import Channel, Sample

BASE = ("cohesion.energy", "effects.onset.longer", "volumetric.K")
STIFF = 10.0  # bulk over shear modulus where the tissue is not known
WEDGING = 0.05  # share of the force that the modulus gives to wedging at the start


class CuttingBench(Bench):
    """Cuts of one sample; see `Bench`.

    Attributes:
        fresh: by recording, the share of the motion that parts new tissue.
        bevels: by recording, how long a bevel is along the way, m.
    """

    @classmethod
    def of(
        cls, sample: Sample, energy: Energy, fitted: tuple[str, ...], held_out: tuple[str, ...], names=None, like=None
    ) -> "CuttingBench":
        """The bench of `sample` with base model `energy`; `names`: effects to try, all of cutting by default.

        `like`: a bench of the same sample and effects with other recordings held out.

        Raises:
            InputError: an unknown effect, or recordings that can't be cut (see `experiments.cutting_record`).
        """
        known = [n for n in effects("cutting") if n != "onset"]
        for name in names or ():
            if name not in known:
                raise unknown("effect of cutting", name, known)
        tried = [effects("cutting")[n].in_cuts() for n in known if not names or n in names]
        acting = (suited("onset", "cutting"), *(o.effect for o in tried))
        model = Model(energy, Quadratic(), acting, cohesion=law("bilinear"))
        p = predictor(model, sample, (*fitted, *held_out)) if like is None else like._p
        paths, recordings = p.paths_of, p.sample.recordings

        def cut(name: str, channel: str, _: int) -> Driven:
            path, time = paths[name], np.asarray(recordings[name].channels[channel].time, float)
            return np.interp(time, path.time, path.x), "place", "m"

        def moving(name: str, channel: str) -> np.ndarray:
            return steady(paths[name], np.asarray(recordings[name].channels[channel].time, float))

        measured = Series.of(p.sample, dict.fromkeys((*fitted, *held_out), (FORCE,)), cut, taking=moving, lost=True)
        segments, y = measured.segments, measured.y
        kept = {s.recording: place for s, place in zip(segments, measured.places, strict=True)}
        stated = {n: recordings[n].channels[FORCE].noise_std for n in kept}
        sigmas = [np.full(len(s.time), stated[s.recording] or 0.02 * float(np.abs(y[s.rows]).max())) for s in segments]
        deep = max(float(path.depth.max()) for path in p.paths_of.values())
        top = float(np.quantile(np.abs(y), 0.95)) / max(deep, 1e-6)
        start = {q: float(d.default) for q, d in model.declared.items()}
        start |= {"cohesion.energy": 0.8 * top} | _modulus(model, p, WEDGING * top)
        declared = model.declared
        free = {q: _free(d) for q, d in declared.items()}
        free["cohesion.energy"] = Free(1e-3 * top, 1e2 * top, 0.1, "J/m^2", log=True)
        K = start["volumetric.K"]
        free["volumetric.K"] = Free(1e-4 * K, 1e2 * K, 0.3, "Pa", log=True)
        candidates = {c.key: c for offer in tried for c in _forms(offer, fitted)}
        for c in candidates.values():
            for q in c.amplitudes:
                if q not in free:  # of each stroke's own
                    free[q], start[q] = free[q.rsplit(".", 1)[0]], 0.0
        bench = cls(segments, y, np.concatenate(sigmas), fitted, held_out, BASE, free, start, candidates)
        bench._p, bench._order, bench._kept = p, list(declared), kept
        plain = p.model.across(())
        bench._key = repr(plain)
        _models.setdefault(bench._key, plain)
        if like is None:
            seen = {n: np.asarray(p.sample.recordings[n].channels[FORCE].time, float) for n in p.names}
            ways = {n: Path(*(np.asarray(x) for x in p.paths_of[n])) for n in p.names}
            bench._paths = {n: (ways[n], ages(ways[n]), seen[n]) for n in p.names}
        else:
            bench._paths = like._paths
        bench.bevels = {n: bevel_of(w) for n, w in p.paths_of.items()}
        clocks = {s.recording: s.time for s in segments}
        bench.fresh = {n: np.interp(clocks[n], w.time, w.fresh * (w.speed > 0)) for n, w in p.paths_of.items()}
        return bench

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`."""
        return self._rows(values, recordings, _force, (len(self.y),))

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        shape = (len(self.y), len(self._order))
        whole = self._rows(values, recordings, _slopes, shape)
        out = np.zeros((len(self.y), len(paths)))
        for s in self.segments:
            for k, path in enumerate(paths):
                source = path if path in self._order else path.rsplit(".", 1)[0]
                theirs = path == source and self._own(source, s.recording) not in values
                if theirs or path == self._own(source, s.recording):
                    out[s.rows, k] = whole[s.rows, self._order.index(source)]
        return out

    def _own(self, path: str, recording: str) -> str:
        """What a parameter is called where a stroke has one for itself."""
        return f"{path}.{recording}"

    def _vector(self, values: Mapping[str, float], recording: str) -> Float[np.ndarray, " p"]:
        """What counts in a recording: its own value, the common one, or neutral."""
        return np.array([float(values.get(self._own(q, recording), values.get(q, self.start[q]))) for q in self._order])

    def _rows(self, values, recordings, of, shape):
        out = np.zeros(shape)
        for s in self.segments:
            if recordings is None or s.recording in recordings:
                vector = jnp.asarray(self._vector(values, s.recording))
                found = of(self._key, vector, *self._paths[s.recording])
                out[s.rows] = np.asarray(found)[self._kept[s.recording]]
        self.counted.cost += 1.0 if of is _force else 10.0
        return out


_models: dict[str, Model] = {}  # by their description: one program serves all benches of a model and a length


@partial(jax.jit, static_argnums=0)
def _force(key: str, vector, path, since, time):
    """Force at the sensor's times from a vector of declared values."""
    model = _models[key]
    values = dict(zip(model.declared, vector, strict=True))
    channels = {FORCE: Channel(path.time, balance_force(model, values, path, since), "N")}
    for effect in reversed(model.ordered):
        channels = effect.channels(under(f"effects.{effect.name}", values), None, channels)
    return jnp.interp(time, channels[FORCE].time, channels[FORCE].values)


@partial(jax.jit, static_argnums=0)
def _slopes(key: str, vector, path, since, time):
    """Its derivative by the vector."""
    return jax.jacfwd(lambda v: _force(key, v, path, since, time))(vector)


def strokes_to_settle(sample: Sample, bench: CuttingBench, verdict) -> list[str]:
    """Sentences on the strokes that would tell the answer from its first rival, best first; none without a rival."""
    if not verdict.rivals:
        return []
    model, pair = bench._p.model.across(()), (verdict.chosen, verdict.rivals[0])
    fits = [(model, {q: float(r.all.get(q, bench.start[q])) for q in bench._order}) for r in pair]
    strokes = next_cut(sample, bench.fitted[0], *fits)
    names = [" and ".join(r.keys) or "nothing" for r in (verdict.chosen, verdict.rivals[0])]
    return [
        f"{names[0]} or {names[1]}? {s.what} would tell: they differ there by {s.apart:.0f} times the noise"
        for s in strokes[:2]
        if s.apart > 3
    ]


def _forms(offer: Offer, strokes: tuple[str, ...]) -> list[Candidate]:
    """An effect as the bench tries it, each form beside the others; of each stroke's own where there are several."""
    e, forms = offer.effect, [f for f in offer.forms if not f.each or len(strokes) > 1]
    found = []
    for form in forms:
        paths = {q: f"effects.{e.name}.{q}" for q in form.free}
        own = tuple(f"{paths[q]}.{r}" for r in strokes for q in form.each)
        common = tuple(paths[q] for q in form.free if q in e.amplitudes and q not in form.each)
        shapes = tuple(paths[q] for q in form.free if q not in e.amplitudes)
        grid = settings(form.grid, {q: [path] for q, path in paths.items()})
        found.append(Candidate(e.name, (*common, *own), shapes, grid, form=form.name, widens=dict(form.widens)))
    return [replace(c, beside=tuple(o.key for o in found if o is not c)) for c in found]


def _free(declared) -> Free:
    return Free(declared.lower, declared.upper, declared.typical, declared.unit)


def _modulus(model: Model, p, wedging: float) -> dict[str, float]:
    """Moduli of the energy scaled so that wedging makes `wedging` of the force per depth, N/m, at a bulk modulus of
    `STIFF` shear moduli."""
    path = next(iter(p.paths_of.values()))
    values = {q: float(d.default) for q, d in model.declared.items()}
    moduli = [q for q, d in model.declared.items() if q.startswith("energy.") and d.unit == "Pa"]
    shear = float(
        model.energy.initial_shear_modulus(
            {q.split(".", 1)[1]: v for q, v in values.items() if q.startswith("energy.")}
        )
    )
    values["volumetric.K"] = STIFF * shear
    scale = wedging / max(float(layer(model, values, path.half, path.thickness).energy), 1e-12)
    return {q: values[q] * scale for q in (*moduli, "volumetric.K")}
