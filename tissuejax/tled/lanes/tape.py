"""One lane of a traced function as straight-line arithmetic: each number once, constants folded.

A function of arrays with a last axis of length one (a lane) is walked operation by operation. An array is a numpy array
of objects, each a Python number or a `Node`; what only moves numbers about costs nothing, equal operations are one, and
nothing is reordered.
"""

import math
from dataclasses import dataclass
from typing import Any

Number = Any  # a Python number or a Node

UNIFORM, LANE, BATCH = 0, 1, 2  # on what a node depends: neither lane nor batch; the lane; the batch (and the lane)


@dataclass(eq=False)
class Node:
    """One number of the program: its operation, what it is made of, whether it is a truth value, on what it depends."""

    op: str
    parts: tuple[Number, ...]
    truth: bool
    level: int
    row: int = -1  # of an input: which number it is


FOLD = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "neg": lambda a: -a, "exp": math.exp, "log": math.log, "sqrt": math.sqrt, "abs": abs,
    "gt": lambda a, b: a > b, "lt": lambda a, b: a < b, "ge": lambda a, b: a >= b, "le": lambda a, b: a <= b,
    "eq": lambda a, b: a == b, "ne": lambda a, b: a != b, "max": max, "min": min,
    "and": lambda a, b: a and b, "or": lambda a, b: a or b, "not": lambda a: not a,
}  # fmt: skip
TRUTHS = {"gt", "lt", "ge", "le", "eq", "ne", "and", "or", "not", "isfinite"}


class Tape:
    """Nodes in the order in which they were made, equal ones once."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[tuple, Node] = {}

    def input(self, row: int, level: int, truth: bool = False) -> Node:
        """A number that is read from memory."""
        node = Node("input", (), truth, level, row)
        self.nodes.append(node)
        return node

    def do(self, op: str, *parts: Number) -> Number:
        """The result of an operation: a number where all parts are, a part where it is one, else a node."""
        parts = tuple(_number(p) for p in parts)
        if not any(isinstance(p, Node) for p in parts) and op in FOLD:
            try:
                return FOLD[op](*parts)
            except (ArithmeticError, ValueError):
                pass  # a division by zero or the like: left to the program, which gives inf or NaN
        simple = _simple(op, parts)
        if simple is not None:
            return simple
        key = (op, *(id(p) if isinstance(p, Node) else (type(p), repr(p)) for p in parts))
        if key not in self._known:
            level = max((p.level for p in parts if isinstance(p, Node)), default=UNIFORM)
            truth = op in TRUTHS or (op == "select" and _truth(parts[1]) and _truth(parts[2]))
            self._known[key] = Node(op, parts, truth, level)
            self.nodes.append(self._known[key])
        return self._known[key]


def _truth(p: Number) -> bool:
    return p.truth if isinstance(p, Node) else isinstance(p, bool)


def _number(p: Number) -> Number:
    return p if isinstance(p, Node | bool | int | float) else p.item()


def _is(p: Number, value: float) -> bool:
    return not isinstance(p, Node) and p == value


def _simple(op: str, p: tuple[Number, ...]) -> Number | None:
    """The part that a sum with 0 or a product with 1 is; 0 for a product with a literal 0."""
    if op == "add":
        return p[1] if _is(p[0], 0) else p[0] if _is(p[1], 0) else None
    if op == "sub" and _is(p[1], 0):
        return p[0]
    if op == "mul":
        if _is(p[0], 0) or _is(p[1], 0):
            return 0.0
        return p[1] if _is(p[0], 1) else p[0] if _is(p[1], 1) else None
    if op == "div":
        return p[0] if _is(p[1], 1) else 0.0 if _is(p[0], 0) else None
    if op == "select" and isinstance(p[0], bool):
        return p[1] if p[0] else p[2]
    if op == "neg" and isinstance(p[0], Node) and p[0].op == "neg":
        return p[0].parts[0]
    return None
