"""The element loop of a scene, its contact and cohesive faces, as compiled C (`lanes/`), where a C compiler is;
elsewhere what XLA makes of them stands.

TISSUEJAX_NATIVE=off leaves all to XLA: the same to rounding. XLA copies between its stages, and each of some 55
operations a block costs a call: the step takes 2.8 to 4.6 times what a hand-written one does (tests/bench/yardstick.c,
a core with AVX-512). The same traced formula, written out as C, takes 1.1 to 1.5 times as much, and a probing's fit
(p01) 0.64 of the CPU time with everything compiled anew, 0.52 with programs kept. Energies are still written once, as
energies: the C is made from what JAX traced of the element, derivatives included; an operation that has no form in C
leaves its loop to XLA. Long loops are shared by two threads, to the same bits as on one (`lanes/share.py`).
"""

import dataclasses
import os
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from tissuejax.tled.lanes.library import ENVIRONMENT, NotCompiled, compiler
from tissuejax.tled.lanes.loop import Kernel, run, trace
from tissuejax.tled.lanes.walk import Untold
from tissuejax.tled.lanes.write import WIDTH, Slot

if TYPE_CHECKING:
    from tissuejax.tled.faces import Faces, Seam
    from tissuejax.tled.scene import Probe, Scene

_kernels: dict[Any, Kernel | None] = {}
MOST_PROGRAMS = 200  # kernels that are remembered
FACETS = 16  # facets and faces taken at once: `build.PATCH`, of which all patches are multiples


def wanted() -> bool:
    """Whether a compiler is here and the environment does not leave the loop to XLA."""
    return os.environ.get(ENVIRONMENT, "on").lower() != "off" and compiler() is not None


def loop(by_element: Callable, scene: "Scene", mesh: Any, history: Any, pressed: bool = False) -> Callable | None:
    """Forces (3, N) and new history of `u` (3, N) and the step, or None where XLA is to do it.

    Args:
        by_element: `internal.by_element`, of arrays whose last axis counts elements.
        pressed: whether a pressure at the nodes (1, N) follows the step.
    """
    count, dtype = len(mesh.stiffness), mesh.stiffness.dtype
    if not wanted() or count % WIDTH or dtype not in (jnp.float32, jnp.float64):
        return None
    tissue = dataclasses.replace(scene.tissue, stiffness=None, capsule=None)
    tree = (tissue, scene.settings.hourglass, mesh.reference, mesh.stiffness, history)
    leaves, structure = jax.tree.flatten(tree)
    leaves = [jnp.asarray(x) for x in leaves]
    if any(x.dtype != dtype for x in leaves):
        return None
    slots = [_slot(x, count) for x in leaves]
    key = (structure, tuple(slots), dtype, scene.body.element)
    kernel = _remembered(key, lambda: _kernel(by_element, scene, mesh, structure, slots, dtype, pressed))
    if kernel is None:
        return None

    def forces(u: Float[Array, "3 N"], step, *fields: Float[Array, "c N"]) -> tuple[Float[Array, "3 N"], Any]:
        out = run(kernel, mesh.cells, [u, jnp.asarray(step, dtype), *fields, *leaves], u.shape[-1])
        return out[0], jax.tree.unflatten(jax.tree.structure(history), out[1:])

    return forces


def _remembered(key: Any, make: Callable[[], Kernel | None]) -> Kernel | None:
    if key not in _kernels:
        if len(_kernels) >= MOST_PROGRAMS:
            _kernels.clear()
        _kernels[key] = make()
    return _kernels[key]


def _slot(x: Array, count: int) -> Slot:
    return Slot("lane", x.shape[:-1]) if x.ndim and x.shape[-1] == count else Slot("uniform", x.shape)


def volumes(shares: Callable, scene: "Scene", mesh: Any) -> Callable:
    """The volume at the nodes (N,), m^3, of `u` (3, N), where `loop` is to be had for the same scene.

    Args:
        shares: `internal.volume_shares`, of arrays whose last axis counts elements.
    """
    leaves, structure = jax.tree.flatten(mesh.reference)
    slots = [_slot(x, len(mesh.stiffness)) for x in leaves]
    dtype, corners = mesh.stiffness.dtype, mesh.cells.shape[0]

    def one(u, *leaves):
        part = mesh._replace(cells=np.zeros((corners, 1)), reference=jax.tree.unflatten(structure, leaves))
        return [shares(scene, part, u)[None]]

    key = ("volumes", structure, tuple(slots), dtype, scene.body.element)
    kernel = _remembered(key, lambda: _tried(one, corners, [Slot("nodal", (3,)), *slots], ["nodal"], dtype))
    assert kernel is not None  # the loop itself does all of this and more

    def summed(u: Float[Array, "3 N"]) -> Float[Array, " N"]:
        return run(kernel, mesh.cells, [u, *leaves], u.shape[-1])[0][0]

    return summed


def _kernel(by_element, scene, mesh, structure, slots, dtype, pressed: bool) -> Kernel | None:
    """The kernel, tried out once; None where an operation has no form in C."""

    def one(u, step, *leaves):
        fields, leaves = ((leaves[0][0],), leaves[1:]) if pressed else ((), leaves)
        tissue, hourglass, reference, stiffness, history = jax.tree.unflatten(structure, leaves)
        settings = dataclasses.replace(scene.settings, hourglass=hourglass)
        here = dataclasses.replace(scene, tissue=tissue, settings=settings)
        bare = dict(cells=None, mass=None, nodal_volume=None, nodal_stiffness=None)
        part = mesh._replace(reference=reference, stiffness=stiffness, **bare)
        f, history = by_element(here, part, u, history, step, *fields)
        return [jnp.stack(f), *jax.tree.leaves(history)]

    ins = [Slot("nodal", (3,)), Slot("uniform", ()), *([Slot("nodal", (1,))] if pressed else []), *slots]
    outs = ["nodal"] + ["lane"] * (len(jax.eval_shape(one, *_shapes(ins, mesh.cells.shape[0], dtype))) - 1)
    return _tried(one, mesh.cells.shape[0], ins, outs, dtype)


def _tried(one: Callable, corners: int, ins: list[Slot], outs: list[str], dtype, width: int = WIDTH) -> Kernel | None:
    try:
        kernel = trace(one, corners, ins, outs, dtype, width)
        kernel.name(str(dtype), (False,) * len(ins))
    except Untold:
        return None
    except NotCompiled as refused:
        warnings.warn(f"the C compiler refused a loop, XLA's is taken: {refused}", stacklevel=2)
        return None
    return kernel


def contact(by_facet: Callable, probe: "Probe", patch: Any, grip: Any) -> Callable | None:
    """Contact at a place of the probe: of `u` (3, N), m, and the place (3,), m, the nodal forces (3, N), N, force (3,),
    N, and torque (3,), N m, on the tissue, what rubbing lost, J (or None), and the new memory. None: XLA is to do it.

    Args:
        by_facet: `contact.by_facet`, of arrays whose last axis counts facets.
    """
    dtype, count = probe.area.dtype, probe.area.shape[-1]
    if not wanted() or count % FACETS or dtype not in (jnp.float32, jnp.float64):
        return None
    bare = dataclasses.replace(probe, time=None, position=None, patch=None, area=None, mass=None)
    bare = dataclasses.replace(bare, offset=None, compliance=None)
    tree = (bare, probe.area, patch.x, grip)
    leaves, structure = jax.tree.flatten(tree)
    leaves = [jnp.asarray(x) for x in leaves]
    if any(x.dtype != dtype for x in leaves):
        return None
    own = [_by_facet(place, bare) for place, _ in jax.tree_util.tree_leaves_with_path(bare)]
    own += [True] * (len(leaves) - len(own))  # area, places and memory are
    slots = [
        Slot("lane", x.shape[:-1]) if mine and x.ndim else Slot("uniform", x.shape) for x, mine in zip(leaves, own)
    ]
    key = ("contact", structure, tuple(slots), dtype)
    kernel = _remembered(key, lambda: _contact(by_facet, structure, slots, len(patch.nodes), dtype))
    if kernel is None:
        return None
    sums = 2 + (probe.friction is not None)

    def touch(u: Float[Array, "3 N"], centre: Float[Array, " 3"]):
        out = run(kernel, patch.nodes, [u, jnp.asarray(centre, dtype), *leaves], u.shape[-1])
        after = jax.tree.unflatten(jax.tree.structure(grip), out[1 + sums :])
        return out[0], out[1], out[2], out[3] if sums > 2 else None, after

    return touch


def faces(by_face: Callable, joint: "Faces", seam: "Seam", memory: Any) -> Callable | None:
    """Cohesive faces: of `u` (3, N), m, the nodal forces (3, N), N, the new memory, and what each point lost in the
    step, J (q, P). None: XLA is to do it.

    Args:
        by_face: `faces.by_face`, of arrays whose last axis counts faces.
    """
    dtype, count = joint.area.dtype, joint.area.shape[-1]
    if not wanted() or count < FACETS or dtype not in (jnp.float32, jnp.float64):
        return None
    bare = dataclasses.replace(joint, minus=None, plus=None, mass=None, along=None, notch=None)
    leaves, structure = jax.tree.flatten((bare, seam.x, memory))
    leaves = [jnp.asarray(x) for x in leaves]
    if any(x.dtype != dtype for x in leaves):
        return None
    slots = [Slot("lane", x.shape[:-1]) if x.ndim else Slot("uniform", ()) for x in leaves]
    key = ("faces", structure, tuple(slots), dtype)
    kernel = _remembered(key, lambda: _faces(by_face, structure, slots, joint.minus.shape[1], dtype))
    if kernel is None:
        return None
    cells = jnp.concatenate([joint.plus.T, joint.minus.T])

    def hold(u: Float[Array, "3 N"]):
        out = run(kernel, cells, [u, *leaves], u.shape[-1])
        return out[0], jax.tree.unflatten(jax.tree.structure(memory), out[2:]), out[1]

    return hold


def _faces(by_face, structure, slots, corners: int, dtype) -> Kernel | None:
    """The kernel, tried out once; None where the law has an operation without a form in C."""

    def one(u, *leaves):
        joint, x, memory = jax.tree.unflatten(structure, leaves)
        held = by_face(joint, x, u[:, :corners], u[:, corners:], memory)
        return [jnp.concatenate([held.at, -held.at], 1), held.lost, *jax.tree.leaves(held.memory)]

    ins = [Slot("nodal", (3,)), *slots]
    found = jax.eval_shape(one, *_shapes(ins, 2 * corners, dtype))
    return _tried(one, 2 * corners, ins, ["nodal"] + ["lane"] * (len(found) - 1), dtype, FACETS)


def _by_facet(place: tuple, probe: "Probe") -> bool:
    """Whether the leaf there of a probe may differ from facet to facet."""
    return getattr(place[-1], "name", None) in probe.shape.by_facet


def _contact(by_facet, structure, slots, corners: int, dtype) -> Kernel | None:
    """The kernel, tried out once; None where the probe's form has an operation without a form in C."""

    def one(u, centre, *leaves):
        probe, area, x, grip = jax.tree.unflatten(structure, leaves)
        done = by_facet(dataclasses.replace(probe, area=area), x, u, centre, grip)
        f, x = done.f, done.x
        torque = [x[i - 2] * f[i - 1] - x[i - 1] * f[i - 2] for i in range(3)]
        sums = [jnp.stack([jnp.sum(t) for t in some]) for some in (f, torque)]
        sums += [] if done.lost is None else [jnp.sum(done.lost)]
        return [jnp.stack(done.at_nodes), *sums, *jax.tree.leaves(done.grip)]

    ins = [Slot("nodal", (3,)), Slot("uniform", (3,)), *slots]
    found = jax.eval_shape(one, *_shapes(ins, corners, dtype))
    memory = len(jax.tree.leaves(jax.tree.unflatten(structure, [0] * len(slots))[3]))
    outs = ["nodal"] + ["uniform"] * (len(found) - 1 - memory) + ["lane"] * memory
    return _tried(one, corners, ins, outs, dtype, FACETS)


def _shapes(ins, corners: int, dtype):
    last = {"nodal": (corners, 1), "lane": (1,), "uniform": ()}
    return [jax.ShapeDtypeStruct((*s.shape, *last[s.kind]), dtype) for s in ins]
