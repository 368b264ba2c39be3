"""Cuts: the force by the balance of energies, which takes no time, and a discrepancy along the path."""

from collections.abc import Callable
from typing import ClassVar

from tissuejax.diagnosis.cutting import CuttingBench, strokes_to_settle
from tissuejax.diagnosis.cutting_discrepancy import cutting_discrepancy
from tissuejax.diagnosis.judgement.answer import Answered
from tissuejax.diagnosis.judgement.blocks import Blocks, blocks
from tissuejax.diagnosis.kinds.recorded import Question, Recorded
from tissuejax.diagnosis.known import tell
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.estimation.discrepancy import Discrepancy

ASSUMED = (
    "the tissue's stiffness is not in a cut: friction and toughness are relative to an assumed one, and their errors "
    "hold nothing of it. What another test found can be told: --with energy.{}=... --with volumetric.K=..."
)


class Cuts(Recorded):
    """See `Recorded`."""

    name: ClassVar[str] = "cutting"

    @classmethod
    def of(cls, question: Question) -> "Cuts":
        """See `Recorded.of`."""
        q = question
        whole = CuttingBench.of(q.sample, q.energy, q.every, (), q.tried)
        shown = CuttingBench.of(q.sample, q.energy, q.fitted, q.held_out, q.tried, whole)
        for bench in (shown, whole):
            tell(bench, q.known)
        told = {*q.known.get("energy", ()), *q.known.get("volumetric", ())}
        moduli = {d.name for d in q.energy.parameters if d.unit == "Pa"}
        return cls(question, shown, whole, remarks=[] if moduli <= told else [ASSUMED.format(sorted(moduli - told)[0])])

    def left(self) -> tuple[Blocks, Discrepancy]:
        """See `Recorded.left`."""
        criteria, whole = self.question.criteria, self.whole
        cut = blocks(whole, means=criteria.means)
        return cut, cutting_discrepancy(whole, cut, whole.fresh, whole.bevels, criteria)

    def finished(self, found: Answered) -> Diagnosis:
        """See `Recorded.finished`."""
        q = self.question
        found.bench.warnings += strokes_to_settle(q.sample, found.bench, found)
        return Diagnosis(q.sample.name, q.label, found, 0.0, experiment=self.name)

    def report_to(self, ran: Callable[[int], None]) -> None:
        """See `Recorded.report_to`; nothing is simulated."""
