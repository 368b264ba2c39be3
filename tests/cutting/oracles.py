"""Closed forms of cutting and of the laws, by algebra; nothing here imports the simulation."""

from scipy.optimize import minimize_scalar


def layer_energy(stretch: float, mu: float, K: float) -> float:
    """Neo-Hookean energy density of a layer stretched across and held in its plane, K/2 (J - 1)^2, Pa."""
    return mu / 2 * ((2 + stretch**2) * stretch ** (-2 / 3) - 3) + K / 2 * (stretch - 1) ** 2


def layer_stress(stretch: float, mu: float, K: float) -> float:
    """Its nominal stress, Pa."""
    d = 1e-6
    return (layer_energy(stretch + d, mu, K) - layer_energy(stretch - d, mu, K)) / (2 * d)


def steady_force(G: float, b: float, W: float, mu: float, K: float, penalty: float) -> tuple[float, float]:
    """Force per width on a blade of thickness b in a slab of half height W, N/m, and the pressure on its flat, Pa.

    In the steady state the work of the blade goes into parting (G) and into the two layers that it leaves squeezed
    behind it; the penetration d makes that least (virtual work, any strain, any law).
    """

    def energy(d):
        return 2 * (W * layer_energy(1 - (b / 2 - d) / W, mu, K) + penalty * d**2 / 2)

    best = minimize_scalar(energy, bounds=(0, b / 2), method="bounded", options={"xatol": 1e-12})
    return G + best.fun, penalty * best.x
