"""Material tests: predictions in closed form, a discrepancy of laws, of times and of the rig's hysteresis."""

from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np

from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.foreseen import OPEN, foreseen
from tissuejax.diagnosis.judgement.answer import Answered
from tissuejax.diagnosis.judgement.blocks import Blocks, blocks, series
from tissuejax.diagnosis.judgement.judge import Kind
from tissuejax.diagnosis.kinds.recorded import Question, Recorded
from tissuejax.diagnosis.known import tell
from tissuejax.diagnosis.material import MaterialBench, strain_states
from tissuejax.diagnosis.next_experiment import proposals, settling
from tissuejax.diagnosis.offered import offered, paced
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.diagnosis.thinned import thinned
from tissuejax.estimation.discrepancy import Discrepancy, discrepancy
from tissuejax.estimation.sigma import sigmas
from tissuejax.recordings.recording import Sample


class MaterialTests(Recorded):
    """See `Recorded`."""

    name: ClassVar[str] = "homogeneous"

    @classmethod
    def of(cls, question: Question) -> "MaterialTests":
        """See `Recorded.of`."""
        q, left_out = question, []
        sigma, remarks = sigmas(q.sample, q.every)
        made = []
        for fitted, held_out in ((q.fitted, q.held_out), (q.every, ())):
            bench = MaterialBench.of(q.sample, q.energy, fitted, held_out, sigma, q.tried)
            tell(bench, q.known)
            bench.candidates, left_out = offered(q.sample, bench.candidates, q.effects, q.criteria.shown)
            made.append(bench)
        return cls(question, *made, remarks=remarks + left_out)

    def left(self) -> tuple[Blocks, Discrepancy]:
        """See `Recorded.left`."""
        criteria, whole = self.question.criteria, self.whole
        cut = blocks(whole, means=criteria.means)
        stacked = series(whole, cut, strain_states(whole), criteria.smooth, criteria.means, whole.starts)
        changing = paced(self.question.sample, criteria.shown)
        return cut, discrepancy(stacked, cut.spread(whole.sigma), changing, at_once=True, smooth=criteria.smooth)

    def searched(self, cut: Blocks) -> Bench:
        """See `Recorded.searched`."""
        return thinned(self.whole, cut)

    def finished(self, found: Answered) -> Diagnosis:
        """See `Recorded.finished`; what the fitted recordings leave open in the others is said too."""
        q = self.question
        shares, kinds = q.criteria.shares, {r.experiment for r in q.sample.recordings.values()}
        planned = (proposals(q.sample, q.energy, found.bench, found.chosen, r, None, shares) for r in found.rivals)
        open_ends = []
        if found.kind != Kind.UNEXPLAINED:
            keys = frozenset(found.chosen.keys)
            open_ends = foreseen(found.bench, found.whitenings[keys], found.plain[keys])
            found.bench.warnings += [x.sentence(found.chosen) for x in open_ends if x.over_noise > OPEN]
        return Diagnosis(q.sample.name, q.label, found, 0.0, settling(list(planned), done=kinds), [], open_ends)

    def predicted(self, whole: Sample, names: Sequence[str], found: Answered) -> dict[str, dict[str, float]]:
        """See `Recorded.predicted`: by parameters alone, those of a recording's own at neutral; Pa."""
        q = self.question
        sigma, _ = sigmas(whole, (*q.every, *names))
        bench = MaterialBench.of(whole, q.energy, q.every, tuple(names), sigma, q.tried)
        tell(bench, q.known)
        out: dict[str, dict[str, float]] = {}
        for label, values in (("before", found.empty.values), ("after", found.chosen.values)):
            left = bench.y - bench.predict(values)
            for name in names:
                rows = bench.mask((name,))
                out.setdefault(name, {})[label] = float(np.sqrt(np.mean(left[rows] ** 2)))
        for name in names:
            rows = bench.mask((name,))
            out[name] |= {"noise": float(np.mean(bench.sigma[rows])), "n": int(np.sum(rows))}
        return out

    def report_to(self, ran: Callable[[int], None]) -> None:
        """See `Recorded.report_to`; nothing is simulated."""
