"""What every effect is: data about itself, parameters with a neutral value, and hooks that default to nothing.

The same file serves as known physics in a simulation, as something to fit, and as a candidate in a diagnosis.
At its neutral value an effect reproduces the Model without it to the last bit, and the derivative there exists.
"""

import abc
import itertools
from collections.abc import Callable, Mapping
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float

from tissuejax.effects.cutting_test import Cut
from tissuejax.effects.form import Offer, Price, Probed, Sizes
from tissuejax.effects.material_test import MaterialTest, Stress
from tissuejax.effects.probing_test import ProbingTest
from tissuejax.energies.strain import Strain
from tissuejax.parameters import Parameter
from tissuejax.recordings.recording import Channel
from tissuejax.tled.scene import Scene

Respond = Callable[[Array], Array]


class Effect(eqx.Module):
    """One physical or sensor effect.

    Class data:
        name: as on the command line.
        kinds: which experiments it can act in, of {"homogeneous", "probing", "cutting"}.
        reveals: what in a recording shows it.
        blind: experiments (or protocols) that can't show it.
        words: clauses that say what its fitted parameters mean, "{g1:%} of the stress relaxes with {tau1}": `:%` is a
            percentage, `:exp` the exponential, else the number with its unit. A clause is said where all parameters in
            it were fitted and its first one, or another of that unit, isn't zero; one without parameters always.
        shares: of these, parts of one whole, which together stay below it.
        needs: by kind of experiment, what a protocol must do to show it, a property of `diagnosis.offered.Protocol` or
            `diagnosis.probing_offered.Pressed`. Where it is lacking the effect is another strain energy by its deeds,
            or nothing.
        remedy: what to do where it is named and has no parameters to fit, one sentence.
        times: of its parameters, s, the ones that no recording shows below its sampling nor far beyond its length.
        timed: parameters that act in time, so that they mean nothing where no times were recorded.
        slow: of these, the ones that are another strain energy by their deeds where all is loaded at one rate and never
            held: there the time is a function of the strain.
        amplitudes: parameters that are 0 at neutral; the others ("shapes") vanish with the effect.
        grid: for each shape parameter, the values that a diagnosis scans; those of a shape in Pa count in initial shear
            moduli of the base energy, so that one grid serves brain and rubber (`settings` multiplies them out).
        order: place among the effects of a model, whatever the order in which they were added; rig 0, tissue 1,
            damage of tissue before its relaxation (2).
        isotropic: False if the strain energy depends on direction.
        remembers: of probings: False if the state depends on where the probe is now and not on how it came there; then
            what moves the probe needs no run of its own (`diagnosis.probing_free`).
        misjudged: by parameter, how far a careful experimenter misjudges it, standard deviation in its unit: the prior
            of an effect that only corrects what was noted.
        standard: values that are meant where the effect is stated without any (weight: 9.81 m/s^2).
        searches: of material tests: whether it turns every prediction into a search.
        price: how many times longer a prediction of a material test takes with that search.
        history: of material tests: whether its stress has a past, which a compiled program holds or not.
        added: whether it is added to what is reported last, a function of time alone, so that its derivative needs
            nothing else, and in a probing no simulation.
        brief: of material tests: whether it acts within some samples, so that a search predicts it in full and not of
            means (`diagnosis.thinned`).
        group: of probings: effects of one group are compiled together ("rig": in every program; "" alone).
        displaces: of probings: parameters that only move the probe towards the tissue (`diagnosis.probing_free`).
        sensed: of probings: parameters that only change what sensors report, of an effect that changes more.
        candidate: False if its size is known beforehand (weight): nothing to be found, but something to be stated.

    Hooks, in the order in which a material test applies them; each is the identity unless overridden:
        `stretch` (rig: what the specimen really saw), `energy` (added strain energy), `volume` (volume ratio from mean
        stress), `memory` (isochoric stress with history), `exerted` (nominal stress of the specimen as a whole, inside
        the rig), `stress` (rig and sensor: what the cell reports). Probing:
        `scene` (the physical set-up: probe path, support, stiffness field, contact law, memory...), `channels`
        (sensors). Cutting: `cut` (what the blade meets along its path), and `scene` and `channels` as in a probing.
    """

    name: ClassVar[str]
    kinds: ClassVar[frozenset[str]]
    reveals: ClassVar[str]
    blind: ClassVar[str]
    words: ClassVar[tuple[str, ...]] = ()
    source: ClassVar[str]
    amplitudes: ClassVar[tuple[str, ...]]
    shares: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[Mapping[str, str]] = {}
    remedy: ClassVar[str] = ""
    times: ClassVar[tuple[str, ...]] = ()
    timed: ClassVar[tuple[str, ...]] = ()
    slow: ClassVar[tuple[str, ...]] = ()
    grid: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    order: ClassVar[int] = 1
    isotropic: ClassVar[bool] = True
    remembers: ClassVar[bool] = True
    misjudged: ClassVar[Mapping[str, float]] = {}
    standard: ClassVar[Mapping[str, float]] = {}
    searches: ClassVar[bool] = False
    price: ClassVar[Price] = Price()
    history: ClassVar[bool] = False
    added: ClassVar[bool] = False
    brief: ClassVar[bool] = False
    group: ClassVar[str] = ""
    displaces: ClassVar[tuple[str, ...]] = ()
    sensed: ClassVar[tuple[str, ...]] = ()
    candidate: ClassVar[bool] = True

    @property
    @abc.abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Declared parameters; an amplitude has default 0 (neutral)."""

    @classmethod
    def in_material_tests(cls, sizes: Sizes) -> Offer:
        """What a diagnosis of material tests tries; in one form, all parameters at once, by default."""
        return Offer.whole(cls())

    @classmethod
    def in_probings(cls, sizes: Probed) -> Offer:
        """The same of probings."""
        return Offer.whole(cls())

    @classmethod
    def in_cuts(cls) -> Offer:
        """The same of cuts: its amplitudes and the shapes of its grid by default, those too that a fit holds."""
        return Offer.scanned(cls())

    @property
    def neutral(self) -> dict[str, float]:
        """The values at which the effect is exactly off."""
        return {d.name: 0.0 if d.name in self.amplitudes else d.default for d in self.parameters}

    def settings(self, modulus: float) -> tuple[dict[str, float], ...]:
        """All combinations of the grid, SI; `modulus` is the base energy's initial shear modulus, Pa."""
        units = {d.name: d.unit for d in self.parameters}
        scaled = {k: [v * modulus if units[k] == "Pa" else v for v in values] for k, values in self.grid.items()}
        return tuple(dict(zip(scaled, combination)) for combination in itertools.product(*scaled.values()))

    def stretch(
        self, p: Mapping[str, Array], test: MaterialTest, drive: Float[Array, "n ..."], respond: Respond
    ) -> Float[Array, "n ..."]:
        """Stretch (or shear) that the specimen saw, from the recorded one; `respond` gives its nominal stress, Pa."""
        return drive

    def energy(self, p: Mapping[str, Array], strain: Strain) -> Float[Array, "..."] | float:
        """Strain energy added to the base energy, Pa; `strain` is in the sample's frame."""
        return 0.0

    def volume(
        self, p: Mapping[str, Array], test: MaterialTest, mean: Float[Array, " n"], ln_J: Float[Array, " n"]
    ) -> Float[Array, " n"] | float:
        """Added logarithmic volume strain, from the mean Cauchy stress (tension positive), Pa, and the whole one."""
        return 0.0

    def memory(self, p: Mapping[str, Array], test: MaterialTest, state: Stress) -> Stress:
        """Isochoric stress with history, from the elastic one."""
        return state

    def exerted(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        """Nominal stress of the specimen over time, shape and volume alike, from that of its material."""
        return stress

    def stress(
        self, p: Mapping[str, Array], test: MaterialTest, stress: Float[Array, "n ..."]
    ) -> Float[Array, "n ..."]:
        """Nominal stress as reported, from the specimen's own."""
        return stress

    def scene(self, p: Mapping[str, Array], test: ProbingTest | None, scene: Scene) -> Scene:
        """The scene with this effect in it (see `tled/scene.py`); `test` is None for that of a cut."""
        return scene

    def channels(
        self, p: Mapping[str, Array], test: ProbingTest | None, channels: Mapping[str, Channel]
    ) -> Mapping[str, Channel]:
        """Channels ("force", "markers") as the sensors report them, from the true series on a fine clock.

        `test` is None for a cut, whose channel is "cutting_force".
        """
        return channels

    def cut(self, p: Mapping[str, Array], cut: Cut) -> Cut:
        """What a blade meets along its path with this effect in it."""
        return cut
