"""Does what was found on one specimen hold on another?

The parameters of the effects stay as they were found elsewhere (shares, times, exponents: what belongs to the material
and not to the specimen). The new specimen brings only its own base parameters, as many with the effects as without,
and whatever belongs to its own mounting (`own`: a gap, an offset). So a misfit that falls speaks for the effect and not
for more freedom.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tissuejax.diagnosis.material import MaterialBench
from tissuejax.diagnosis.misfit import white
from tissuejax.diagnosis.refit import Descent
from tissuejax.energies.energy import Energy
from tissuejax.estimation.sigma import sigmas
from tissuejax.recordings.recording import Sample


@dataclass(frozen=True)
class Transfer:
    """One specimen with and without effects that were found on others.

    Attributes:
        sample: its name.
        peak: largest stress measured, Pa.
        before: RMSE of the base model fitted here, Pa.
        carried: RMSE with the effects as found elsewhere and the base fitted here, Pa.
        base: base parameters (and `own` ones) of the second fit.
    """

    sample: str
    peak: float
    before: float
    carried: float
    base: dict[str, float]

    @property
    def explained(self) -> float:
        """Share of the base's squared misfit that the effects remove without being fitted here."""
        return 1 - (self.carried / self.before) ** 2

    def as_dict(self) -> dict:
        """Plain numbers, SI."""
        return {
            "peak": self.peak,
            "rmse_before": self.before,
            "rmse_carried": self.carried,
            "explained": self.explained,
            "parameters": self.base,
        }


def transfer(
    sample: Sample,
    energy: Energy,
    effects: Sequence[str],
    values: Mapping[str, float],
    own: Sequence[str] = (),
    recordings: Sequence[str] | None = None,
) -> Transfer:
    """Fit the base of `energy` to `sample` twice: alone, and with `effects` held at `values`.

    Args:
        effects: names of the effects that `values` and `own` belong to.
        values: paths of effect parameters and what they are held at.
        own: paths of effects fitted here in the second fit.
        recordings: all by default.
    """
    names = tuple(recordings or sample.recordings)
    sigma, _ = sigmas(sample, names)
    bench = MaterialBench.of(sample, energy, names, (), sigma, effects)
    misfit = white(bench)

    def rmse(paths: Sequence[str], rest: Mapping[str, float], start: Mapping[str, float]) -> tuple[float, dict]:
        descent = Descent(bench, misfit, tuple(paths), names, dict(rest))
        ended = descent.run(descent.point({**bench.start, **start}), 60, 1e-3)
        left = bench.y - descent.prediction(ended)
        return float(np.sqrt(np.mean(left**2))), descent.natural(ended.y)

    before, alone = rmse(bench.base, {}, {})
    carried, base = rmse((*bench.base, *own), values, alone)
    return Transfer(sample.name, float(np.max(np.abs(bench.y))), before, carried, base)
