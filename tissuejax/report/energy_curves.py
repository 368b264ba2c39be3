"""An energy with given constants: nominal stress in three modes, and where the material is stable."""

import textwrap
from dataclasses import dataclass
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from tissuejax.energies.catalogue import name_of
from tissuejax.energies.energy import Energy
from tissuejax.energies.stability import Stability, stability
from tissuejax.errors import InputError
from tissuejax.experiments.catalogue import experiment
from tissuejax.model import Model
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel, Recording
from tissuejax.report.plot import INK, SERIES, Plot, grid
from tissuejax.report.scales import display

POINTS = 161


@dataclass(frozen=True)
class Material:
    """A model with values, over a range of stretches: what this plot pictures."""

    model: Model
    values: dict[str, float]
    within: tuple[float, float] = (0.6, 1.6)

    @property
    def constants(self) -> dict[str, float]:
        """Of the energy, by their own names."""
        return {p.removeprefix("energy."): v for p, v in self.values.items() if p.startswith("energy.")}

    @property
    def energy(self) -> Energy:
        """The strain energy."""
        return self.model.energy


@dataclass(frozen=True)
class Curves:
    """Stretch, stress by mode in Pa, stability, title, constants in words."""

    title: str
    constants: str
    stretch: Float[np.ndarray, " n"]
    stress: dict[str, Float[np.ndarray, " n"]]
    stability: Stability


class EnergyCurves(Plot):
    """Stress-stretch curves of a material."""

    name: ClassVar[str] = "energy"
    subject: ClassVar[type] = Material
    order: ClassVar[int] = 10

    def prepare(self, subject: Material) -> Curves:
        """Elastic stress in the modes of the stability test; effects are left out."""
        check = stability(subject.energy, subject.constants, subject.within)
        model = Model(subject.energy)
        own = {path: jnp.asarray(v) for path, v in subject.values.items() if path in model.parameters}
        stress, base = {}, np.linspace(*subject.within, POINTS)
        for mode, path in check.paths.items():
            valid = (base >= path.stretch[0]) & (base <= path.stretch[-1])
            inputs = {"time": np.arange(POINTS, dtype=float), "stretch": np.where(valid, base, 1.0)}
            recording = Recording(
                mode, mode, inputs, {"nominal_stress": Channel(inputs["time"], np.zeros(POINTS), "Pa")}
            )
            try:
                predicted = experiment(mode).predict(model, own, recording).channels["nominal_stress"].values
            except InputError:
                continue
            stress[mode] = np.where(valid, np.asarray(predicted), np.nan)
        said = ", ".join(_constant(p, subject.constants[p.name]) for p in subject.energy.parameters)
        return Curves(name_of(subject.energy), said, base, stress, check)

    def caption(self, data: Curves) -> str:
        """The finding on stability."""
        return f"Nominal stress of {data.title} ({data.constants}), incompressible. {data.stability.sentence}"

    def draw(self, data: Curves) -> Figure:
        """Stress left, least eigenvalue of the stability test right."""
        figure, (left, right) = grid(2, columns=2, height=3.4)
        size = np.nanmax(np.abs(np.concatenate([*data.stress.values()])))
        factor, unit = display("Pa", float(size))
        for colour, (mode, stress) in zip(SERIES, data.stress.items(), strict=False):
            left.plot(data.stretch, stress / factor, color=colour, label=mode)
        left.set_title(textwrap.fill(f"{data.title}: {data.constants}", 60), loc="left", fontsize=9.5, color=INK)
        left.set_xlabel("stretch")
        left.set_ylabel(f"nominal stress ({unit})")
        left.axhline(0, color=INK, linewidth=0.5)
        left.legend(frameon=False, fontsize=8)
        biggest = max(float(np.nanmax(np.abs(p.least))) for p in data.stability.paths.values())
        factor, unit = display("Pa", biggest)
        for colour, (mode, path) in zip(SERIES, data.stability.paths.items(), strict=False):
            right.plot(path.stretch, path.least / factor, color=colour, label=mode)
        right.axhspan(min(right.get_ylim()[0], -0.02 * biggest / factor), 0, color="#f6e0d8", zorder=0)
        right.set_xlabel("stretch")
        right.set_ylabel(f"least stiffness of Drucker's test ({unit})")
        right.set_title("unstable where below zero", loc="left", fontsize=9.5, color=INK)
        return figure


def _constant(parameter: Parameter, value: float) -> str:
    """ "C10 = 1 kPa"."""
    factor, unit = display(parameter.unit, abs(value))
    return f"{parameter.name} = {value / factor:.4g}" + ("" if unit == "1" else f" {unit}")
