"""All numbers that make a verdict of recordings in one record, each with unit, meaning and ground.

How much is tried is `effort.Effort`; both together are `numbers.Numbers`. Numbers that only round stand where they do.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tissuejax.diagnosis.judgement.particular import MEANS, SHOWN, SIMULATED, STROKES, Means, Shown, Simulated, Strokes
from tissuejax.errors import unknown
from tissuejax.estimation.correlation import MISSTATED
from tissuejax.estimation.level import OF_NOTE
from tissuejax.estimation.smoothness import USUAL, Smoothness


@dataclass(frozen=True)
class Criteria:
    """What is held for probable before a recording is seen, and where an answer changes its name.

    Attributes:
        sizes: probability that 0, 1, 2, 3 effects of the catalogue act that the base model lacks. Ground: as often
            something as nothing, and rarely much at once; spread evenly over the names, and over the forms of a name.
        fault: how much rarer a fault of a test machine is than what a law lacks, name for name, unless a user says what
            is known of the machine (`Criteria.of_rig`). Ground: the evidence of 85 real samples, no cause read, is
            likeliest at 0.01 (0.03 and less; `fits/real-panel/rarity.py`), and what is published was looked through for
            faults. Of a hand or a robot that presses or cuts no such set of recordings is known: there both are alike.
        rigs: the same by what else is known of a machine: how its load train gives, when its channels read and where
            they count from was measured; or nothing of that was ever looked at. Ground: as of published recordings (see
            `fault`); a fault is as likely as anything else.
        unknown: probability that the discrepancy is far larger than usual in one of its parts: something acts that the
            catalogue doesn't have, beside whatever else acts. Ground: as likely as two effects at once.
        coarse: how many block means with a rest it takes to tell a model that is nearly right from the truth: the
            evidence of n of them is raised to the power coarse / (coarse + n). Ground: the discrepancy's parts are not
            those of the truth, so a posterior is too narrow, the more so the more data (coarsening: Miller and Dunson
            2019, J. Am. Stat. Assoc. 114). Its size is calibrated: of 48 opened cases with a rest that no part is like,
            n about 400, it makes 85 % of the answers right, and all of the evidence 73 %. Where the likeliest set
            leaves noise there is no rest to be wrong about, and all of the evidence counts: n is the number of block
            means times the share of what is left that is not noise.
        shares: standard deviation of the half-normal prior of a discrepancy's amplitude, a share of the stress, by
            family. Ground: what the best published laws leave of careful recordings, 1 to 4 % of the peak in all; of a
            surface that is met early or late, of the depth of a press; of a blade's entry, the peak that its shoulder
            ends (5 % in opened cases of an elastic foundation); of a marker, of what it moved (it is not quite where it
            was registered); of the law of a tissue's effect, of what that effect does and the base could not (two
            exponentials and a constant leave 3, 7 and 10 % of a relaxation by a power of time over two, three and four
            decades; with it the right answers of `fits/real-panel` err by 10.5 %, which is no independent ground); of
            the numerical error, in units of what mesh and speed leave open by Richardson's extrapolation; of a zero,
            half a per cent of the range of the strain (extensometers are verified to 0.5 or 1 %, ISO 9513; a specimen
            is set to zero by hand or at a threshold of force); of a clock, one sample.
        strange: by which factor such a part is wider. Ground: 10 makes of 1 to 2 % the 10 to
            20 % by which effects of the catalogue change a recording.
        partly: chance that a part which one form of an effect widens is wide beside another form of it. Ground: as
            likely as not.
        settled: families that are never wider: what they are is known, or (an added law) nothing but what another part
            is already (a law beside the base is a share of the stress), or it has a name from there on (slack, a clock
            that lags).
        sudden: standard deviation of the half-normal prior of what happens at once, where something does: share of the
            stress. Ground: a slip or a step worth a word is some per cent to a third of what is measured. Elsewhere it
            is `shares["sudden"]`: as good as nothing.
        recurs: probability that something happens at once again where it has once. Ground: as likely as not; a grip
            that slips and a recorder that skips do so more than once.
        change: standard deviation of the half-normal (two-sided: normal) prior of an effect's amplitude: the change of
            the stress that it makes alone, as a share of the stress (root mean squares). Ground: effects worth a name
            are some per cent to a half of what is measured.
        rig: the same of a fault of the rig (`Effect.order` 0). Ground: a tenth of all that is measured is as far as a
            rig goes wrong unnoticed; most are verified to 1 %.
        shape: standard deviation of the logarithm of a positive shape (time, energy, exponent) about the middle of
            the values scanned. Ground: a factor of 5 either way.
        lapse: probability that evidence of simulated experiments says nothing: the search missed the set, or the
            simulation errs as no part of the discrepancy does. Ground: of 24 sealed probings on a mesh that resolves
            their markers (`fits/challenge/probing-fifth`, `-sixth`) maximum likelihood of the answers' being true is at
            0.22 (0.08 to 0.43); the 24 after them, blind to it, state 0.75 where 0.83 are true (`-seventh`).
        loose: the same of a shape of either sign, in its typical steps. Ground: as wide.
        negligible: root mean square of the rest, as a share of the peak, up to which nothing of note is left.
            Ground: load cells are verified to 1 % (class 1 of ISO 7500-1); half of that.
        unseen: share of a sensor's noise, of single samples, up to which a rest of a simulation is negligible too.
            Ground: markers are seen to a tenth of what most of them move; half of that shows in no picture.
        alike: neighbouring means of samples of which a rest is one, in how surely its size is known. Ground: a rest is
            smooth, and as many lie within its finer lengths.
        misstated: factor by which a stated noise level is wrong, as a rule (standard deviation of its logarithm): what
            scatters from sample to sample is noise of a level that was stated wrong, or a rest of its own, as large as
            what is `strange`, with the probability that there is something `unknown`. Ground: a level read off a rest,
            or off another channel, is seldom wrong by more than twice that.
        named: probability from which a name is given. Ground: likelier present than not (the median probability model
            of Barbieri and Berger 2004).
        covered: share of the probability of named sets that the alternatives offered add up to. Ground:
            nine of ten, as an interval is usually given.
        strong: odds from which a form is shown in place of a plainer one inside it. Ground: "strong" in the
            scale of Kass and Raftery (J. Am. Stat. Assoc. 90, 1995).
        twins: relative difference up to which two relaxation times are one. Ground: no recording tells two so near from
            one.
        smooth, shown, means, simulated, strokes: see `Smoothness`, `Shown`, `Means`, `Simulated`, `Strokes`.
    """

    sizes: tuple[float, ...] = (0.4, 0.4, 0.15, 0.05)
    fault: float = 0.1
    rigs: Mapping[str, float] = field(default_factory=lambda: {"verified": 0.01, "unchecked": 1.0})
    unknown: float = 0.1
    coarse: float = 200.0
    shares: Mapping[str, float] = field(
        default_factory=lambda: (
            {"law": 0.015, "gain": 0.015, "hysteresis": 0.01, "added law": 0.01, "slow": 0.01, "white": 0.005}
            | {"zero": 0.005, "clock": 1.0}
            | {"marker gain": 0.015, "crosstalk": 0.015}
            | {"effect": 0.1, "marker": 0.02, "onset": 0.01, "peak": 0.05, "numerical": 1.0, "sudden": 1e-4}
        )
    )
    strange: float = 10.0
    partly: float = 0.5
    settled: frozenset[str] = frozenset({"peak", "effect", "added law", "zero", "clock"})
    sudden: float = 0.1
    recurs: float = 0.5
    change: float = 0.3
    rig: float = 0.1
    shape: float = float(np.log(5.0))
    lapse: float = 0.2
    loose: float = 5.0
    negligible: float = OF_NOTE
    unseen: float = 0.5
    alike: int = 10
    misstated: float = MISSTATED
    named: float = 0.5
    covered: float = 0.9
    strong: float = 20.0
    twins: float = 0.05
    smooth: Smoothness = USUAL
    shown: Shown = SHOWN
    means: Means = MEANS
    simulated: Simulated = SIMULATED
    strokes: Strokes = STROKES

    @classmethod
    def of_rig(cls, known: str) -> "Criteria":
        """The usual criteria beside what is `known` of the test machine: "verified", "usual" or "unchecked".

        Raises:
            InputError: another word.
        """
        of = cls()
        odds = {"usual": of.fault, **of.rigs}
        if known not in odds:
            raise unknown("knowledge of a rig", known, odds)
        return replace(of, fault=odds[known])

    def usual(self, rig: bool) -> float:
        """How much of the stress an effect changes, of the rig or of the tissue."""
        return self.rig if rig else self.change

    def power(self, n: int, left: float = 1.0) -> float:
        """Of the evidence of n block means, that sets are compared by; `left`: the share of a rest in what is left."""
        return self.coarse / (self.coarse + n * left)

    def happens(self, before: int) -> float:
        """Probability that something happens at once after it has so many times."""
        return self.recurs if before else self.unknown
