"""Side files as text: what was guessed of a table, or a template for a kind of test, each line with its comment."""

import json
from collections.abc import Mapping, Sequence

from tissuejax.errors import InputError
from tissuejax.recordings.exports.meanings import EXPERIMENT_WORDS
from tissuejax.recordings.guessing import Guess
from tissuejax.storage import printable

_WIDTH = 46  # column in which comments begin
COMMENTS = {
    "file": "the table; a path is relative to this file",
    "format": "how the file is laid out: found by its content",
    "separator": "between cells: comma, semicolon, tab, space",
    "decimal": "decimal sign",
    "skip": "lines before the line of column names",
    "header": "no line of column names: columns are called by their place",
    "units_row": "a line of units stands under the names",
    "comment": "no line is a comment",
    "sample": "one name, or {column} for one sample a value",
    "recording": "one name, or {column} for one recording a value",
    "experiment": "tension, compression, planar, equibiaxial, biaxial, simple-shear, probing, cutting",
    "positive": "whether tension or compression counts positive in the table",
    "missing": "rows with empty cells are left out",
}
CUT = """
[tissue]
length = "?"                                  # FILL IN: along the cut
width = "?"                                   # FILL IN: across it; the blade runs in the middle
height = "?"                                  # FILL IN

[blade]
thickness = "?"                               # FILL IN, e.g. "0.365 mm"
depth = "?"                                   # FILL IN: of the cut; or a column, depth = { column = ..., unit = ... }
# angle = "28 deg"                            # between the bevels, 30 degrees if not given
# profile = { file = "edge.csv", unit = "mm" }   # x and z of the edge from the tip up; straight if not given
# notch = "10 mm"                             # how far the cut reached before (a second pass)
"""
_SIZES = {
    "height": "undeformed length in the loaded direction, between the grips or platens",
    "diameter": "of a round specimen",
    "width": "width times thickness is the area",
    "thickness": "",
    "area": "cross section of the undeformed specimen (or: diameter, or width and thickness)",
    "radius": "of the ball at the tip",
}
CHOICES = """
# What part of the test counts (take away the '#' of a line to use it):
# cycles = "last"                             # or "first", 3, "3-5", "after 5": leaves preconditioning out
# phase = "loading"                           # or "unloading"
# upto = "peak"                               # or "first drop": a test to failure
# preload = "0.02 N"                          # deformation counts from where the load first reaches this
# where = { "a column" = ">= 35" }            # rows by a column's value
# every = 10                                  # each tenth sample
"""


def side_text(guess: Guess, file: str) -> str:
    """The side file of a guess.

    Args:
        guess: what was found.
        file: the table as the side file calls it.
    """
    lines = [f"# Says what {printable(guess.path.name)} holds. Change what is wrong; text after '#' is a comment."]
    lines += [f"# Assumed: {printable(sentence)}." for sentence in guess.said]
    lines.append("")
    keys: dict[str, object] = {"file": file}
    keys |= {"format": guess.format} if guess.format else {}
    keys |= dict(guess.reading)
    keys |= {"sample": guess.sample}
    if len(guess.pairs) == 1:
        keys["recording"] = guess.recording
    keys |= {"experiment": guess.experiment}
    if guess.experiment in ("uniaxial", "planar", "equibiaxial", "biaxial"):
        keys["positive"] = guess.positive
    if guess.missing:
        keys["missing"] = "drop"
    lines += [_commented(f"{k} = {json.dumps(v, ensure_ascii=False)}", COMMENTS.get(k, "")) for k, v in keys.items()]
    if guess.where:
        lines.append(f"where = {_inline(guess.where)}")
    lines += CHOICES.rstrip().splitlines()
    lines += ["", "[columns]", *_time(guess)]
    if len(guess.pairs) == 1:
        lines += _pair(guess, guess.pairs[0][0])
    if guess.unused:
        lines.append(f"# not used: {', '.join(guess.unused)}")
    if guess.experiment == "cutting":
        lines += CUT.rstrip().splitlines()
    elif guess.specimen:
        lines += ["", "[specimen]"]
        for size, value in guess.specimen.items():
            mark = "FILL IN: " if value == "?" else ""
            lines.append(_commented(f"{size} = {json.dumps(value)}", mark + _SIZES.get(size, "")))
    lines += ["", "[noise]", *_noise(guess)]
    if len(guess.pairs) > 1:
        for pair, label in guess.pairs:
            lines += ["", "[[part]]", f"recording = {json.dumps(label)}", "[part.columns]", *_pair(guess, pair)]
    return "\n".join(lines) + "\n"


def slab_text(guess: Guess, side: str, height: str) -> str:
    """The probing side file of an indentation into a flat layer.

    Args:
        guess: what was found in the table; side: its side file's name.
        height: of the layer, with its unit.
    """
    return (
        f"# The body under the tip of {printable(guess.path.name)}, a flat layer; `tissuejax import` makes a recording "
        "of it.\n"
        f"sample = {json.dumps(guess.sample, ensure_ascii=False)}\n"
        '# density = "1060 kg/m^3"\n\n'
        "[body]\n"
        f"slab = {json.dumps(height)}\n"
        '# width = "120 mm"                             # six times the height if not told\n\n'
        "[[probing]]\n"
        f"table = {json.dumps(side, ensure_ascii=False)}\n"
    )


def _time(guess: Guess) -> list[str]:
    if guess.time is None:
        return ["# no column of time was found: samples are taken as 1 s apart"]
    column = json.dumps(guess.time.column, ensure_ascii=False)
    line = f"time = {{ column = {column}, unit = {json.dumps(guess.time.unit)} }}"
    return [f"# {line}", f"# ^ {guess.time_fault}"] if guess.time_fault else [line]


def _pair(guess: Guess, pair: Sequence) -> list[str]:
    by_quantity: dict[str, list[str]] = {}
    for column in pair:
        spec = [f"column = {json.dumps(column.column, ensure_ascii=False)}"]
        if column.unit not in ("", "1"):
            spec.append(f"unit = {json.dumps(column.unit, ensure_ascii=False)}")
        if guess.signs.get(column.column, 1) < 0:
            spec.append("sign = -1")
        if column.column in guess.zeros:
            spec.append("zero = true")
        by_quantity.setdefault(column.quantity, []).append(f"{{ {', '.join(spec)} }}")
    return [f"{q} = {s[0] if len(s) == 1 else '[' + ', '.join(s) + ']'}" for q, s in by_quantity.items()]


def _noise(guess: Guess) -> list[str]:
    load = guess.pairs[0][0][-1]
    unit = load.unit or "1"
    return [
        f'# {load.quantity} = "0.01 {unit}"{" " * 4}# of the sensor, if you know it; otherwise estimated from the data'
    ]


def _inline(table: Mapping[str, object]) -> str:
    pairs = ", ".join(f"{json.dumps(k, ensure_ascii=False)} = {json.dumps(v)}" for k, v in table.items())
    return f"{{ {pairs} }}"


def _commented(line: str, comment: str) -> str:
    return f"{line.ljust(_WIDTH - 1)} # {comment}" if comment else line


_TIME = 'time = { column = "time", unit = "s" }'
_FORCE = 'force = { column = "force", unit = "N" }'
_MOVED = 'displacement = { column = "displacement", unit = "mm" }    # or strain, stretch, length'
_ROUND = 'diameter = "10 mm"      # or area, or width and thickness'
TEMPLATES: dict[str, tuple[str, str, tuple[str, ...], tuple[str, ...]]] = {
    # kind: (experiment, positive, columns, sizes)
    "tension": ("uniaxial", "tension", (_TIME, _MOVED, _FORCE), ('height = "25 mm"', _ROUND)),
    "compression": ("uniaxial", "compression", (_TIME, _MOVED, _FORCE), ('height = "10 mm"', _ROUND)),
    "uniaxial": ("uniaxial", "tension", (_TIME, _MOVED, _FORCE), ('height = "25 mm"', _ROUND)),
    "planar": (
        "planar",
        "tension",
        (_TIME, _MOVED, _FORCE),
        ('height = "10 mm"', 'width = "60 mm"', 'thickness = "2 mm"'),
    ),
    "equibiaxial": (
        "equibiaxial",
        "tension",
        (_TIME, 'stretch = { column = "stretch" }', 'nominal_stress = { column = "stress", unit = "kPa" }'),
        (),
    ),
    "biaxial": (
        "biaxial",
        "tension",
        (
            _TIME,
            'stretch = [{ column = "stretch 1" }, { column = "stretch 2" }]',
            'nominal_stress = [{ column = "stress 1", unit = "kPa" }, { column = "stress 2", unit = "kPa" }]',
        ),
        (),
    ),
    "simple-shear": (
        "simple-shear",
        "",
        (_TIME, 'displacement = { column = "displacement", unit = "mm" }    # or shear, angle', _FORCE),
        ('height = "4 mm"         # distance of the two plates', 'area = "1 cm^2"'),
    ),
    "probing": (
        "probing",
        "",
        (_TIME, 'displacement = { column = "depth", unit = "mm" }    # into the tissue', _FORCE),
        ('radius = "5 mm"         # of the ball at the tip', 'height = "20 mm"        # of the tissue under it'),
    ),
}


def template(kind: str) -> str:
    """A side file to fill in, for a kind of test.

    Raises:
        InputError: an unknown kind.
    """
    kind = kind if kind in TEMPLATES else EXPERIMENT_WORDS.get(kind, (kind, ""))[0]
    if kind not in TEMPLATES:
        raise InputError(f"--template {kind}: there is one for {', '.join(TEMPLATES)}, probe and cutting")
    experiment, positive, columns, sizes = TEMPLATES[kind]
    lines = [f"# A side file for a table of a {kind} test. Put your own names, units and sizes; '#' begins a comment."]
    lines.append("# `tissuejax import my.csv` looks at a table and writes such a file by itself.")
    keys = {"file": "my.csv", "sample": "s1", "recording": kind, "experiment": experiment}
    keys |= {"positive": positive} if positive else {}
    lines += ["", *(_commented(f"{k} = {json.dumps(v)}", COMMENTS[k]) for k, v in keys.items())]
    lines += [
        _commented(f"# {k} = {v}", COMMENTS[k]) for k, v in (("skip", "6"), ("units_row", "true"), ("decimal", '","'))
    ]
    lines += [*CHOICES.rstrip().splitlines(), "", "[columns]", *columns]
    if sizes:
        lines += ["", "[specimen]", *sizes]
    return "\n".join(lines) + "\n"
