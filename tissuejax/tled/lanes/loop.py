"""A loop over elements as one operation of JAX: gather at the nodes, compute by element, add up at the nodes.

    kernel = trace(function, corners, ins)       # `function` of one lane's arrays, its last axis of length one
    outs = run(kernel, cells, arguments)

Such loops are closed under differentiation: the tangent of one is a loop with more arguments, and so is its transpose,
where what was gathered is added up and conversely. So one rule each makes `jvp`, `vjp`, `linearize`, `vmap` and
their compositions work. In a batch (the tangents of a Jacobian) what does not depend on the batch is computed once.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.extend import core
from jax.interpreters import ad, batching, mlir

from tissuejax.tled.lanes.library import NotCompiled, named
from tissuejax.tled.lanes.share import parts
from tissuejax.tled.lanes.tape import BATCH, LANE, UNIFORM, Tape
from tissuejax.tled.lanes.walk import Untold, walk
from tissuejax.tled.lanes.write import WIDTH, Slot, written


class Kernel:
    """What is done in one lane.

    Attributes:
        closed: traced function of arrays (c, k, 1) "nodal", (..., 1) "lane", (...) "uniform".
        corners: nodes of an element.
        ins, outs: what the arguments after the cells, and the results, are; never batched here.
        width: elements of a block; there must be as many.
    """

    def __init__(
        self, closed: core.ClosedJaxpr, corners: int, ins: Sequence[Slot], outs: Sequence[Slot], width: int = WIDTH
    ):
        self.closed, self.corners, self.ins, self.outs, self.width = closed, corners, tuple(ins), tuple(outs), width
        self._names: dict[tuple, str] = {}
        self._tangents: dict[tuple, Kernel] = {}
        self._transposes: dict[tuple, Kernel] = {}

    @property
    def function(self) -> Callable:
        """As a function of lists of arrays."""
        return core.jaxpr_as_fun(self.closed)

    def name(self, precision: str, batched: tuple[bool, ...]) -> str:
        """The compiled program."""
        key = (precision, batched)
        if key not in self._names:
            tape, inputs, nodes = Tape(), [], []
            ins = [Slot(s.kind, s.shape, b) for s, b in zip(self.ins, batched, strict=True)]
            for slot, var in zip(ins, self.closed.jaxpr.invars, strict=True):
                level = BATCH if slot.batched else UNIFORM if slot.kind == "uniform" else LANE
                own = [tape.input(r, level) for r in range(int(np.prod(var.aval.shape, dtype=int)))]
                x = np.empty(len(own), object)
                x[:] = own
                nodes.append(own)
                inputs.append(x.reshape(var.aval.shape))
            found = walk(self.closed.jaxpr, self.closed.consts, inputs, tape)
            outs = [Slot(s.kind, s.shape, any(batched)) for s in self.outs]
            text = written(precision, self.corners, ins, nodes, outs, [list(x.ravel()) for x in found], self.width)
            self._names[key] = named(text)
        return self._names[key]

    def tangent(self, moving: tuple[bool, ...]) -> "Kernel":
        """Tangents of the results along tangents of the `moving` arguments, which follow the arguments."""
        if moving not in self._tangents:
            avals = list(self.closed.in_avals)
            extra = [a for a, m in zip(avals, moving, strict=True) if m]

            def along(*x):
                x, dx = list(x[: len(avals)]), list(x[len(avals) :])

                def of(*moved):
                    rest = iter(moved)
                    return self.function(*(next(rest) if m else a for a, m in zip(x, moving, strict=True)))

                return jax.jvp(of, tuple(a for a, m in zip(x, moving, strict=True) if m), tuple(dx))[1]

            ins = [*self.ins, *(s for s, m in zip(self.ins, moving, strict=True) if m)]
            closed = jax.make_jaxpr(along)(*avals, *extra)
            self._tangents[moving] = Kernel(closed, self.corners, ins, self.outs, self.width)
        return self._tangents[moving]

    def transposed(self, linear: tuple[bool, ...], given: tuple[bool, ...]) -> "Kernel":
        """Cotangents of the `linear` arguments, from the other arguments and the `given` cotangents of the results."""
        key = (linear, given)
        if key not in self._transposes:
            avals = list(self.closed.in_avals)
            known = [a for a, ln in zip(avals, linear, strict=True) if not ln]
            unknown = [a for a, ln in zip(avals, linear, strict=True) if ln]
            cts = [a for a, g in zip(self.closed.out_avals, given, strict=True) if g]

            def back(*x):
                x, ct = x[: len(known)], list(x[len(known) :])

                def of(*moved):
                    fixed, free = iter(x), iter(moved)
                    out = self.function(*(next(free) if ln else next(fixed) for ln in linear))
                    return [o for o, g in zip(out, given, strict=True) if g]

                return jax.vjp(of, *(jnp.zeros(a.shape, a.dtype) for a in unknown))[1](ct)

            ins = [s for s, ln in zip(self.ins, linear, strict=True) if not ln]
            ins += [s for s, g in zip(self.outs, given, strict=True) if g]
            outs = [s for s, ln in zip(self.ins, linear, strict=True) if ln]
            closed = jax.make_jaxpr(back)(*known, *cts)
            self._transposes[key] = Kernel(closed, self.corners, ins, outs, self.width)
        return self._transposes[key]


def trace(
    function: Callable, corners: int, ins: Sequence[Slot], outs: Sequence[str], dtype, width: int = WIDTH
) -> Kernel:
    """The kernel of a function of one lane's arrays; `outs`: "nodal", "lane" or "uniform" (a sum over the lanes, given
    without their axis) for each of the arrays it returns.

    Raises:
        Untold: a result that is not of one lane.
    """
    shapes = {"nodal": lambda s: (*s.shape, corners, 1), "lane": lambda s: (*s.shape, 1), "uniform": lambda s: s.shape}
    closed = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(shapes[s.kind](s), dtype) for s in ins))
    last = {"nodal": 2, "lane": 1, "uniform": 0}
    for kind, a in zip(outs, closed.out_avals, strict=True):
        if kind != "uniform" and a.shape[-1:] != (1,):  # it met an argument with a number for each lane, taken for all
            raise Untold(f"a result of shape {a.shape}, where one number a lane is wanted")
    found = [Slot(k, a.shape[: a.ndim - last[k]]) for k, a in zip(outs, closed.out_avals, strict=True)]
    return Kernel(closed, corners, ins, found, width)


def run(kernel: Kernel, cells: Any, arguments: Sequence[Any], count: int) -> list[Any]:
    """The results of the loop over `cells` (k, E) of a mesh of `count` nodes.

    Raises:
        Untold: an operation that has no form in C. NotCompiled: the compiler refused.
    """
    kernel.name(str(arguments[0].dtype), (False,) * len(arguments))  # refuses here, where it can still be caught
    return loop_p.bind(cells, *arguments, kernel=kernel, batched=(False,) * len(arguments), count=count)


loop_p = core.Primitive("element_loop")
loop_p.multiple_results = True


def _avals(kernel: Kernel, batched, count: int, cells, arguments):
    lead = next(((a.shape[0],) for a, b in zip(arguments, batched, strict=True) if b), ())
    last = {"nodal": (count,), "lane": (cells.shape[-1],), "uniform": ()}
    dtype = arguments[0].dtype
    return [jax.ShapeDtypeStruct((*lead, *s.shape, *last[s.kind]), dtype) for s in kernel.outs]


def _call(cells, *arguments, kernel: Kernel, batched, count: int):
    if cells.shape[-1] < kernel.width:
        raise ValueError(f"{cells.shape[-1]} elements: the loop takes {kernel.width} or more")
    try:
        name = kernel.name(str(arguments[0].dtype), batched)
    except (Untold, NotCompiled):  # a derivative may have operations that the function has not
        return plain(cells, *arguments, kernel=kernel, batched=batched, count=count)
    avals = _avals(kernel, batched, count, cells, arguments)
    more = parts(cells.shape[-1]) - 1
    room = sum(a.size for a, s in zip(avals, kernel.outs, strict=True) if s.kind != "lane")
    spare = [jax.ShapeDtypeStruct((more, room), avals[0].dtype)] if more else []
    # 32 bits are what the program reads
    return jax.ffi.ffi_call(name, [*avals, *spare])(cells.astype(jnp.int32), *arguments)[: len(avals)]


def plain(cells, *arguments, kernel: Kernel, batched, count: int) -> list[Any]:
    """What the loop computes, in JAX alone: what it is held against, and what stands in where it can't be compiled."""
    if any(batched):
        one = functools.partial(plain, kernel=kernel, batched=(False,) * len(batched), count=count)
        return jax.vmap(one, in_axes=(None, *(0 if b else None for b in batched)))(cells, *arguments)
    taken = [a[:, cells] if s.kind == "nodal" else a for a, s in zip(arguments, kernel.ins, strict=True)]
    lanes = [s.kind != "uniform" for s in kernel.ins]

    def one(*x):
        return kernel.function(*(a[..., None] if lane else a for a, lane in zip(x, lanes, strict=True)))

    found = jax.vmap(one, in_axes=tuple(-1 if lane else None for lane in lanes), out_axes=-1)(*taken)
    out = []
    for x, slot in zip(found, kernel.outs, strict=True):
        x = x if slot.kind == "uniform" else x[..., 0, :]
        if slot.kind == "nodal":
            x = jnp.zeros((*slot.shape, count), x.dtype).at[:, cells].add(x)
        out.append(jnp.sum(x, -1) if slot.kind == "uniform" else x)
    return out


def _abstract(cells, *arguments, kernel: Kernel, batched, count: int):
    return [ShapedArray(s.shape, s.dtype) for s in _avals(kernel, batched, count, cells, arguments)]


def _differentiated(primals, tangents, *, kernel: Kernel, batched, count: int):
    cells, *x = primals
    out = loop_p.bind(*primals, kernel=kernel, batched=batched, count=count)
    moving = tuple(not isinstance(t, ad.Zero) for t in tangents[1:])
    dx = [t for t, m in zip(tangents[1:], moving, strict=True) if m]
    flags = (*batched, *(b for b, m in zip(batched, moving, strict=True) if m))
    return out, loop_p.bind(cells, *x, *dx, kernel=kernel.tangent(moving), batched=flags, count=count)


def _transpose(cts, cells, *arguments, kernel: Kernel, batched, count: int):
    linear = tuple(ad.is_undefined_primal(a) for a in arguments)
    given = tuple(not isinstance(ct, ad.Zero) for ct in cts)
    known = [a for a, ln in zip(arguments, linear, strict=True) if not ln]
    cts = [ct for ct, g in zip(cts, given, strict=True) if g]
    many = any(batched)
    flags = (*(b for b, ln in zip(batched, linear, strict=True) if not ln), *(many for _ in cts))
    back = kernel.transposed(linear, given)
    found = iter(loop_p.bind(cells, *known, *cts, kernel=back, batched=flags, count=count))
    out = [next(found) if ln else None for ln in linear]
    return [None, *(o.sum(0) if many and o is not None and not b else o for o, b in zip(out, batched, strict=True))]


def _batched(arguments, axes, *, kernel: Kernel, batched, count: int):
    cells, *x = arguments
    if axes[0] is not None or any(batched):  # a batch of batches, or of meshes: one after the other
        moved = [a if d is None else jnp.moveaxis(a, d, 0) for a, d in zip(arguments, axes, strict=True)]
        length = next(a.shape[0] for a, d in zip(moved, axes, strict=True) if d is not None)

        def one(i):
            own = [a if d is None else a[i] for a, d in zip(moved, axes, strict=True)]
            return loop_p.bind(*own, kernel=kernel, batched=batched, count=count)

        return jax.lax.map(one, jnp.arange(length)), [0] * len(kernel.outs)
    moved = [a if d is None else jnp.moveaxis(a, d, 0) for a, d in zip(x, axes[1:], strict=True)]
    flags = tuple(d is not None for d in axes[1:])
    return loop_p.bind(cells, *moved, kernel=kernel, batched=flags, count=count), [0] * len(kernel.outs)


loop_p.def_impl(lambda *args, **kw: jax.jit(lambda *a: loop_p.bind(*a, **kw))(*args))
loop_p.def_abstract_eval(_abstract)
ad.primitive_jvps[loop_p] = _differentiated
ad.primitive_transposes[loop_p] = _transpose
batching.primitive_batchers[loop_p] = _batched
mlir.register_lowering(loop_p, mlir.lower_fun(_call, multiple_results=True))
