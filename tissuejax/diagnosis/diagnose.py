"""The diagnosis of one sample, from a recording file to a verdict."""

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
from threadpoolctl import threadpool_limits

from tissuejax.cache.crowding import make_room
from tissuejax.cache.key import key
from tissuejax.cache.programs import keep_programs
from tissuejax.diagnosis import kinds
from tissuejax.diagnosis.judgement.answer import answer, evidence_file
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.evidence import write_evidence
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.search import Setup
from tissuejax.diagnosis.kinds.recorded import Question, Recorded
from tissuejax.diagnosis.known import known_physics, label
from tissuejax.diagnosis.result import Diagnosis
from tissuejax.effects.catalogue import effects as all_effects
from tissuejax.energies.catalogue import energy as named_energy
from tissuejax.energies.energy import Energy
from tissuejax.errors import InputError, unknown
from tissuejax.experiments.catalogue import experiment
from tissuejax.experiments.probing_slips import all_slips
from tissuejax.families import lookup, members
from tissuejax.model import Model
from tissuejax.progress import Progress, Silent
from tissuejax.recordings.files import read
from tissuejax.recordings.plausible import refuse_gaps, refuse_unusable
from tissuejax.recordings.recording import Sample
from tissuejax.storage import write_json

WRONG = 1.2  # scatter over the stated noise from which that is not believed; few know theirs better


def diagnose(
    source: str | os.PathLike | Sample,
    energy: str | Energy | Model = "reduced-polynomial-2",
    holdout: str | Sequence[str] | None = None,
    out: str | os.PathLike | None = None,
    progress: Progress | None = None,
    effects: Sequence[str] | None = None,
    ogden_form: str | None = None,
    effort: Effort | None = None,
    keep: Path | None = None,
    known: Sequence[str] | Mapping[str, float] = (),
    unread: str | Sequence[str] = (),
    criteria: Criteria | None = None,
) -> Diagnosis:
    """What is missing in the model of a sample: the verdict, with everything it rests on.

    Args:
        source: a recording file or a sample.
        energy: base model: a strain energy by name or as an object, or a model with effects that are known to act.
        holdout: recordings to predict; the last one by default, none if there is only one. All parameters and errors
            shown come from a fit to the other recordings. Of material tests all recordings, these too, choose the set
            of effects.
        out: folder for `result.json` and the unexplained remainder; nothing is written by default.
        effects: names of the effects to try; all that can act by default.
        ogden_form: for `ogden-N`.
        effort: how much is tried and may be spent.
        keep: folder in which a stopped diagnosis finds again what it had done, simulations of probings and sets of
            effects of material tests (removed at the end); inside `out` by default.
        known: effects that are known to act, "gravity", "viscoelasticity.g1=0.3", or values by dotted path
            (`Diagnosis.repaired`); what is given is kept, the rest of such an effect is fitted with the base.
        unread: of material tests, recordings that take no part in anything: neither fitted, nor in the noise, nor in
            the choice. They are predicted when all is done (`Diagnosis.unread`).
        criteria: the numbers that make a verdict; the usual ones by default. `Criteria.of_rig("unchecked")` says that
            nobody has looked at the test machine.

    Raises:
        InputError: a file that can't be read, an unknown recording or effect, fewer samples than parameters.
        NotConverged: the base model can't be fitted at all.
    """
    begun = time.perf_counter()
    keep_programs()
    make_room()
    whole = source if isinstance(source, Sample) else read(source)
    sample, unread = without(whole, unread)
    keep = keep or (None if out is None else Path(out) / "runs")
    asked = asked_of(sample, energy, holdout, ogden_form, effects, known, keep, criteria)
    question, bench = asked.question, asked.bench
    fitted, energy = question.fitted, question.label
    bench.warnings += asked.remarks
    if bad := [f"{s.recording} {s.label}" for s in bench.segments if not np.all(np.isfinite(bench.y[s.rows]))]:
        raise InputError(f"{sample.name}: {', '.join(bad)}: values that are not finite; leave these samples out")
    n = sum(len(s.time) for s in bench.segments if s.recording in fitted)
    if n <= len(bench.base):
        raise InputError(
            f"{sample.name}: {n} samples for {len(bench.base)} parameters of {energy}; "
            "fit a smaller energy, or record more"
        )
    # matrices are thin here: threads of the linear algebra would wait for each other and keep a core from the rest
    with (progress or Silent()).stage(f"diagnosing {sample.name}") as stage, threadpool_limits(1, "blas"):
        said = ["reading"]

        def noted(note: str) -> None:
            said[0] = note
            stage.advance(note=note)

        def ran(count: int) -> None:
            stage.advance(0, f"{said[0]}; {count} simulations")

        asked.report_to(ran)
        cut, of = asked.left()
        effort = effort or asked.effort
        told = (sample, question.energy, question.known, question.every, sorted(bench.candidates), effort)
        kept = Kept(keep, key(*told, question.criteria))
        if kept.before:
            noted(f"going on: {kept.before} sets were weighed before it was stopped")
        by = Setup(question.criteria, effort or Effort(), noted, kept)
        found = answer(bench, asked.searched(cut), cut, of, by)
        made = asked.finished(found)
        made.unread = asked.predicted(whole, unread, found) if unread else {}
    if found.evidence.exhausted:
        found.bench.warnings.append(
            "what may be spent on predictions was spent: larger sets of effects were not all weighed"
        )
    if found.noise_level > WRONG:
        found.bench.warnings.append(
            f"check the noise level: what is left scatters from sample to sample {found.noise_level:.1f} times as much "
            "as the noise that was stated, which missing physics does not; the larger level was used"
        )
    made.seconds = time.perf_counter() - begun
    if out is not None:
        write_json(Path(out) / "result.json", made.as_dict())
        write_json(Path(out) / "remainder.json", made.remainders())
        write_evidence(found.evidence, evidence_file(Path(out)))
    kept.forget()
    return made


def asked_of(
    sample: Sample,
    energy: str | Energy | Model,
    holdout: str | Sequence[str] | None = None,
    ogden_form: str | None = None,
    effects: Sequence[str] | None = None,
    known: Sequence[str] | Mapping[str, float] = (),
    keep: Path | None = None,
    criteria: Criteria | None = None,
) -> Recorded:
    """The question that a diagnosis asks of a sample, on its bench: nothing is fitted yet. See `diagnose`.

    Raises:
        InputError: recordings that can't be used, an unknown recording or effect.
    """
    jax.config.update("jax_enable_x64", True)
    fitted, held_out, remarks = split(sample, holdout)
    refuse_unusable(sample, (*fitted, *held_out))
    refuse_gaps(sample, (*fitted, *held_out))
    for name in effects or ():
        if name not in all_effects():
            raise unknown("effect", name, all_effects())
    remarks += all_slips(sample, (*fitted, *held_out))
    kind = experiment(sample.recordings[fitted[0]].experiment).kind
    stated = [*([e.name for e in energy.effects] if isinstance(energy, Model) else ()), *_items(known)]
    base = energy.energy if isinstance(energy, Model) else energy
    base = base if isinstance(base, Energy) else named_energy(base, ogden_form)
    physics = known_physics(stated, kind)
    said = label(energy if isinstance(energy, str) else base.name, physics)
    question = Question(sample, base, said, fitted, held_out, physics, effects, keep, criteria or Criteria())
    asked = lookup("kind of experiment", kind, members(kinds, Recorded)).of(question)
    asked.remarks = remarks + asked.remarks
    return asked


def without(sample: Sample, unread: str | Sequence[str]) -> tuple[Sample, tuple[str, ...]]:
    """The sample without the recordings that nothing may read, and their names.

    Raises:
        InputError: an unknown recording, none left, or recordings of another kind than material tests.
    """
    names = (unread,) if isinstance(unread, str) else tuple(unread)
    for name in names:
        if name not in sample.recordings:
            raise unknown("recording", name, sample.recordings)
        if experiment(sample.recordings[name].experiment).kind != "homogeneous":
            raise InputError(
                f"{name}: only material tests can stay unread; diagnose without it (--only), and predict it with a fit"
            )
    kept = {n: r for n, r in sample.recordings.items() if n not in names}
    if not kept:
        raise InputError(f"{sample.name}: no recording is left to read; leave at least one")
    refuse_unusable(sample, names)
    refuse_gaps(sample, names)
    return (replace(sample, recordings=kept) if names else sample), names


def _items(known: Sequence[str] | Mapping[str, float]) -> list[str]:
    return [f"{k}={v!r}" for k, v in known.items()] if isinstance(known, Mapping) else list(known)


def split(sample: Sample, holdout: str | Sequence[str] | None) -> tuple[tuple[str, ...], tuple[str, ...], list[str]]:
    """Fitted and held-out recordings, and remarks on the choice."""
    names = tuple(sample.recordings)
    if holdout is None:
        if len(names) < 2:
            remark = "there is one recording only: nothing could be held out, so the verdict rests on the fit alone"
            return names, (), [remark]
        return names[:-1], names[-1:], []
    held = (holdout,) if isinstance(holdout, str) else tuple(holdout)
    for name in held:
        if name not in names:
            raise unknown("recording", name, names)
    left = tuple(n for n in names if n not in held)
    if not left:
        raise InputError(f"{sample.name}: all recordings are held out; leave at least one to fit")
    return left, held, []
