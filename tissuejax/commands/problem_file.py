"""A problem as a YAML file: specimen, recordings, model, parameters, candidates, options, for several verbs at once.

    tissuejax fit liver.yaml
    tissuejax diagnose liver.yaml
    tissuejax compare liver.yaml --multistart 2       # what is typed beside it is added, and wins
    tissuejax campaign run cohort.yaml                # every sample of the file; status, resume and report likewise

`problem.schema.json` beside this file is the schema (docs/problem-file.md shows an example). A verb takes what concerns
it: the file becomes the arguments that one would have typed, so that every check and every message is the command's.
"""

import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from tissuejax.errors import InputError

YAML = (".yaml", ".yml")
VERBS = ("fit", "diagnose", "compare", "campaign")
# Options that a verb doesn't have are left out, since one file serves all of them.
_OF_FITS = {"weights", "loss", "method", "multistart", "max-steps", "seed", "stable", "channel"}


def schema() -> dict:
    """The JSON schema of a problem file."""
    return json.loads(Path(__file__).with_name("problem.schema.json").read_text("utf-8"))


def read_problem(path: Path) -> dict:
    """The content of a problem file, checked against the schema.

    Raises:
        InputError: no such file, no YAML, or a place at which it breaks the schema, with what is allowed there.
    """
    import jsonschema
    import yaml

    try:
        content = yaml.safe_load(path.read_text("utf-8-sig"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        where = getattr(error, "problem_mark", None)
        place = f" at line {where.line + 1}" if where is not None else ""
        raise InputError(f"{path}: found text that is not YAML{place}, expected a problem file") from error
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    if content is None:
        raise InputError(f"{path}: is empty, expected a problem file; see docs/problem-file.md")
    wrong = sorted(jsonschema.Draft202012Validator(schema()).iter_errors(content), key=lambda e: list(map(str, e.path)))
    if wrong:
        place = ".".join(map(str, wrong[0].absolute_path)) or "the file"
        raise InputError(f"{path}: {place}: {wrong[0].message}; see docs/problem-file.md")
    return content


def expanded(argv: Sequence[str]) -> list[str]:
    """The arguments with a problem file, where one is named after a verb that takes it, turned into what it says.

    Raises:
        InputError: as `read_problem`.
    """
    argv = list(argv)
    words = [k for k, word in enumerate(argv) if not word.startswith("-")]
    named = 2 if words and argv[words[0]] == "campaign" else 1  # the action stands before the file
    if len(words) <= named or argv[words[0]] not in VERBS or not argv[words[named]].lower().endswith(YAML):
        return argv
    path = Path(argv[words[named]])
    problem = read_problem(path)
    typed = [*argv[words[0] + 1 : words[named]], *argv[words[named] + 1 :]]
    if named == 2:
        action = argv[words[1]]
        typed.remove(action)
        return [*argv[: words[0] + 1], action, *campaign_arguments(action, problem, path, typed), *typed]
    return [*argv[: words[0] + 1], *arguments(argv[words[0]], problem, path), *typed]


def campaign_arguments(action: str, problem: Mapping[str, object], path: Path, typed: Sequence[str] = ()) -> list[str]:
    """What one would have typed after `campaign ACTION`: the folder, and for `run` what is asked of every sample."""
    folder = str(Path(problem.get("out", Path("out") / path.stem)) / "campaign")
    if action != "run":
        return [folder]
    plain = {key: value for key, value in problem.items() if key != "out"}
    return [folder, *arguments("diagnose" if "diagnose" in typed else "fit", plain, path)]


def arguments(verb: str, problem: Mapping[str, object], path: Path) -> list[str]:
    """What one would have typed after the verb.

    Args:
        verb: "fit", "diagnose" or "compare".
        problem: the content of a problem file.
        path: the file, to which the specimen's path is relative.
    """
    file, mark, name = str(problem["specimen"]).partition("#")
    made = [os.path.normpath(path.parent / file) + mark + name]
    model, candidates = problem["model"], problem.get("candidates", {})
    recordings = problem.get("recordings", {})
    energies = [model["energy"], *(e for e in candidates.get("energies", ()) if e != model["energy"])]
    for energy in energies if verb == "compare" else energies[:1]:
        made += ["--energy", energy]
    made += ["--ogden-form", model["ogden_form"]] if "ogden_form" in model else []
    made += ["--volumetric", model["volumetric"]] if "volumetric" in model and verb != "diagnose" else []
    tried = model.get("effects", ()) if verb == "fit" else candidates.get("effects", ())
    if verb == "diagnose":  # it puts sets together and chooses the number of terms itself
        tried = dict.fromkeys(re.sub(r"-\d+$", "", one.strip()) for effect in tried for one in effect.split("+"))
    for effect in tried:
        made += ["--effect", effect]
    for option, key in (("--only", "fit"), ("--holdout", "holdout")):
        for recording in recordings.get(key, ()):
            made += [option, recording]
    if verb != "diagnose":
        made += _parameters(problem.get("parameters", {}))
    for key, value in problem.get("options", {}).items():
        if verb == "diagnose" and key in _OF_FITS:
            continue
        if value is not False:
            made += [f"--{key}"] if value is True else [f"--{key}", str(value)]
    if "out" in problem:
        made += ["--out", str(Path(problem["out"]) / verb)]
    return made


def _parameters(parameters: Mapping[str, Mapping[str, object]]) -> list[str]:
    made = []
    for path, one in parameters.items():
        for key, option in (("start", "--start"), ("fixed", "--fix")):
            if key in one:
                made += [option, f"{path}={one[key]}"]
        for key, option in (("bounds", "--bounds"), ("prior", "--prior")):
            if key in one:
                low, high = ("" if v is None else str(v) for v in one[key])
                made += [option, f"{path}={low}:{high}"]
    return made
