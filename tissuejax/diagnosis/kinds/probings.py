"""Probings: every prediction is a simulation, so few sets are tried, and what numerics leave open is known."""

from collections.abc import Callable
from typing import ClassVar

from tissuejax.diagnosis.judgement.answer import Answered
from tissuejax.diagnosis.judgement.blocks import Blocks
from tissuejax.diagnosis.judgement.effort import Course, Effort
from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.kinds.recorded import Question, Recorded
from tissuejax.diagnosis.known import tell
from tissuejax.diagnosis.next_experiment import settling
from tissuejax.diagnosis.next_probing import probing_proposals
from tissuejax.diagnosis.probing import ProbingBench
from tissuejax.diagnosis.probing_discrepancy import probing_discrepancy
from tissuejax.diagnosis.probing_map import stiffness_maps
from tissuejax.diagnosis.probing_offered import pressed
from tissuejax.diagnosis.probing_view import ProbingView, probing_blocks
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.estimation.discrepancy import Discrepancy
from tissuejax.experiments.soundness import sentences

# a set of effects costs seconds where predictions are simulations
PROBING = Effort(
    most=2,
    singles=5,
    pairs=4,
    triples=0,
    parents=(2, 0),
    reshaped=(2, 1),
    starts=1,
    spend=600.0,
    least=-1.0,
    given_up=6.0,
    stepwise=True,
    course=Course(rounds=2, iterations=4),
)


class Probings(Recorded):
    """See `Recorded`."""

    name: ClassVar[str] = "probing"

    @classmethod
    def of(cls, question: Question) -> "Probings":
        """See `Recorded.of`."""
        q = question
        own = ProbingBench.of(q.sample, q.energy, q.every, (), q.tried, q.keep)
        narrow = own.narrowed(q.fitted, q.held_out, q.tried)
        left_out: list[str] = []
        for bench in (own, narrow):
            tell(bench, q.known)
            bench.candidates, left_out = pressed(own.segments, bench.candidates, q.effects, q.criteria.shown)
        simulated, peak = q.criteria.simulated, q.criteria.means.peak
        views = (ProbingView.of(bench, simulated, peak) for bench in (narrow, own))
        return cls(question, *views, PROBING, left_out)

    def left(self) -> tuple[Blocks, Discrepancy]:
        """See `Recorded.left`."""
        cut = probing_blocks(self.whole)
        return cut, probing_discrepancy(self.whole, cut, self.question.criteria.smooth)

    def finished(self, found: Answered) -> Diagnosis:
        """See `Recorded.finished`; each planned press is a simulation. With maps of where tissue should be stiffer."""
        q, bench, maps = self.question, found.bench, []
        planned = [probing_proposals(q.sample, bench, found.chosen, r, None) for r in found.rivals[:1]]
        ideas = settling(planned)
        if found.kind != Kind.NOTHING:
            maps = stiffness_maps(bench, found.empty.values, found.empty.prediction)
        went = bench.runs.went(bench.at(found.chosen.values))
        bench.warnings += sentences(went)
        bench.runs.forget()
        return Diagnosis(q.sample.name, q.label, found, 0.0, ideas, maps, numerics=went, experiment=self.name)

    def report_to(self, ran: Callable[[int], None]) -> None:
        """See `Recorded.report_to`."""
        self.whole.shown.runs.report = ran
