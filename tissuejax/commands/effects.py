"""`tissuejax effects`: the catalogue of effects: what each is, what reveals it, what can't show it."""

import argparse
import inspect
from typing import ClassVar

from tissuejax.commands.command import Command, Reply
from tissuejax.effects.catalogue import declared, effects
from tissuejax.effects.effect import Effect
from tissuejax.experiments.predictor import WORDS
from tissuejax.families import lookup

NONE = "none: it is weighed by `diagnose` as a part of what any law leaves, and is nothing to fit"


class Effects(Command):
    """List the effects that a model may lack."""

    name: ClassVar[str] = "effects"
    order: ClassVar[int] = 11
    summary: ClassVar[str] = "the catalogue of effects: where each acts, what reveals it, its parameters, source"
    teaches: ClassVar[str] = """
What a model may lack: physics of tissue, and faults of rig and sensors. `diagnose` tries all that can act in the
recordings; --effect switches one on in a fit or a simulation, --with tells a diagnosis that it acts.

  tissuejax effects                                      all of them
  tissuejax effects --of probing                         those that act in probings
  tissuejax effects friction                             one of them
"""

    def arguments(self, parser: argparse.ArgumentParser) -> None:
        """NAME, or --of KIND."""
        parser.add_argument("effect", metavar="NAME", nargs="?", help="this effect alone")
        parser.add_argument("--of", choices=sorted(WORDS), help="only those that act in such recordings")

    def run(self, given: argparse.Namespace) -> Reply:
        """The list."""
        found = effects(given.of)
        if given.effect:
            found = {given.effect: lookup("effect", given.effect, found)}
        record = {name: _record(name, kind) for name, kind in found.items()}
        lines = []
        for name, one in record.items():
            units = {p: "" if d["unit"] == "1" else f" ({d['unit']})" for p, d in one["parameters"].items()}
            shown = ", ".join(f"{p}{unit}" for p, unit in units.items())
            lines += [
                name,
                f"    {one['what']}",
                f"    acts in        {', '.join(WORDS[k] for k in one['kinds'])}",
                f"    revealed by    {one['reveals']}",
                f"    blind to it    {one['blind']}",
                f"    parameters     {shown or NONE}",
                *([f"    what to do     {one['remedy']}"] if one["remedy"] else []),
                f"    source         {one['source']}",
            ]
        return Reply({"effects": record}, "\n".join(lines))


def _record(name: str, kind: type[Effect]) -> dict:
    first = (inspect.getdoc(kind) or "").split("\n\n")[0].replace("\n", " ")
    return {
        "what": first,
        "kinds": sorted(kind.kinds),
        "reveals": kind.reveals,
        "blind": kind.blind,
        "parameters": {
            p: {"unit": d.unit, "default": d.default, "meaning": d.meaning} for p, d in declared(name).items()
        },
        "remedy": kind.remedy,
        "source": kind.source,
    }
