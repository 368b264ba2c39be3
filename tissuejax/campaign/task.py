"""One case of a campaign: a sample of a file and what is asked of it; and the function that answers it."""

import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from tissuejax.cache.key import key
from tissuejax.errors import InputError, TissueError, unknown
from tissuejax.recordings.files import names, read, reader
from tissuejax.recordings.plausible import refuse_unusable
from tissuejax.recordings.recording import Sample

KINDS = ("fit", "diagnose")
BY_PATH = {"fix", "start", "bounds", "priors"}
UNSTORED = ("seconds", "versions", "trace")  # of a fit's record: not part of the answer, or too long for a cohort


@dataclass(frozen=True)
class Settings:
    """What is asked of every sample.

    Attributes:
        kind: "fit" or "diagnose".
        energy, ogden_form, volumetric, effects: the model; for a diagnosis the effects to try (none: all).
        holdout: recordings to hold out, where a sample has them.
        multistart, seed: of a fit.
        fit: further options of a fit as (name, value) pairs: only, free, fix, start, bounds, priors, weights, channels,
            loss, stable, max_steps, method; those by path are pairs again, (path, number, ...), an
            infinite number being "inf" (JSON has none).
    """

    kind: str
    energy: str
    ogden_form: str | None = None
    volumetric: str | None = None
    effects: tuple[str, ...] = ()
    holdout: tuple[str, ...] = ()
    multistart: int = 2
    seed: int = 0
    fit: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self):
        if self.kind not in KINDS:
            raise InputError(f"unknown kind of campaign {self.kind!r}; one of {', '.join(KINDS)}")


@dataclass(frozen=True)
class Task:
    """One case: the key of its answer, where its sample lies, the settings, and the limit in seconds.

    Attributes:
        unread: why the sample could not be read when this was planned; then that is its answer. A file that gives no
            names stands here by its own name.
    """

    key: str
    file: str
    sample: str
    settings: Settings
    limit: float
    unread: str = ""

    def plain(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Task":
        """From plain data."""
        said = {name: _frozen(value) for name, value in data["settings"].items()}
        return cls(data["key"], data["file"], data["sample"], Settings(**said), data["limit"], data.get("unread", ""))


def _frozen(value: Any) -> Any:
    """Lists as tuples, all the way down: what JSON makes of a tuple."""
    return tuple(_frozen(v) for v in value) if isinstance(value, list | tuple) else value


def tasks(files: list[str], settings: Settings, limit: float) -> list[Task]:
    """A task for every sample of every file; its key is the hash of recordings, settings, code and libraries.

    What can't be read is a task as well, with the reason in it: one bad file leaves the others alone.

    Raises:
        InputError: a selection that picks nothing, or code that changed on disk since it was loaded.
    """
    found = []
    for file in files:
        for name, sample in _samples(file):
            unread = sample if isinstance(sample, str) else ""
            mark = key(os.path.abspath(file) if unread else sample, *[name] * bool(unread), asdict(settings))
            if mark is None:
                raise InputError("the package's code changed on disk while it was loaded; start again")
            found.append(Task(mark, os.fspath(file), name, settings, limit, unread))
    return found


def again(task: Task) -> list[Task]:
    """What takes the place of a task that could not be read: it may have been mended, and then gives its samples."""
    found = tasks([task.file], task.settings, task.limit)
    return [other for other in found if other.sample == task.sample] or found


def first_of(files: list[str]) -> Sample:
    """The first sample that can be read.

    Raises:
        InputError: there is none, or a selection picks nothing.
    """
    reasons = []
    for file in files:
        for _, sample in _samples(file):
            if isinstance(sample, Sample):
                return sample
            reasons.append(sample)
    several = f"none of the {len(files)} files can be read; the first: " if len(files) > 1 else ""
    raise InputError(several + reasons[0])


def _samples(file: str) -> Iterator[tuple[str, Sample | str]]:
    """Every sample of a file by name, or why it can't be read; a file without readable names stands by its own."""
    _refuse_nothing(file)
    try:
        known, one = reader(file)
    except Exception as error:  # whatever is wrong with one file is its row, and the others go on
        yield os.path.basename(file), why(error)
        return
    for name in known:
        try:
            sample = one(name)
        except Exception as error:
            sample = why(error)
        yield name, sample


def _refuse_nothing(file: str) -> None:
    """A selection that picks nothing is a slip in what was typed, and no failure of a case."""
    whole, _, name = file.rpartition("#")
    if os.path.exists(file):
        return
    if os.path.exists(whole):
        known = [name]
        with suppress(Exception):  # a file that gives no names says so in its row
            known = names(whole)
        if name not in known:
            raise InputError(f"{whole}: {unknown('sample', name, known)}")
    elif set("*?[") & set(file):
        raise InputError(f"{file}: no file matches this pattern; give the names of files that are there")


class TooLong(Exception):
    """A case took longer than its limit."""


def answer(task: Task) -> dict[str, Any]:
    """The row of a task: "done" with the record, or "failed" with the reason; never raises for what a case may do.

    Everything but "seconds" and "worker" is the same wherever it is computed.
    """
    begun = time.perf_counter()
    row: dict[str, Any] = {"sample": task.sample, "file": task.file, "settings": asdict(task.settings)}
    try:
        with limited(task.limit):
            if task.unread:
                raise InputError(task.unread)
            row |= {"status": "done", "answer": _solved(task)}
    except TooLong:
        row |= {"status": "failed", "reason": f"took longer than {task.limit:g} s"}
    except (KeyboardInterrupt, SystemExit):
        raise
    except Exception as error:  # whatever a case does wrong is a row, and the others go on
        row |= {"status": "failed", "reason": why(error)}
    return row | {"seconds": time.perf_counter() - begun, "worker": os.getpid()}


def why(error: Exception) -> str:
    """An error as a reason: a sentence of ours as it is, anything else with its kind before it."""
    return str(error) if isinstance(error, TissueError) else f"{type(error).__name__}: {error}"


def _solved(task: Task) -> dict[str, Any]:
    import jax

    jax.config.update("jax_enable_x64", True)
    sample = read(task.file, task.sample)  # of a large table its own rows only; the table itself is kept in memory
    s = task.settings
    held = tuple(name for name in s.holdout if name in sample.recordings)
    if s.kind == "diagnose":
        from tissuejax.diagnosis.diagnose import diagnose

        found = diagnose(sample, s.energy, holdout=held or None, effects=s.effects or None, ogden_form=s.ogden_form)
        return found.as_dict()
    from tissuejax.effects.catalogue import effect
    from tissuejax.energies import catalogue
    from tissuejax.experiments.predictor import predictor
    from tissuejax.experiments.probing_slips import all_slips, warned
    from tissuejax.fitting.advice import suspicions
    from tissuejax.fitting.least_squares import fit
    from tissuejax.fitting.options import Objective, Search, Unknowns
    from tissuejax.fitting.setup import problem, split
    from tissuejax.model import Model

    bulk = catalogue.volumetric(s.volumetric) if s.volumetric else None
    model = Model(catalogue.energy(s.energy, s.ogden_form), bulk, tuple(effect(name) for name in s.effects))
    asked: dict[str, Any] = dict(s.fit)
    for k in BY_PATH & asked.keys():
        asked[k] = {path: float(of[0]) if len(of) == 1 else tuple(map(float, of)) for path, *of in asked[k]}
    fitted, held = split(sample, tuple(n for n in asked.pop("only", ()) if n in sample.recordings), held)
    refuse_unusable(sample, fitted)

    def given(kind: type[Unknowns | Objective | Search]) -> dict[str, Any]:
        return {f.name: asked[f.name] for f in fields(kind) if f.name in asked}

    unknowns, objective, search = Unknowns(**given(Unknowns)), Objective(**given(Objective)), Search(**given(Search))
    posed = problem(predictor(model, sample, fitted), unknowns, objective)
    start = {path: posed.start[path] for path in unknowns.start or ()} or None
    search = replace(search, multistart=s.multistart, seed=s.seed)
    found = fit(posed, start=start, search=search, holdout=held)
    found.warnings.extend(warned(all_slips(sample, (*fitted, *held))))
    doubts = {} if found.converged else {"not converged": [f"the search did not converge: {found.status}"]}
    record = {name: value for name, value in found.record().items() if name not in UNSTORED}
    return record | {"suspect": doubts | suspicions(found)}


@contextmanager
def limited(seconds: float):
    """Raises `TooLong` inside the block after so many seconds (0: never); needs the main thread and SIGALRM."""
    if seconds <= 0 or threading.current_thread() is not threading.main_thread() or not hasattr(signal, "SIGALRM"):
        yield
        return

    def ring(*_):
        raise TooLong

    before = signal.signal(signal.SIGALRM, ring)
    # once a second from then on: an exception in a callback of the garbage collector is swallowed
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
