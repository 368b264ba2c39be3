"""Which candidates these probings can speak of: none that needs what was not done (`Effect.needs`)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tissuejax.diagnosis.bench import Candidate
from tissuejax.diagnosis.judgement.particular import SHOWN, Shown
from tissuejax.diagnosis.offered import motion, speaking, widened
from tissuejax.effects.catalogue import needs
from tissuejax.estimation.series import Segment


@dataclass(frozen=True)
class Pressed:
    """What was done in the probings of a sample.

    Attributes:
        several: the force of several recordings was measured, pressed into the tissue each; all pass the depths of the
            shallowest, so a gain of each one's own is no law that fails to carry from one depth to another.
        reversed: some force was measured while the probe went back; before that, whatever remembers the way is a
            function of the depth.
        sampled: the longest series of the force has enough samples to hold some periods of a hum.
    """

    several: bool
    reversed: bool
    sampled: bool

    @classmethod
    def of(cls, segments: Sequence[Segment], shown: Shown = SHOWN) -> "Pressed":
        """Of the series of a bench, whose drive is the depth."""
        forces = [s for s in segments if s.channel == "force"]
        deep = [s for s in forces if float(np.ptp(s.drive)) > 0]
        return cls(
            several=len({s.recording for s in deep}) > 1,
            reversed=any(motion(np.asarray(s.time), np.asarray(s.drive), shown)[0] for s in deep),
            sampled=max((len(s.time) for s in forces), default=0) >= shown.readings,
        )


WITHOUT: Mapping[str, str] = {  # property of the probings: what is said where it is not there
    "several": "there is one force only, whose gain is that of the moduli",
    "reversed": "no force was measured while the probe went back",
    "sampled": "the force has too few samples to hold some periods",
}


def pressed(
    segments: Sequence[Segment],
    candidates: Mapping[str, Candidate],
    names: Sequence[str] | None = None,
    shown: Shown = SHOWN,
) -> tuple[dict[str, Candidate], list[str]]:
    """Candidates that probings can show, and remarks on what was left out.

    Args:
        names: effects asked for; all by default.
        shown: from when on a protocol shows something.
    """
    protocol = Pressed.of(segments, shown)
    return speaking(widened(candidates, protocol, names), protocol, needs("probing"), WITHOUT)
