"""One battery for every strain energy found: what must hold for any of them, whatever its formula.

Strains: random ones, and those where principal stretches are equal (rest, uniaxial, equibiaxial), in turned frames.
"""

import functools
import inspect

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tissuejax.energies import catalogue, stress
from tissuejax.energies.paths import SECOND, principal
from tissuejax.energies.published import PUBLISHED
from tissuejax.energies.strain import Strain
from tissuejax.tensors import Sym, double_dot, right_cauchy_green

CASES = {
    name: (energy, {d.name: d.default for d in energy.parameters}) for name, energy in catalogue.examples().items()
}
for _name in ("ex-vivo-ogden", "ex-vivo-log", "ex-vivo-exp", "in-vivo-1", "in-vivo-2", "in-vivo-3"):
    CASES[_name] = (PUBLISHED[_name].energy, PUBLISHED[_name].constants)
_oblique = catalogue.energy("gent+fibre")
CASES["gent+fibre, oblique"] = (
    _oblique,
    {d.name: d.default for d in _oblique.parameters} | {"angle": 0.7, "kappa": 0.05},
)
ALL = pytest.mark.parametrize("case", CASES)
EXAMPLES = pytest.mark.parametrize("case", catalogue.examples())
N = 24
REST = Sym(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


# Compiled for once or twice: little time in the compiler is worth more than speed.
quick = functools.partial(jax.jit, compiler_options={"xla_backend_optimization_level": "0"})


def turns(rng, n):
    """Random rotations."""
    q, r = np.linalg.qr(rng.normal(size=(n, 3, 3)))
    q = q * np.sign(np.einsum("nii->ni", r))[:, None, :]
    return q * np.sign(np.linalg.det(q))[:, None, None]


def strains(n=N, seed=3, spread=0.12):
    """Deformation gradients: random, and with two or three equal principal stretches in random frames."""
    rng = np.random.default_rng(seed)
    stretch = np.exp(spread * rng.normal(size=(n, 3)))
    stretch[: n // 4, 2] = stretch[: n // 4, 1]
    stretch[n // 4 : n // 3, 1:] = stretch[n // 4 : n // 3, :1]
    Q = turns(rng, n)
    return jnp.asarray(turns(rng, n) @ np.swapaxes(Q, 1, 2) @ (stretch[:, :, None] * Q))


def key(case):
    """Cases of one energy differ in constants only and share what is compiled."""
    energy = CASES[case][0]
    return catalogue.name_of(energy), catalogue.forms_of(energy).get("ogden")


@functools.cache
def compiled(name, form):
    """psi, S and tangent of an energy as one compiled function of (p, C)."""
    energy = catalogue.energy(name, form)
    return quick(
        lambda p, C: (
            stress.energy_density(energy, None, p, None, C),
            stress.pk2_isochoric(energy, p, C),
            stress.tangent(energy, None, p, None, C),
        )
    )


@functools.cache
def compiled_gradients(name, form):
    """Derivatives in the parameters, of the energy and of the stress, at one point."""
    energy = catalogue.energy(name, form)
    psi = lambda p, C: stress.energy_density(energy, None, p, None, C)  # noqa: E731
    work = lambda p, C: sum(k * s for k, s in enumerate(stress.pk2_isochoric(energy, p, C), 1))  # noqa: E731
    return quick(lambda p, C: (jax.grad(psi)(p, C), jax.grad(work)(p, C)))


def of(case, C, p=None):
    """psi, S and tangent at C; always N points in the compiled function, so that it is compiled once."""
    p = {n: jnp.asarray(v, dtype=float) for n, v in (CASES[case][1] if p is None else p).items()}
    shape = jnp.shape(C[0])
    psi, S, D = compiled(*key(case))(p, Sym(*(jnp.broadcast_to(jnp.asarray(c, dtype=float), (N,)) for c in C)))
    return (psi, S, D) if shape else (psi[0], Sym(*(x[0] for x in S)), D[0])


def gradients(case, C):
    p = {n: jnp.asarray(v, dtype=float) for n, v in CASES[case][1].items()}
    return compiled_gradients(*key(case))(p, Sym(*(jnp.asarray(c, dtype=float) for c in C)))


def shear(case):
    return float(abs(CASES[case][0].initial_shear_modulus(CASES[case][1])))


def test_the_walk_finds_the_whole_catalogue():
    wanted = "neo-hookean mooney-rivlin polynomial reduced-polynomial ogden log-ogden exp-ogden gent arruda-boyce "
    wanted += "demiray veronda-westmann humphrey"
    assert set(wanted.split()) <= set(catalogue.energies())


@ALL
def test_declares_itself(case):
    energy, p = CASES[case]
    names = [d.name for d in energy.parameters]
    assert len(set(names)) == len(names)
    assert set(names) == set(p)
    assert all(
        d.lower <= d.default <= d.upper and d.unit in {"Pa", "1", "rad"} and d.meaning for d in energy.parameters
    )
    for kind in {type(energy), type(getattr(energy, "matrix", energy))}:
        assert kind.formula
        assert kind.shear_modulus
        assert kind.source
        assert "psi" in inspect.getdoc(kind)
        assert "Source:" in inspect.getdoc(kind)
    form = catalogue.forms_of(energy).get("ogden")
    assert catalogue.energy(catalogue.name_of(energy), form) == energy


@ALL
def test_rest_costs_nothing_and_pulls_nowhere(case):
    psi, S, _ = of(case, REST)
    size = shear(case) * 1e-9  # of constants that cancel, like in-vivo-2's
    assert abs(psi) < size
    assert max(abs(x) for x in S) < size


@ALL
def test_initial_shear_modulus_is_that_of_the_tangent(case):
    energy, p = CASES[case]
    G = float(energy.initial_shear_modulus(p))
    assert G > 0
    D = np.asarray(of(case, REST)[2])
    deviator = np.eye(3) - 1 / 3
    expected = np.block([[2 * G * deviator, np.zeros((3, 3))], [np.zeros((3, 3)), G * np.eye(3)]])
    np.testing.assert_allclose(D, expected, atol=1e-8 * G)


@ALL
def test_strain_of_one_millionth_gives_hooke(case):
    # S = 2 G dev(e) + O(e^2): relative agreement to a few e, far above the round-off it would show if it cancelled.
    G = float(CASES[case][0].initial_shear_modulus(CASES[case][1]))
    e = 1e-6 * np.array([1.0, -0.3, -0.2, 0.4, -0.5, 0.1])  # small rotations cancel in C; off-diagonals are 2 e_xy / 2
    C = Sym(1 + 2 * e[0], 1 + 2 * e[1], 1 + 2 * e[2], 2 * e[3], 2 * e[4], 2 * e[5])
    S = np.array(of(case, C)[1])
    hooke = 2 * G * (e - np.array([1, 1, 1, 0, 0, 0]) * e[:3].sum() / 3)
    np.testing.assert_allclose(S, hooke, rtol=1e-3, atol=2e-5 * G * 1e-6 * 10)


@ALL
def test_stress_is_the_slope_of_the_energy_and_tangent_that_of_the_stress(case, rng):
    C = right_cauchy_green(strains())
    d = rng.normal(size=6)
    h = 1e-5
    step = lambda k: of(case, Sym(*(c + k * h * x for c, x in zip(C, d))))  # noqa: E731
    ahead, behind = step(1), step(-1)
    _, S, D = of(case, C)
    slope = (ahead[0] - behind[0]) / (2 * h)
    dE = np.array([0.5, 0.5, 0.5, 1, 1, 1]) * d  # Voigt, engineering shear
    scale = float(jnp.max(jnp.abs(D)))
    np.testing.assert_allclose(sum(s * x for s, x in zip(S, dE)), slope, atol=1e-8 * scale)
    dS = (jnp.stack(ahead[1], -1) - jnp.stack(behind[1], -1)) / (2 * h)
    # The onset of fibres curves over 1e-3 of strain: there a difference quotient is less exact.
    np.testing.assert_allclose(D @ dE, dS, atol=(2e-4 if "angle" in CASES[case][1] else 1e-6) * scale)


@ALL
def test_tangent_is_symmetric_and_stress_isochoric(case):
    C = right_cauchy_green(strains())
    _, S, D = of(case, C)
    np.testing.assert_allclose(D, np.swapaxes(D, -1, -2), atol=1e-11 * float(jnp.max(jnp.abs(D))))
    np.testing.assert_allclose(double_dot(S, C), 0, atol=1e-9 * float(jnp.max(jnp.abs(D))))


@ALL
def test_objective(case, rng):
    F = strains()
    Q = jnp.asarray(turns(rng, 1)[0])

    def sigma(F):
        return F @ of(case, right_cauchy_green(F))[1].matrix() @ jnp.swapaxes(F, 1, 2)

    turned = Q @ sigma(F) @ Q.T
    np.testing.assert_allclose(sigma(Q @ F), turned, atol=1e-9 * (shear(case) + float(jnp.max(jnp.abs(turned)))))


@ALL
def test_isotropic_or_turning_with_its_fibres(case, rng):
    C = right_cauchy_green(strains()).matrix()
    p = CASES[case][1]
    if "angle" in p:
        turn = 0.4
        Q = jnp.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1.0]])
        turned = p | {"angle": p["angle"] + turn}
    else:
        Q, turned = jnp.asarray(turns(rng, 1)[0]), p
    psi, S, _ = of(case, Sym.from_matrix(C))
    psi_turned, S_turned, _ = of(case, Sym.from_matrix(Q @ C @ Q.T), turned)
    np.testing.assert_allclose(psi_turned, psi, rtol=1e-9, atol=1e-9 * shear(case))
    scale = shear(case) + float(jnp.max(jnp.abs(S.matrix())))
    np.testing.assert_allclose(S_turned.matrix(), Q @ S.matrix() @ Q.T, atol=1e-9 * scale)


@ALL
def test_tangent_is_continuous_through_equal_stretches(case):
    # An even, smooth function of the gap: the mean of both sides differs by O(gap^2).
    gap = 1e-4
    at, ahead, behind = (of(case, Sym(1.3, 0.9 + k * gap, 0.9 - k * gap, 0.0, 0.0, 0.0))[2] for k in (0, 1, -1))
    np.testing.assert_allclose(0.5 * (ahead + behind), at, atol=1e-5 * float(jnp.max(jnp.abs(at))))
    assert np.isfinite(at).all()


@EXAMPLES
def test_vmap_and_arrays_agree_with_single_points(case):
    energy, p = CASES[case]
    C = right_cauchy_green(strains())
    together = jnp.stack(of(case, C)[1], -1)
    mapped = quick(jax.vmap(lambda c: jnp.stack(stress.pk2_isochoric(energy, p, c))))(C)
    single = jnp.stack(of(case, Sym(*(c[4] for c in C)))[1])
    scale = shear(case)
    np.testing.assert_allclose(mapped, together, atol=1e-10 * scale)
    np.testing.assert_allclose(single, together[4], atol=1e-10 * scale)


@EXAMPLES
def test_float32_agrees_with_float64_and_stays_float32(case):
    energy, p = CASES[case]
    C = right_cauchy_green(strains(spread=0.08))
    want = of(case, C)[1]
    got = quick(lambda C: stress.pk2_isochoric(energy, p, C))(Sym(*(c.astype(jnp.float32) for c in C)))
    assert all(x.dtype == jnp.float32 for x in got)
    # Constants that cancel amplify round-off: the sum of their sizes is what float32 is relative to.
    size = sum(abs(v) for n, v in p.items() if n[0] in "mCk") + shear(case)
    np.testing.assert_allclose(jnp.stack(got), jnp.stack(want), atol=2e-5 * size, rtol=1e-4)


@ALL
@settings(max_examples=40, deadline=None)
@given(
    l1=st.floats(0.62, 1.8),
    l2=st.floats(0.62, 1.8) | st.sampled_from([1.0]),
    equal=st.sampled_from(["no", "12", "13"]),
    J=st.floats(0.9, 1.1),
)
def test_gradients_are_finite_over_the_valid_range(case, l1, l2, equal, J):
    l2 = {"no": l2, "12": l1, "13": l1**-2}[equal]
    g = J ** (2 / 3)
    C = Sym(g * l1**2, g * l2**2, g * (l1 * l2) ** -2, 0.0, 0.0, 0.0)
    for x in jax.tree.leaves((of(case, C), gradients(case, C))):
        assert np.isfinite(x).all()


@ALL
@pytest.mark.parametrize("stretch", [0.05, 6.0])
def test_beyond_the_valid_range_stays_finite_and_says_so(case, stretch):
    energy, p = CASES[case]
    p = {name: jnp.asarray(value) for name, value in p.items()}
    strain = principal(jnp.asarray(stretch), SECOND["uniaxial"](stretch))
    for x in jax.tree.leaves((of(case, strain.C), gradients(case, strain.C))):
        assert np.isfinite(x).all()
    if getattr(energy, "matrix", energy).valid != "all stretches":
        assert energy.margin(p, strain) < 0
    assert energy.margin(p, Strain.of(Sym(*map(jnp.asarray, REST)))) > 0
