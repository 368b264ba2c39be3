"""What a page needs to show and, where it has no server, to compute: one JSON object."""

import base64
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from tissuejax.mesh.facets import boundary, triangles
from tissuejax.surrogate.cardinal import Table
from tissuejax.surrogate.precompute import Precomputed

SINGLE = np.float32


def coded(values, kind=SINGLE) -> str:
    """Base64 of little-endian numbers, single precision or 32-bit integers."""
    return base64.b64encode(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")).tobytes()).decode()


def plain_table(table: Table) -> dict:
    """A table for the page."""
    c = np.asarray(table.coefficients)
    return {
        "origin": np.asarray(table.origin, float).tolist(), "spacing": np.asarray(table.spacing, float).tolist(),
        "shape": list(c.shape), "data": coded(c),
    }  # fmt: skip


def skins(points: Float[np.ndarray, "N 3"], cells: Int[np.ndarray, "E k"], cut_y: float) -> dict:
    """Triangles of the whole surface, and of what is behind the plane y = cut_y."""
    kind = "hexahedron" if cells.shape[1] == 8 else "tetra"
    behind = points[cells].mean(1)[:, 1] > cut_y
    faces = triangles(boundary(cells, kind).nodes)
    cut = triangles(boundary(cells[behind], kind).nodes) if behind.any() else faces
    return {"faces": coded(faces, np.uint32), "cut": coded(cut, np.uint32)}


def of_surrogate(made: Precomputed, wrong: Sequence[str], replay: Mapping | None = None) -> dict:
    """The page's model of a surrogate."""
    s, record = made.surrogate, made.record
    middle = (np.asarray(s.low) + np.asarray(s.high)) / 2
    top = float(s.touch.sample(middle[None])[0, 0])
    rest = np.tensordot(s.surface.settled_coefficients.sample(middle[None])[0], np.asarray(s.surface.settled), 1)
    memory = None
    if s.memory is not None:
        memory = {
            "stress": plain_table(s.memory.stress), "strain": plain_table(s.memory.strain),
            "g": np.asarray(s.memory.g).tolist(), "tau": np.asarray(s.memory.tau).tolist(),
        }  # fmt: skip
    values = record["model"]["values"]
    return {
        "kind": "surrogate",
        "title": str(record.get("sample", "surrogate")),
        "what": f"{record['model']['energy']}: "
        + ", ".join(f"{k.split('.', 1)[-1]} {v:.4g}" for k, v in values.items()),
        "wrong": list(wrong),
        "low": np.asarray(s.low).tolist(), "high": np.asarray(s.high).tolist(), "depth": float(s.depth),
        "radius": float(s.radius), "start": [*middle.tolist(), top + 2e-3], "high_z": top,
        "middle": [*rest[:, :2].mean(0).tolist(), float(rest[:, 2].max()) * 0.7],
        "span": float(np.ptp(rest[:, :2], axis=0).max()),
        "touch": plain_table(s.touch), "law": plain_table(s.law), "coefficients": plain_table(s.surface.coefficients),
        "modes": coded(s.surface.modes), "settled": coded(s.surface.settled),
        "settled_coefficients": plain_table(s.surface.settled_coefficients), "memory": memory,
        "rub": {name: float(getattr(s.rub, name)) for name in ("friction", "give", "reach")}
        | {"strength": s.strength()}
        | {"slip": np.asarray(s.rub.slip, float).tolist()},
        **skins(rest, made.cells, float(middle[1])),
        **({"replay": dict(replay)} if replay else {}),
    }  # fmt: skip
