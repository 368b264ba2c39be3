"""The bench of cuts: the force against the motion by the balance of energies, with every effect of cutting in it.

A prediction takes microseconds, so the search of material tests serves cuts as it is. The balance has no law of
parting: at the entry it lets the force set in over a length, which belongs to the base model with the toughness, and
where the blade rests, turns or comes to the end of an older cut its samples are left out.

The tissue's own modulus is scaled to the size of the force, and wedging follows the volumetric modulus, which is fitted
with the base: a return stroke or a second pass tells it from toughness. A friction coefficient is relative to that
modulus (`tissuejax cut fit` with the measured one gives the number).
"""

from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from tissuejax.cohesion.catalogue import law
from tissuejax.diagnosis.bench import Bench, Candidate, Free, Segment
from tissuejax.diagnosis.next_cut import next_cut
from tissuejax.effects.catalogue import effects, suited
from tissuejax.energies.energy import Energy
from tissuejax.energies.volumetric import Quadratic
from tissuejax.errors import unknown
from tissuejax.experiments.cutting_record import FORCE, steady
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

BASE = ("cohesion.energy", "effects.onset.longer", "volumetric.K")
STIFF = 10.0  # bulk over shear modulus where the tissue is not known
WEDGING = 0.05  # share of the force that the modulus gives to wedging at the start


class CuttingBench(Bench):
    """Cuts of one sample; see `Bench`."""

    @classmethod
    def of(
        cls, sample: Sample, energy: Energy, fitted: tuple[str, ...], held_out: tuple[str, ...], names=None
    ) -> "CuttingBench":
        """The bench of `sample` with base model `energy`; `names`: effects to try, all of cutting by default.

        Raises:
            InputError: an unknown effect, or recordings that can't be cut (see `experiments.cutting_record`).
        """
        known = [n for n in effects("cutting") if n != "onset"]
        for name in names or ():
            if name not in known:
                raise unknown("effect of cutting", name, known)
        tried = [suited(n, "cutting") for n in known if not names or n in names]
        model = Model(energy, Quadratic(), (suited("onset", "cutting"), *tried), cohesion=law("bilinear"))
        p = predictor(model, sample, (*fitted, *held_out))
        segments, ys, sigmas, at, kept = [], [], [], 0, {}
        for name in p.names:
            seen, path = p.sample.recordings[name].channels[FORCE], p.paths_of[name]
            kept[name] = np.flatnonzero(steady(path, np.asarray(seen.time, float)))
            y, time = np.asarray(seen.values, float)[kept[name]], np.asarray(seen.time, float)[kept[name]]
            rows, at = slice(at, at + len(y)), at + len(y)
            drive = np.interp(time, path.time, path.x)
            segments.append(Segment(name, FORCE, "", rows, time, "N", drive, "place", "m"))
            ys.append(y)
            sigmas.append(np.full(len(y), seen.noise_std or 0.02 * float(np.abs(y).max())))
        y = np.concatenate(ys)
        deep = max(float(path.depth.max()) for path in p.paths_of.values())
        top = float(np.quantile(np.abs(y), 0.95)) / max(deep, 1e-6)
        start = {q: float(d.default) for q, d in model.declared.items()}
        start |= {"cohesion.energy": 0.8 * top} | _modulus(model, p, WEDGING * top)
        declared = model.declared
        free = {q: _free(d) for q, d in declared.items()}
        free["cohesion.energy"] = Free(1e-3 * top, 1e2 * top, 0.1, "J/m^2", log=True)
        K = start["volumetric.K"]
        free["volumetric.K"] = Free(1e-4 * K, 1e2 * K, 0.3, "Pa", log=True)
        candidates = {
            e.name: Candidate(
                e.name, tuple(f"effects.{e.name}.{a}" for a in e.amplitudes),
                tuple(f"effects.{e.name}.{k}" for k in e.grid),
                tuple({f"effects.{e.name}.{k}": v for k, v in s.items()} for s in e.settings(1.0)) or ({},),
            )
            for e in tried
        }  # fmt: skip
        bench = cls(segments, y, np.concatenate(sigmas), fitted, held_out, BASE, free, start, candidates)
        bench._p, bench._order, bench._programs, bench._kept = p, list(declared), {}, kept
        bench.warnings.append(
            "the tissue's modulus is not in a cut: a friction coefficient is relative to an assumed one"
        )
        return bench

    def predict(self, values: Mapping[str, float], recordings: Sequence[str] | None = None) -> Float[np.ndarray, " N"]:
        """See `Bench.predict`."""
        return self._rows(values, recordings, "run", lambda name: lambda v: self._p.force(name, v)[0], (len(self.y),))

    def jacobian(
        self, values: Mapping[str, float], paths: Sequence[str], recordings: Sequence[str] | None = None
    ) -> Float[np.ndarray, "N k"]:
        """See `Bench.jacobian`."""
        shape = (len(self.y), len(self._order))
        make = lambda name: jax.jacfwd(lambda v: self._p.force(name, v)[0])  # noqa: E731
        whole = self._rows(values, recordings, "slope", make, shape)
        return whole[:, [self._order.index(q) for q in paths]]

    def _rows(self, values, recordings, kind, make, shape):
        vector = jnp.array([float(values.get(q, self.start[q])) for q in self._order])
        out = np.zeros(shape)
        for s in self.segments:
            if recordings is None or s.recording in recordings:
                key = (s.recording, kind)
                if key not in self._programs:
                    self._programs[key] = jax.jit(make(s.recording))
                out[s.rows] = np.asarray(self._programs[key](vector))[self._kept[s.recording]]
        self.spent += 1.0 if kind == "run" else 10.0
        return out


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


def _free(declared) -> Free:
    return Free(declared.lower, declared.upper, declared.typical, declared.unit)


def _modulus(model: Model, p, wedging: float) -> dict[str, float]:
    """Moduli of the energy scaled so that wedging makes `wedging` of the force per depth, N/m, at a bulk modulus of
    `STIFF` shear moduli."""
    from tissuejax.experiments.cutting import layer

    path = next(iter(p.paths_of.values()))
    values = {q: float(d.default) for q, d in model.declared.items()}
    moduli = [q for q, d in model.declared.items() if q.startswith("energy.") and d.unit == "Pa"]
    shear = float(
        model.energy.initial_shear_modulus(
            {q.split(".", 1)[1]: v for q, v in values.items() if q.startswith("energy.")}
        )
    )
    values["volumetric.K"] = STIFF * shear
    scale = wedging / max(float(layer(model, values, path.half, path.thickness)[0]), 1e-12)
    return {q: values[q] * scale for q in (*moduli, "volumetric.K")}
