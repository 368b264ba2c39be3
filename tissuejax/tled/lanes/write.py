"""C of a loop over elements from the tape of one lane: gather at the nodes, arithmetic in vectors, add up at the nodes.

Elements are taken in blocks (of `WIDTH` where nothing else is said), so that what passes from stage to stage stays in
the first cache. A last block that would not be full begins earlier: what it does again it neither adds up nor sums.
What does not depend on the batch (the tangents of a Jacobian, say) is worked out once for all of it.
The C is plain: vectors come from the compiler's `omp simd`. It may neither reorder nor fuse a product into a sum: then
what adds zero changes no bit of the rest, whatever stands around it, and an effect at its neutral value is neutral.
"""

from dataclasses import dataclass

import numpy as np

from tissuejax.tled.lanes.share import handler
from tissuejax.tled.lanes.tape import BATCH, LANE, UNIFORM, Node, Number

WIDTH = 32
TOP = """#include <stdint.h>
#include <stddef.h>
#include "xla/ffi/api/c_api.h"
typedef {real} real;
#ifndef SIMD
#define SIMD
#endif
{functions}
"""
VECTOR = ("exp", "log", "pow", "sin", "cos")  # vector forms wherever the C library has any
OTHER = ("expm1", "log1p", "tanh", "erf", "acos", "asin", "atan", "atan2", "sinh", "cosh", "cbrt")
TWO = ("pow", "atan2")
SIGN = {"add": "+", "sub": "-", "mul": "*", "div": "/", "gt": ">", "lt": "<", "ge": ">=", "le": "<=", "eq": "==",
        "ne": "!=", "and": "&", "or": "|"}  # fmt: skip


@dataclass(frozen=True)
class Slot:
    """One argument or result of a loop.

    Attributes:
        kind: "nodal" (c, N), gathered or added up by element; "lane" (..., E); "uniform" (...), the same for all
            elements, as a result a sum over them.
        shape: without batch and without the last axis (for "nodal": c).
        batched: whether there is one for each member of the batch.
    """

    kind: str
    shape: tuple[int, ...]
    batched: bool = False

    @property
    def rows(self) -> int:
        """Numbers by element, node or altogether."""
        return int(np.prod(self.shape, dtype=int))


def written(precision: str, corners: int, ins: list[Slot], inputs: list[list[Node]], outs: list[Slot],
            outputs: list[list[Number]], width: int = WIDTH) -> str:  # fmt: skip
    """The C of a loop.

    Args:
        precision: "float32" or "float64".
        corners: nodes of an element.
        ins, inputs: arguments after the cells, and the node that stands for each of their numbers (nodal: c x corners).
        outs, outputs: results and what they are, likewise.
        width: elements of a block.
    """
    return _Writer(precision, corners, ins, inputs, outs, outputs, width).text()


class _Writer:
    def __init__(self, precision, corners, ins, inputs, outs, outputs, width):
        self.real, self.f = ("float", "f") if precision == "float32" else ("double", "")
        self.corners, self.ins, self.inputs, self.outs, self.outputs = corners, ins, inputs, outs, outputs
        self.width, self.batch = width, any(s.batched for s in ins)
        self.names: dict[int, str] = {}
        self.order: list[Node] = []
        self.used: set[str] = set()
        self.stored: dict[int, int] = {}
        self._needed()

    def _needed(self) -> None:
        """What the results need, each node after its parts."""
        seen: set[int] = set()
        stack = [(p, False) for row in reversed(self.outputs) for p in reversed(row)]
        while stack:
            node, done = stack.pop()
            if not isinstance(node, Node) or (id(node) in seen and not done):
                continue
            if done:
                self.order.append(node)
                continue
            seen.add(id(node))
            stack.append((node, True))
            stack.extend((p, False) for p in reversed(node.parts))
        self.names = {id(n): f"v{i}" for i, n in enumerate(self.order)}
        if self.batch:
            for node in self.order:
                if node.level == BATCH:
                    self._store(node.parts)
            for row in self.outputs:
                self._store(row)

    def _store(self, parts) -> None:
        for p in parts:
            if isinstance(p, Node) and p.level == LANE:
                self.stored.setdefault(id(p), len(self.stored))

    def say(self, p: Number) -> str:
        """A number or node as C."""
        if isinstance(p, Node):
            return self.names[id(p)]
        if isinstance(p, bool):
            return "1" if p else "0"
        if p != p or p in (float("inf"), -float("inf")):
            return {True: '(real)__builtin_nan("")'}.get(p != p) or f"({'-' if p < 0 else ''}(real)__builtin_inf())"
        return f"(real){float(p)!r}" if p >= 0 else f"((real){float(p)!r})"

    def expression(self, node: Node) -> str:
        """The right-hand side of a node."""
        op, parts = node.op, node.parts
        said = [self.say(p) for p in parts]
        if op in SIGN:
            return f"{said[0]} {SIGN[op]} {said[1]}"
        if op == "neg":
            return f"-{said[0]}"
        if op == "not":
            return f"!{said[0]}"
        if op == "select":
            return f"{said[0]} ? {said[1]} : {said[2]}"
        if op in ("max", "min"):
            return (
                f"({said[0]} {'>' if op == 'max' else '<'} {said[1]} || {said[0]} != {said[0]}) ? {said[0]} : {said[1]}"
            )
        if op == "isfinite":
            return f"({said[0]} - {said[0]}) == 0"
        if op in ("abs", "sqrt"):
            return f"__builtin_{'fabs' if op == 'abs' else 'sqrt'}{self.f}({said[0]})"
        self.used.add(op)
        return f"{op}{self.f}({', '.join(said)})"

    def statement(self, node: Node) -> str:
        """One line that defines a node."""
        kind = "int" if node.truth else "real"
        return f"const {kind} {self.names[id(node)]} = {self.expression(node)};"

    def text(self) -> str:
        """The whole program."""
        body = self._uniform() + self._blocks()
        declared = []
        for op in sorted(self.used):
            two = ", real" if op in TWO else ""
            declared.append(f"{'SIMD ' if op in VECTOR + OTHER else ''}real {op}{self.f}(real{two});")
        top = TOP.format(real=self.real, f=self.f, functions="\n".join(declared))
        head = "static void run(const void *const *in, void *const *out, const int64_t E, const int64_t N,\n"
        head += "                const int64_t B, const int64_t begin, const int64_t end) {"
        return top + "\n".join([head, *("  " + line for line in body), "}"]) + "\n" + self._handler()

    def _handler(self) -> str:
        batched = next((i for i, s in enumerate(self.ins) if s.batched), None)
        batch = "1" if batched is None else f"buffer(frame->args.args[{batched + 1}])->dims[0]"
        outs = [(s.kind, s.rows) for s in self.outs]
        return handler(len(self.ins) + 1, outs, self._nodes(), batch, self.corners, self.width)

    def _nodes(self) -> str:
        for of, slots in (("args.args", self.ins), ("rets.rets", self.outs)):
            for i, slot in enumerate(slots):
                if slot.kind == "nodal":
                    at = f"buffer(frame->{of}[{i + (of == 'args.args')}])"
                    return f"{at}->dims[{at}->rank - 1]"
        return "0"

    def _uniform(self) -> list[str]:
        lines = ["const int32_t *const cells = in[0];"]
        for i, slot in enumerate(self.ins):
            lines.append(f"const real *const in{i} = in[{i + 1}];")
            if slot.kind == "uniform" and not slot.batched:
                for r, node in enumerate(self.inputs[i]):
                    if id(node) in self.names:
                        lines.append(f"const real {self.names[id(node)]} = in{i}[{r}];")
        lines += [self.statement(n) for n in self.order if n.level == UNIFORM and n.op != "input"]
        return lines + [f"real *const out{i} = out[{i}];" for i in range(len(self.outs))]  # sums begin at 0

    def _loads(self, batched: bool) -> tuple[list[str], list[str]]:
        """Lines before and inside a vector loop that bring in its arguments."""
        before, inside = [], []
        for i, slot in enumerate(self.ins):
            if slot.batched != batched or (slot.kind == "uniform" and not batched):
                continue
            which = f" + b * {slot.rows}" if batched else ""
            many = {"nodal": "N", "lane": "E"}.get(slot.kind)
            start = f"in{i}{which}{f' * {many}' if which and many else ''}"
            if slot.kind == "nodal":
                k = self.corners
                before.append(f"real g{i}[{slot.rows * k}][{self.width}];")
                before.append(f"for (int a = 0; a < {k}; a++)")
                before.append(f"  for (int i = 0; i < {self.width}; i++) {{")
                before.append("    const int64_t at = cells[a * E + e + i];")
                before += [f"    g{i}[{c * k} + a][i] = ({start})[{c} * N + at];" for c in range(slot.rows)]
                before.append("  }")
            for r, node in enumerate(self.inputs[i]):
                if id(node) not in self.names:
                    continue
                source = {"nodal": f"g{i}[{r}][i]", "lane": f"({start})[{r} * E + e + i]", "uniform": f"({start})[{r}]"}
                inside.append(f"const real {self.names[id(node)]} = {source[slot.kind]};")
        return before, inside

    def _blocks(self) -> list[str]:
        sums = [
            f"real sum{i}[{s.rows}][{self.width}] = {{{{0}}}};" for i, s in enumerate(self.outs) if s.kind == "uniform"
        ]
        lines = [] if self.batch else sums
        lines += [f"for (int64_t first = begin; first < end; first += {self.width}) {{"]
        lines += [f"  const int64_t e = first + {self.width} > end ? end - {self.width} : first;"]
        lines += ["  const int done = (int)(first - e);"]
        before, inside = self._loads(False)
        work = [self.statement(n) for n in self.order if n.level == LANE and n.op != "input"]
        if not self.batch:
            inner = before + self._vector(inside + work, self._results()) + self._scatter("0")
            lines += ["  " + x for x in inner] + ["}"]
            return lines + self._sums("0", False)
        kept = [f"kept[{at}][i] = {self.names[node]};" for node, at in self.stored.items()]
        inner = [*before, f"real kept[{max(1, len(self.stored))}][{self.width}];"]
        inner += self._vector(inside + work, kept) if inside + work else []
        inner.append("for (int64_t b = 0; b < B; b++) {")
        before, inside = self._loads(True)
        again = [f"const real {self.names[node]} = kept[{at}][i];" for node, at in self.stored.items()]
        work = [self.statement(n) for n in self.order if n.level == BATCH and n.op != "input"]
        part = sums + before + self._vector(again + inside + work, self._results()) + self._scatter("b")
        part += self._sums("b", True)
        inner += ["  " + x for x in part] + ["}"]
        return lines + ["  " + x for x in inner] + ["}"]

    def _vector(self, work: list[str], results: list[str]) -> list[str]:
        declared = [x for x in results if x.startswith("real ")]
        stores = [x for x in results if not x.startswith("real ")]
        head = ["#pragma omp simd", f"for (int i = 0; i < {self.width}; i++) {{"]
        return declared + head + ["  " + x for x in work + stores] + ["}"]

    def _results(self) -> list[str]:
        lines = []
        for i, slot in enumerate(self.outs):
            which = f"b * {slot.rows} * E + " if self.batch else ""
            if slot.kind == "nodal":
                lines.append(f"real o{i}[{slot.rows * self.corners}][{self.width}];")
            for r, p in enumerate(self.outputs[i]):
                said = self.say(p)
                if slot.kind == "nodal":
                    lines.append(f"o{i}[{r}][i] = {said};")
                elif slot.kind == "lane":
                    lines.append(f"out{i}[{which}{r} * E + e + i] = {said};")
                else:
                    lines.append(f"sum{i}[{r}][i] += i < done ? 0 : {said};")
        return lines

    def _scatter(self, b: str) -> list[str]:
        lines, k = [], self.corners
        nodal = [(i, s) for i, s in enumerate(self.outs) if s.kind == "nodal"]
        if not nodal:
            return []
        lines += [f"for (int i = done; i < {self.width}; i++) {{"]
        lines += [f"#pragma GCC unroll {k}"]  # 4 to 17 % of a loop
        lines += [f"  for (int a = 0; a < {k}; a++) {{", "    const int64_t at = cells[a * E + e + i];"]
        for i, slot in nodal:
            lines += [f"    out{i}[({b} * {slot.rows} + {c}) * N + at] += o{i}[{c * k} + a][i];"
                      for c in range(slot.rows)]  # fmt: skip
        return [*lines, "  }", "}"]

    def _sums(self, b: str, inside: bool) -> list[str]:
        lines = []
        for i, slot in enumerate(self.outs):
            if slot.kind == "uniform":
                lines.append(f"for (int r = 0; r < {slot.rows}; r++)")
                lines.append(f"  for (int i = 0; i < {self.width}; i++) out{i}[{b} * {slot.rows} + r] += sum{i}[r][i];")
        return lines
