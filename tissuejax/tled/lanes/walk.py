"""From what JAX traced of one lane to arithmetic on a tape: moving numbers moves names, the rest is written down."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np
from jax.core import ShapedArray
from jax.extend import core

from tissuejax.tled.lanes.tape import Node, Tape

Objects = np.ndarray


class Untold(Exception):
    """An operation that has no form here; the caller takes the program that XLA compiles."""


def objects(x: Any) -> Objects:
    """An array of Python numbers."""
    x = np.asarray(x)
    if x.dtype.kind not in "fiub":
        raise Untold(f"numbers of type {x.dtype}")
    out = np.empty(x.shape, object)
    out[...] = x.tolist() if x.shape else x.item()
    return out


def walk(jaxpr: core.Jaxpr, consts: Sequence[Any], inputs: Sequence[Objects], tape: Tape) -> list[Objects]:
    """The outputs of a traced function of `inputs`, written on the tape.

    Raises:
        Untold: an operation that isn't known here.
    """
    known: dict[Any, Objects] = {}
    known.update(zip(jaxpr.constvars, (c if isinstance(c, np.ndarray) and c.dtype == object else objects(c)
                                       for c in consts), strict=True))  # fmt: skip
    known.update(zip(jaxpr.invars, inputs, strict=True))

    def value(atom):
        return objects(atom.val) if isinstance(atom, core.Literal) else known[atom]

    for eqn in jaxpr.eqns:
        found = _done(eqn, [value(a) for a in eqn.invars], tape)
        for var, x in zip(eqn.outvars, found, strict=True):
            assert isinstance(var.aval, ShapedArray)  # nothing else is computed with
            if x.shape != var.aval.shape:
                raise Untold(f"{eqn.primitive.name} gave {x.shape} for {var.aval.shape}")
            known[var] = x
    return [value(a) for a in jaxpr.outvars]


def _done(eqn, x: list[Objects], tape: Tape) -> list[Objects]:
    name, p = eqn.primitive.name, eqn.params
    for inner in ("jaxpr", "call_jaxpr", "fun_jaxpr"):
        if inner in p and name not in ("scan", "while"):
            closed = p[inner]
            if isinstance(closed, core.ClosedJaxpr):
                return walk(closed.jaxpr, closed.consts, x, tape)
            return walk(closed, (), x, tape)
    if name in ("optimization_barrier", "copy", "copy_p", "stop_gradient"):
        return x
    if name == "split":
        ends = np.cumsum(p["sizes"])[:-1]
        return np.split(x[0], ends, p["axis"])
    if name == "unstack":
        return [np.take(x[0], [i], p["axis"]).squeeze(p["axis"]) for i in range(x[0].shape[p["axis"]])]
    if name in MOVES:
        return [MOVES[name](p, *x)]
    if name in ("gather", "dynamic_slice", "scatter-add", "scatter", "iota", "dynamic_update_slice"):
        return _moved(eqn, x, tape)
    if name in SIMPLE:
        op = SIMPLE[name]
        return [_each(lambda *a: tape.do(op, *a), *x)]
    if name in SPECIAL:
        return [SPECIAL[name](p, tape, *x)]
    raise Untold(f"operation {name}")


def _each(f: Callable, *x: Objects) -> Objects:
    x = np.broadcast_arrays(*x)
    out = np.empty(x[0].shape, object)
    for at in np.ndindex(out.shape):
        out[at] = f(*(a[at] for a in x))
    return out


def _moved(eqn, x: list[Objects], tape: Tape) -> list[Objects]:
    """Places known beforehand: JAX itself says where each number goes."""
    name = eqn.primitive.name
    where = x[2:] if name == "dynamic_update_slice" else x[1:2] if name.startswith("scatter") else x[1:]
    if any(isinstance(i, Node) for places in where for i in places.ravel()):
        raise Untold(f"{name} at places that are computed")
    avals = [v.aval for v in eqn.invars]

    def run(*numbers):
        return np.asarray(eqn.primitive.bind(*numbers, **eqn.params))

    with jax.ensure_compile_time_eval():
        if name == "iota":
            return [objects(run())]
        if name in ("gather", "dynamic_slice"):
            places = [np.array(i.tolist(), a.dtype) for i, a in zip(x[1:], avals[1:], strict=True)]
            source = run(np.arange(1, x[0].size + 1, dtype=np.int32).reshape(x[0].shape), *places)
            flat = np.concatenate([np.array([0.0], object), x[0].ravel()])
            return [flat[source]]
    raise Untold(f"operation {name}")


def _broadcast(p, x: Objects, *_) -> Objects:
    shape = [1] * len(p["shape"])
    for axis, length in zip(p["broadcast_dimensions"], x.shape, strict=True):
        shape[axis] = length
    return np.broadcast_to(x.reshape(shape), p["shape"])


def _slice(p, x: Objects) -> Objects:
    strides = p["strides"] or (1,) * x.ndim
    return x[tuple(slice(*s) for s in zip(p["start_indices"], p["limit_indices"], strides, strict=True))]


def _pad(p, x: Objects, fill: Objects) -> Objects:
    if any(low < 0 or high < 0 for low, high, _ in p["padding_config"]):
        raise Untold("padding below zero")
    inner = [max(0, (n - 1) * (step + 1) + 1) for n, (_, _, step) in zip(x.shape, p["padding_config"], strict=True)]
    whole = [n + low + high for n, (low, high, _) in zip(inner, p["padding_config"], strict=True)]
    out = np.full(whole, fill.item(), object)
    at = (slice(low, low + n, step + 1) for n, (low, _, step) in zip(inner, p["padding_config"], strict=True))
    out[tuple(at)] = x
    return out


MOVES: dict[str, Callable] = {
    "broadcast_in_dim": _broadcast,
    "reshape": lambda p, x: x.reshape(p["new_sizes"]),
    "squeeze": lambda p, x: x.squeeze(tuple(p["dimensions"])),
    "expand_dims": lambda p, x: np.expand_dims(x, tuple(p["dimensions"])),
    "transpose": lambda p, x: x.transpose(p["permutation"]),
    "concatenate": lambda p, *x: np.concatenate(x, p["dimension"]),
    "stack": lambda p, *x: np.stack(x, p["axis"]),
    "rev": lambda p, x: np.flip(x, p["dimensions"]),
    "slice": _slice,
    "pad": _pad,
}
SIMPLE = {
    "add": "add", "sub": "sub", "mul": "mul", "div": "div", "neg": "neg", "exp": "exp", "log": "log", "sqrt": "sqrt",
    "abs": "abs", "gt": "gt", "lt": "lt", "ge": "ge", "le": "le", "eq": "eq", "ne": "ne", "max": "max", "min": "min",
    "and": "and", "or": "or", "not": "not", "is_finite": "isfinite", "log1p": "log1p", "expm1": "expm1", "tanh": "tanh",
    "erf": "erf", "pow": "pow", "sin": "sin", "cos": "cos", "acos": "acos", "asin": "asin", "atan": "atan",
    "atan2": "atan2", "sinh": "sinh", "cosh": "cosh", "cbrt": "cbrt", "add_any": "add",
}  # fmt: skip


def _power(p, tape: Tape, x: Objects) -> Objects:
    def one(a):
        n, out = abs(p["y"]), 1.0
        while n:  # squares and multiplies, as XLA does
            out = tape.do("mul", out, a) if n & 1 else out
            a, n = (tape.do("mul", a, a), n >> 1) if n > 1 else (a, 0)
        return out if p["y"] >= 0 else tape.do("div", 1.0, out)

    return _each(one, x)


def _total(p, tape: Tape, x: Objects) -> Objects:
    kept = [a for a in range(x.ndim) if a not in p["axes"]]
    x = x.transpose(*kept, *p["axes"])
    x = x.reshape(*x.shape[: len(kept)], -1)
    out = np.empty(x.shape[:-1], object)
    for at in np.ndindex(out.shape):
        entries = x[at]
        total = entries[0] if len(entries) else 0.0
        for e in entries[1:]:
            total = tape.do("add", total, e)
        out[at] = total
    return out


def _dot(p, tape: Tape, a: Objects, b: Objects) -> Objects:
    (ca, cb), (ba, bb) = p["dimension_numbers"]
    fa = [i for i in range(a.ndim) if i not in (*ca, *ba)]
    fb = [i for i in range(b.ndim) if i not in (*cb, *bb)]
    batch = [a.shape[i] for i in ba]
    left = a.transpose(*ba, *fa, *ca)
    right = b.transpose(*bb, *fb, *cb)
    m, n = [a.shape[i] for i in fa], [b.shape[i] for i in fb]
    left = left.reshape(int(np.prod(batch)), int(np.prod(m)), 1, -1)
    right = right.reshape(int(np.prod(batch)), 1, int(np.prod(n)), -1)
    products = _each(lambda x, y: tape.do("mul", x, y), left, right)
    return _total({"axes": (3,)}, tape, products).reshape(*batch, *m, *n)


def _select(p, tape: Tape, which: Objects, *cases: Objects) -> Objects:
    if len(cases) != 2:
        raise Untold("a choice of more than two")
    return _each(lambda w, no, yes: tape.do("select", w, yes, no), np.broadcast_to(which, cases[0].shape), *cases)


def _converted(p, tape: Tape, x: Objects) -> Objects:
    def one(a):
        if isinstance(a, Node):
            return tape.do("select", a, 1.0, 0.0) if a.truth and p["new_dtype"].kind == "f" else a
        return p["new_dtype"].type(a).item()

    return _each(one, x)


def _square(p, tape: Tape, x: Objects) -> Objects:
    return _each(lambda a: tape.do("mul", a, a), x)


def _sign(p, tape: Tape, x: Objects) -> Objects:
    def one(a):
        negative = tape.do("select", tape.do("lt", a, 0.0), -1.0, 0.0)
        return tape.do("select", tape.do("gt", a, 0.0), 1.0, negative)

    return _each(one, x)


def _clamp(p, tape: Tape, low: Objects, x: Objects, high: Objects) -> Objects:
    return _each(lambda a, b, c: tape.do("min", tape.do("max", b, a), c), low, x, high)


SPECIAL: dict[str, Callable] = {
    "integer_pow": _power, "reduce_sum": _total, "dot_general": _dot, "select_n": _select, "square": _square,
    "convert_element_type": _converted, "sign": _sign, "clamp": _clamp,
    "rsqrt": lambda p, tape, x: _each(lambda a: tape.do("div", 1.0, tape.do("sqrt", a)), x),
    "logistic": lambda p, tape, x: _each(
        lambda a: tape.do("div", 1.0, tape.do("add", 1.0, tape.do("exp", tape.do("neg", a)))), x),
    "exp2": lambda p, tape, x: _each(lambda a: tape.do("exp", tape.do("mul", 0.6931471805599453, a)), x),
}  # fmt: skip
