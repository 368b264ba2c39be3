"""Finished refits kept on disk, so that a stopped diagnosis of material tests goes on where it was.

A refit is decided by the code, the measurements, the model, the noise and where it starts; their hash is its name. A
diagnosis that is started again asks for the same refits in the same order and finds them; if a formula, a setting or a
sample has changed it asks for others. Of a model with a law from a user's script, whose formula is not part of that
hash, nothing is kept. A line of JSON each in one file, appended when the refit is finished: numbers come back to the
last bit, and a line that was cut off when the program was stopped is passed over.
"""

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from tissuejax.cache.key import described, key
from tissuejax.diagnosis.bench import Bench
from tissuejax.diagnosis.misfit import Misfit
from tissuejax.diagnosis.refit import Refit, refit
from tissuejax.errors import InputError

FILE = "refits.jsonl"


class KeptRefits:
    """Refits of one bench, in a folder or (None) not kept at all.

    Attributes:
        folder: where they are kept.
        found: how many were not run because they were there.
    """

    def __init__(self, bench: Bench, folder: Path | None = None):
        self.folder, self.found = folder, 0
        self._bench = bench
        self._known: dict[str, dict] = {}
        if folder is None:
            return
        parts = (bench.fitted, bench.held_out, bench.start, bench.free, bench.candidates, bench.segments)
        told = bench.told()
        self._told = None if told is None else described((told, parts, bench.y, bench.sigma))
        if self._mark() is None:
            self.folder = None
            return
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lines = (folder / FILE).read_text().splitlines() if (folder / FILE).exists() else []
        except OSError as error:
            raise InputError(f"{folder}: can't be written ({error.strerror}); name another --out") from error
        for line in lines:
            try:
                one = json.loads(line)
                self._known[one.pop("mark")] = one
            except (json.JSONDecodeError, KeyError):
                continue

    def _mark(self, *asked: object) -> str | None:
        return None if self._told is None else key(self._told, asked)

    def refit(self, misfit: Misfit, keys: Sequence[str], start: Mapping[str, float], **options) -> Refit:
        """`refit.refit`, or what it gave before; `options` are its keywords."""
        if self.folder is None:
            return refit(self._bench, misfit, keys, start, **options)
        name = self._mark(misfit.noises, tuple(keys), sorted(start.items()), sorted(options.items()))
        if name is None:  # the code has moved since it was loaded
            return refit(self._bench, misfit, keys, start, **options)
        if name in self._known:
            self.found += 1
            self._bench.spent += self._known[name]["spent"]
            return self._read(self._known[name], misfit, options.get("final", True))
        before = self._bench.spent
        found = refit(self._bench, misfit, keys, start, **options)
        kept = {"spent": self._bench.spent - before} | {k: v for k, v in found.__dict__.items() if k != "prediction"}
        with open(self.folder / FILE, "a") as file:
            file.write(json.dumps({"mark": name, **kept}) + "\n")
            file.flush()
            os.fsync(file.fileno())
        return found

    def _read(self, kept: dict, misfit: Misfit, final: bool) -> Refit:
        bench = self._bench
        tuples = {k: tuple(kept[k]) for k in ("keys", "at_bound")}
        out = Refit(**{k: v for k, v in kept.items() if k != "spent"} | tuples, prediction=np.array([]))
        recordings, spent = None if final else bench.fitted, bench.spent
        out = replace(out, prediction=bench.predict(out.all if final else out.values, recordings))
        bench.spent = spent  # it was counted when the refit was made
        return out

    def forget(self) -> None:
        """Remove what was kept."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)
