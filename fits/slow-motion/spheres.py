"""Contact between collision spheres, as the source's simulator had it: a sphere on every node of the tissue, interior
ones too, against one on the probe (Lister 2012, 4.3.5, fig. 4.17; radii from appendix B). Beside it the same press by
spheres on the surface's nodes alone, and by a ball against the facets."""

import jax
import jax.numpy as jnp
import numpy as np

from tissuejax.experiments.probing import assembled
from tissuejax.mesh.columns import box
from tissuejax.surrogate.ramp import Matter, bare_setup
from tissuejax.tled import contact, internal

TISSUE, PROBE = 9e-3, 2.5e-3  # m, radii of the spheres
STIFF = 4e3  # N/m of a pair of spheres: 0.1 mm of overlap at 0.4 N
SPEED, DAMPING = 0.02, 100.0  # m/s, slow enough for equilibrium; 1/s


def scene_of(matter: Matter, counts: tuple[int, int, int], size: tuple[float, float, float]):
    """A slab of equal elements, a ball above its middle, and the nodes of its top."""
    body = box(size, counts)
    nx, ny, nz = counts
    index = np.arange(len(body.points)).reshape(nx + 1, ny + 1, nz + 1)
    top = index[:, :, nz]
    patch = np.stack([v.ravel() for v in (top[:-1, :-1], top[1:, :-1], top[1:, 1:], top[:-1, 1:])], 1)
    setup = bare_setup(matter, body, patch, np.zeros(2), size[2] + matter.radius)
    scene, _ = assembled(matter.model, {k: jnp.asarray(float(v)) for k, v in matter.values.items()}, setup)
    return scene, top.ravel()


def by_spheres(scene, nodes, reach: float):
    """Force on the probe and on the nodes from pairs of spheres whose radii sum up to `reach`, m."""
    points, nodes = scene.body.points[nodes], np.asarray(nodes)

    def push(u, centre):
        apart = points + u.T[nodes] - centre
        far = jnp.linalg.norm(apart, axis=1)
        f = (STIFF * jnp.maximum(reach - far, 0.0) / far)[:, None] * apart
        return jnp.zeros_like(u).at[:, nodes].add(f.T), -f.sum(0)

    return push


def by_facets(scene):
    """The same of the scene's own ball against the facets."""
    patch, free = contact.patch(scene), contact.untouched(scene.probe)

    def push(u, centre):
        touch = contact.forces(scene.probe, patch, u, centre, free)
        return touch.nodal, touch.force

    return push


def press(scene, push, place, first: float, depths) -> np.ndarray:
    """Vertical force, N, at depths below the height `first` (m) of the probe's centre, pressed slowly over `place`."""
    mesh = internal.mesh(scene)
    mass = mesh.mass + scene.probe.mass
    h = min(float(scene.clock.step), 0.7 * np.sqrt(float(mass.min()) / STIFF))
    count = int(np.ceil((depths[-1] + 1e-4) / SPEED / h))
    rest, free = internal.rest(scene, mesh), np.ones(mass.shape)
    free[np.asarray(scene.body.fixed)] = 0.0

    def step(state, depth):
        u, v = state
        outer, force = push(u, jnp.append(jnp.asarray(place), first - depth))
        f = outer - internal.forces(scene, mesh, u, rest, h)[0]
        v = free * ((1 - DAMPING * h / 2) * v + h * f / mass) / (1 + DAMPING * h / 2)
        return (u + h * v, v), force[2]

    at = jnp.linspace(-1e-4, depths[-1], count)
    zero = jnp.zeros((3, len(mass)))
    force = jax.jit(lambda: jax.lax.scan(step, (zero, zero), at)[1])()
    return np.interp(depths, np.asarray(at), np.asarray(force))


def table(matter: Matter, size, counts, depths) -> dict:
    """Force at depths below first touch, N: by facets, by the surface's spheres, by all spheres; over a node and over
    the middle of a facet."""
    scene, top = scene_of(matter, counts, size)
    gap = np.array([size[0] / counts[0], size[1] / counts[1]]) / 2
    shift = np.array([counts[0] % 2, counts[1] % 2]) * gap  # of the nearest node from the middle
    places = {"over a node": shift, "between nodes": shift + gap}
    reach, everything = TISSUE + PROBE, np.arange(len(scene.body.points))
    found = {"elements": list(counts), "spacing_m": 2 * float(gap[0]), "depth_m": list(map(float, depths))}
    for where, place in places.items():
        above = np.linalg.norm(np.asarray(scene.body.points)[top, :2] - place, axis=1).min()
        touch = size[2] + np.sqrt(reach**2 - above**2)  # where the nearest sphere is met
        found[where] = {
            "ball against facets": press(scene, by_facets(scene), place, size[2] + matter.radius, depths),
            "spheres of the surface": press(scene, by_spheres(scene, top, reach), place, touch, depths),
            "spheres of all nodes": press(scene, by_spheres(scene, everything, reach), place, touch, depths),
        }
    return found
