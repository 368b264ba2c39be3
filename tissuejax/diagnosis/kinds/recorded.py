"""What a diagnosis has to know of the kind of recordings before it: benches, discrepancy, effort, what follows."""

import abc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.judgement.answer import Answered
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.known import Known, effects_of
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.energies.energy import Energy
from tissuejax.errors import InputError
from tissuejax.estimation.discrepancy import Discrepancy
from tissuejax.recordings.recording import Sample


@dataclass(frozen=True)
class Question:
    """What is asked of a sample.

    Attributes:
        sample: with its recordings, all of one kind.
        energy: base model; `label` what it is called.
        fitted, held_out: recordings as the user named them.
        known: physics that the base has already.
        effects: names of the effects to try, None for all; known ones left out.
        keep: folder for finished simulations.
        criteria: the numbers that make a verdict.
    """

    sample: Sample
    energy: Energy
    label: str
    fitted: tuple[str, ...]
    held_out: tuple[str, ...]
    known: Known
    effects: Sequence[str] | None
    keep: Path | None
    criteria: Criteria = field(default_factory=Criteria)

    @property
    def every(self) -> tuple[str, ...]:
        """All recordings that take part: they all choose the set of effects."""
        return (*self.fitted, *self.held_out)

    @property
    def tried(self) -> tuple[str, ...] | None:
        """Effects that a bench has to hold: those to try, and those that are known."""
        return None if self.effects is None else (*self.effects, *effects_of(self.known))


@dataclass
class Recorded(abc.ABC):
    """A question on its bench.

    Attributes:
        question: what is asked.
        bench: recordings fitted and held out as the user named them; `whole`: all of them fitted.
        effort: how much is tried unless a user says.
        remarks: sentences for the reader.
    """

    name: ClassVar[str]  # the kind, as experiments call it
    question: Question
    bench: Bench
    whole: Bench
    effort: Effort | None = None
    remarks: list[str] = field(default_factory=list)

    @classmethod
    @abc.abstractmethod
    def of(cls, question: Question) -> "Recorded":
        """The benches of a question.

        Raises:
            InputError: recordings that can't be used, an unknown effect.
        """

    @abc.abstractmethod
    def left(self) -> tuple[Blocks, Discrepancy]:
        """Block means of all that was measured, and the discrepancy that any model leaves of them."""

    def searched(self, cut: Blocks) -> Bench:
        """The bench that a search of these block means runs on."""
        return self.whole

    @abc.abstractmethod
    def finished(self, found: Answered) -> Diagnosis:
        """The diagnosis, with what should be measured next."""

    def predicted(self, whole: Sample, names: Sequence[str], found: Answered) -> dict[str, dict[str, float]]:
        """How far recordings that nothing has read are from the base and from the fit that is shown, by name.

        Args:
            whole: the sample with them.
        """
        raise InputError(f"recordings of kind {self.name!r} can't stay unread; only material tests can")

    @abc.abstractmethod
    def report_to(self, ran: Callable[[int], None]) -> None:
        """Call `ran` with the number of simulations made."""
