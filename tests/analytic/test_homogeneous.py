"""Material tests against closed forms and independent root finds (scipy), never against our own stresses."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.specimens import SIZE, recording, stresses
from tissuejax.effects.catalogue import effect
from tissuejax.energies.catalogue import energy, volumetric
from tissuejax.errors import InputError
from tissuejax.experiments.homogeneous import axes
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

TIME = np.linspace(0.0, 1.0, 25)
STRETCH = np.linspace(0.6, 1.8, 25)
MOONEY = Model(energy("mooney-rivlin"))
C10, C01 = 300.0, 120.0


def predicted(model, values, kind, drive, **attributes):
    sample = Sample("s", {"r": recording("r", kind, TIME, drive, **attributes)})
    return stresses(predictor(model, sample).predict(values))["r"]


@pytest.mark.parametrize(
    ("kind", "formula"),
    [
        ("uniaxial", lambda l: 2 * (l - l**-2) * (C10 + C01 / l)),
        ("planar", lambda l: 2 * (l - l**-3) * (C10 + C01)),
        ("equibiaxial", lambda l: 2 * (l - l**-5) * (C10 + C01 * l**2)),
    ],
)
def test_mooney_rivlin_closed_forms(kind, formula):
    """Treloar 1975, The Physics of Rubber Elasticity, ch. 5."""
    found = predicted(MOONEY, {"energy.C10": C10, "energy.C01": C01}, kind, STRETCH)
    np.testing.assert_allclose(found, formula(STRETCH), rtol=1e-10, atol=1e-9)


def test_mooney_rivlin_biaxial():
    """P1 = 2 (l1 - 1/(l1^3 l2^2)) (C10 + C01 l2^2), Rivlin and Saunders 1951."""
    l1, l2 = STRETCH, np.linspace(1.3, 0.9, 25)
    found = predicted(MOONEY, {"energy.C10": C10, "energy.C01": C01}, "biaxial", np.stack([l1, l2], -1))
    np.testing.assert_allclose(found[:, 0], 2 * (l1 - 1 / (l1**3 * l2**2)) * (C10 + C01 * l2**2), rtol=1e-10)
    np.testing.assert_allclose(found[:, 1], 2 * (l2 - 1 / (l2**3 * l1**2)) * (C10 + C01 * l1**2), rtol=1e-10, atol=1e-9)


def test_mooney_rivlin_shear():
    """P12 = 2 (C10 + C01) gamma."""
    gamma = np.linspace(-1, 1, 25)
    found = predicted(MOONEY, {"energy.C10": C10, "energy.C01": C01}, "simple-shear", gamma)
    np.testing.assert_allclose(found, 2 * (C10 + C01) * gamma, rtol=1e-10, atol=1e-9)


def test_compound_shear():
    """P12 = dW/dgamma at fixed a, b, c: I1 = a^2 + b^2 + gamma^2 + c^2, and I2 gains gamma^2 c^2."""
    gamma, b = np.linspace(-0.5, 0.5, 25), 0.8
    c = b**-0.5
    found = predicted(MOONEY, {"energy.C10": C10, "energy.C01": C01}, "simple-shear", gamma, axial_stretch=b)
    np.testing.assert_allclose(found, 2 * gamma * (C10 + C01 * c**2), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("form", ["quadratic", "logarithmic"])
def test_compressible_uniaxial_against_energy_minimum(form):
    """The free sides take the lateral stretch of least energy; the stress is then dPsi/dl1 (scipy, own formulas)."""
    mu, K = 600.0, 3000.0

    def psi(l1, l2):
        J = l1 * l2 * l2
        U = 0.5 * K * ((J - 1) ** 2 if form == "quadratic" else np.log(J) ** 2)
        return 0.5 * mu * (J ** (-2 / 3) * (l1**2 + 2 * l2**2) - 3) + U

    l1 = np.linspace(0.7, 1.4, 25)
    model = Model(energy("neo-hookean"), volumetric(form))
    path = next(iter(model.energy.parameters)).name
    value = mu if path == "mu" else mu / 2
    found = predicted(model, {f"energy.{path}": value, "volumetric.K": K}, "uniaxial", l1)
    for stretch, stress in zip(l1, found):
        l2 = minimize_scalar(
            lambda x, s=stretch: psi(s, x), bounds=(0.5, 1.6), method="bounded", options={"xatol": 1e-11}
        ).x
        h = 1e-5
        expected = (psi(stretch + h, l2) - psi(stretch - h, l2)) / (2 * h)
        assert stress == pytest.approx(expected, rel=1e-5, abs=1e-3)


def test_compressible_small_strain_moduli():
    """Young's modulus 9 K mu / (3 K + mu); plane-strain modulus E / (1 - nu^2); shear mu."""
    mu, K = 600.0, 900.0
    E, nu = 9 * K * mu / (3 * K + mu), (3 * K - 2 * mu) / (2 * (3 * K + mu))
    model = Model(energy("reduced-polynomial-1"), volumetric("quadratic"))
    values = {"energy.C10": mu / 2, "volumetric.K": K}
    small = 1 + 1e-6 * TIME
    for kind, modulus in (("uniaxial", E), ("planar", E / (1 - nu**2)), ("equibiaxial", E / (1 - nu))):
        assert predicted(model, values, kind, small)[-1] == pytest.approx(modulus * 1e-6, rel=1e-4), kind
    assert predicted(model, values, "simple-shear", small - 1)[-1] == pytest.approx(mu * 1e-6, rel=1e-4)


def test_compressibility_effect_is_the_compressible_model():
    """Added as an effect to the incompressible base: the same small-strain moduli."""
    mu, K = 600.0, 3000.0
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("compressibility"))
    values = {"energy.C10": mu / 2, "effects.compressibility.immediate": 1 / K}
    found = predicted(model, values, "uniaxial", 1 + 1e-6 * TIME)[-1]
    assert found == pytest.approx(9 * K * mu / (3 * K + mu) * 1e-6, rel=1e-4)


@pytest.mark.parametrize(
    ("fibres", "form", "power", "close"),
    [
        ((), "logarithmic", 1.0, 1e-7),
        ((), "quadratic", -0.5, 2e-4),
        pytest.param(("anisotropy",), "logarithmic", 1.0, 1e-7, marks=pytest.mark.slow),
        pytest.param(("anisotropy",), "quadratic", -0.5, 2e-4, marks=pytest.mark.slow),
    ],
)
def test_compressibility_at_large_strain_is_a_volumetric_energy(form, power, close, fibres):
    """Faces solved inside the model and the volume added by the effect, sideways as well where fibres hold one side."""
    mu, K = 600.0, 1500.0
    more = [effect(name) for name in fibres]
    inside = Model(energy("reduced-polynomial-1"), volumetric(form)).with_effects(*more)
    added = Model(energy("reduced-polynomial-1")).with_effects(effect("compressibility"), *more)
    values = {"energy.C10": mu / 2}
    if fibres:
        values |= {"effects.anisotropy.k1": 900.0, "effects.anisotropy.k2": 1.0, "effects.anisotropy.angle": 1.2}
    drive = np.linspace(0.75, 1.4, 25)
    expected = predicted(inside, values | {"volumetric.K": K}, "uniaxial", drive)
    swollen = {"effects.compressibility.immediate": 1 / K, "effects.compressibility.power": power}
    found = predicted(added, values | swollen, "uniaxial", drive)
    np.testing.assert_allclose(found, expected, atol=close * np.abs(expected).max())
    tight = predicted(Model(energy("reduced-polynomial-1")).with_effects(*more), values, "uniaxial", drive)
    assert np.abs(tight - expected).max() > 0.05 * np.abs(expected).max()


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 2])
def test_fibres_narrow_one_side_more(angle):
    """Uniaxial tension with fibres in the 1-2 plane: lateral stretch of least energy (scipy, own formulas)."""
    mu, k1, k2 = 400.0, 300.0, 1.5
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("anisotropy"))
    values = {
        "energy.C10": mu / 2,
        "effects.anisotropy.k1": k1,
        "effects.anisotropy.k2": k2,
        "effects.anisotropy.angle": angle,
    }
    l1 = np.linspace(1.0, 1.3, 25)
    found = predicted(model, values, "uniaxial", l1)

    def psi(l1, l2):
        E = max(np.cos(angle) ** 2 * l1**2 + np.sin(angle) ** 2 * l2**2 - 1, 0.0)
        return 0.5 * mu * (l1**2 + l2**2 + (l1 * l2) ** -2 - 3) + 0.5 * k1 / k2 * (np.exp(k2 * E * E) - 1)

    h = 1e-6
    for stretch, stress in zip(l1, found):
        slope = lambda x, s=stretch: (psi(s, x + h) - psi(s, x - h)) / (2 * h)  # noqa: E731
        l2 = brentq(slope, 0.6, 1.2, xtol=1e-14)
        assert stress == pytest.approx((psi(stretch + h, l2) - psi(stretch - h, l2)) / (2 * h), rel=1e-5, abs=1e-3)


def test_directions_turn_with_the_specimen():
    """Fibres along y: a specimen cut along y feels them, one cut along x feels them as transverse."""
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("anisotropy"))
    fibre = {"energy.C10": 200.0, "effects.anisotropy.k1": 300.0, "effects.anisotropy.angle": np.pi / 2}
    along = fibre | {"effects.anisotropy.angle": 0.0}
    l1 = np.linspace(1.0, 1.3, 25)
    y = predicted(model, fibre, "uniaxial", l1, direction=[0.0, 1.0, 0.0])
    np.testing.assert_allclose(y, predicted(model, along, "uniaxial", l1), rtol=1e-9, atol=1e-9)
    x = predicted(model, fibre, "uniaxial", l1, direction=[1.0, 0.0, 0.0])
    assert y[-1] > 1.5 * x[-1]


def test_the_normal_of_sheared_planes_turns_what_fibres_feel():
    """Fibres along the normal are tilted and stretched by shear, fibres across both are not touched: by hand,
    F = 1 + g d n', so |F n|^2 = 1 + g^2 and |F (d x n)| = 1."""
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("anisotropy"))
    fibre = {"energy.C10": 200.0, "effects.anisotropy.k1": 300.0, "effects.anisotropy.angle": np.pi / 2}  # along y
    g = np.linspace(0.0, 0.5, 25)

    def shear(direction, normal):
        return predicted(model, fibre, "simple-shear", g, direction=direction, normal=normal)

    plain = shear([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])  # fibres across both
    np.testing.assert_allclose(plain, 400.0 * g, rtol=1e-6, atol=1e-6)
    stretched = shear([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    assert stretched[-1] > 1.05 * plain[-1]
    np.testing.assert_allclose(shear([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]), stretched, rtol=1e-9, atol=1e-9)
    for direction, normal in ((None, [0, 1, 0]), ([1, 0, 0], [1, 0.2, 0])):
        with pytest.raises(InputError, match="normal"):
            axes(direction, normal)


def test_machine_compliance_against_a_root_find():
    mu, c = 600.0, 4e-3
    share = c * SIZE["area"] / SIZE["height"]
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("machine-compliance"))
    drive = np.linspace(0.7, 1.4, 25)
    found = predicted(model, {"energy.C10": mu / 2, "effects.machine-compliance.compliance": c}, "uniaxial", drive)
    stress = lambda x: mu * (x - x**-2)  # noqa: E731
    for recorded, value in zip(drive, found):
        x = brentq(lambda x, r=recorded: x + share * stress(x) - r, 0.3, 2.0, xtol=1e-14)
        assert value == pytest.approx(stress(x), rel=1e-7, abs=1e-6)


def test_what_ages_bends_the_rig():
    """x + share f(t) P_e(x) = recorded: the rig feels the specimen as it is by then."""
    mu, c, rate = 600.0, 4e-3, 0.4
    share = c * SIZE["area"] / SIZE["height"]
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("machine-compliance"), effect("aging"))
    values = {
        "energy.C10": mu / 2,
        "effects.machine-compliance.compliance": c,
        "effects.aging.rate": rate,
    }
    drive = np.linspace(0.7, 1.4, 25)
    found = predicted(model, values, "uniaxial", drive)
    factor = np.exp(rate * TIME)
    for f, recorded, value in zip(factor, drive, found):
        x = brentq(lambda x, f=f, r=recorded: x + share * f * mu * (x - x**-2) - r, 0.3, 2.0, xtol=1e-14)
        assert value == pytest.approx(f * mu * (x - x**-2), rel=1e-6, abs=1e-6)


def test_volume_ages_with_the_shape():
    """The same deformation at every age: the stress of a compressible specimen is its own, times the factor."""
    young = Model(energy("reduced-polynomial-1")).with_effects(effect("compressibility"))
    values = {"energy.C10": 300.0, "effects.compressibility.immediate": 2e-4}
    old, rate = young.with_effects(effect("aging")), 0.5
    drive = np.linspace(0.8, 1.4, 25)
    found = predicted(old, values | {"effects.aging.rate": rate}, "uniaxial", drive)
    expected = np.exp(rate * TIME) * predicted(young, values, "uniaxial", drive)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9)


def test_slack_against_its_definition():
    mu, gap = 600.0, 0.04
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("slack"))
    drive = np.linspace(0.8, 1.3, 25)
    found = predicted(model, {"energy.C10": mu / 2, "effects.slack.gap": gap}, "uniaxial", drive)
    x = np.where(drive > 1 + gap, drive - gap, np.where(drive < 1 - gap, drive + gap, 1.0))
    np.testing.assert_allclose(found, mu * (x - x**-2), rtol=1e-10, atol=1e-9)


def test_platen_friction_against_its_formula():
    mu, friction = 600.0, 0.2
    model = Model(energy("reduced-polynomial-1")).with_effects(effect("platen-friction"))
    drive = np.linspace(0.6, 1.0, 25)
    found = predicted(model, {"energy.C10": mu / 2, "effects.platen-friction.friction": friction}, "uniaxial", drive)
    d, h = SIZE["diameter"] * drive**-0.5, SIZE["height"] * drive
    np.testing.assert_allclose(found, mu * (drive - drive**-2) * (1 + friction * d / (3 * h)), rtol=1e-10, atol=1e-9)
