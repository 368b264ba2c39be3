"""Cards: what stands in them, put through each solver's published formula by hand, gives our stress.

The formulas are written here once more, over principal stretches, from the manuals the cards name; nothing of the
package's energies is used on that side.
"""

import re
import shutil
import subprocess

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import tissuejax as tj
from tests.specimens import recording
from tissuejax.cards.catalogue import card, cards
from tissuejax.cards.material import material
from tissuejax.energies import catalogue, stress
from tissuejax.errors import InputError
from tissuejax.experiments.predictor import predictor
from tissuejax.model import Model
from tissuejax.recordings.recording import Sample

STRETCHES = np.array([[1.3, 0.9, 0.88], [0.7, 1.15, 1.2], [1.1, 1.1, 0.85], [1.02, 0.97, 1.05]])
K = 40e3
LAWS = {
    "neo-hookean": {"mu": 3000.0},
    "mooney-rivlin": {"C10": 900.0, "C01": 400.0},
    "polynomial-2": {"C10": 500.0, "C01": 200.0, "C20": 90.0, "C11": -30.0, "C02": 55.0},
    "reduced-polynomial-3": {"C10": 800.0, "C20": 300.0, "C30": 70.0},
    "ogden-2": {"mu1": 700.0, "alpha1": 3.1, "mu2": -250.0, "alpha2": -4.2},
    "ogden-1": {"mu1": 900.0, "alpha1": -5.0},
    "arruda-boyce": {"mu": 1000.0, "lambda_m": 2.2},
    "gent": {"mu": 1500.0, "Jm": 4.0},
    "veronda-westmann": {"C1": 400.0, "C2": 1.7},
}
NOT = {  # what the manuals have no card for
    "abaqus": {"gent", "veronda-westmann"},
    "calculix": {"gent", "veronda-westmann"},
    "febio": {"polynomial-2"},
    "ansys": {"veronda-westmann"},
    "ls-dyna": {"arruda-boyce", "gent", "veronda-westmann"},
    "sofa": {"polynomial-2", "reduced-polynomial-3", "ogden-2", "arruda-boyce", "gent"},
}


def ours(name, volumetric, l):
    """Principal nominal stresses of the package."""
    energy = catalogue.energy(name, "mu/alpha" if name.startswith("ogden") else None)
    bulk = catalogue.volumetric(volumetric)
    P = stress.pk1(energy, bulk, LAWS[name], {"K": K}, jnp.asarray(l)[:, :, None] * jnp.eye(3))
    return np.asarray(jnp.diagonal(P, axis1=1, axis2=2))


def written(name, solver, volumetric, **options):
    model = tj.material(name, ogden_form="mu/alpha" if name.startswith("ogden") else None, volumetric=volumetric)
    values = {f"energy.{n}": v for n, v in LAWS[name].items()} | ({"volumetric.K": K} if volumetric else {})
    return card(solver).text(material(model, values, density=1000.0, **options))


def slope(W, l):
    """dW/dl_i by a complex step: exact to rounding."""
    out = np.empty(l.shape)
    for i in range(3):
        z = l.astype(complex)
        z[:, i] += 1e-30j
        out[:, i] = W(*z.T).imag / 1e-30
    return out


def invariants(a, b, c):
    J = a * b * c
    I1 = J ** (-2 / 3) * (a**2 + b**2 + c**2)
    I2 = J ** (-4 / 3) * (a**2 * b**2 + b**2 * c**2 + c**2 * a**2)
    return I1, I2, J


def sums(alpha, a, b, c):
    J = a * b * c
    return J ** (-alpha / 3) * (a**alpha + b**alpha + c**alpha) - 3


def eight_chains(mu, n, I1):
    c = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
    return mu * sum(ci / n ** (i - 1) * (I1**i - 3**i) for i, ci in enumerate(c, start=1))


def powers(D, J):
    return sum((J - 1) ** (2 * i) / d for i, d in enumerate(D, start=1) if d)


def numbers(text):
    return [float(x) for x in re.split(r"[,\s]+", text.strip()) if x]


def abaqus(text):
    """W of an *HYPERELASTIC block, Abaqus Analysis User's Guide and CalculiX manual."""
    block = re.search(r"^\*HYPERELASTIC, ([A-Z \-]+)(?:, N=(\d))?[^\n]*\n((?:[^*][^\n]*\n)+)", text, re.M)
    kind, n, v = block[1].strip(), int(block[2] or 1), numbers(block[3])

    def W(a, b, c):
        I1, I2, J = invariants(a, b, c)
        if kind == "NEO HOOKE":
            return v[0] * (I1 - 3) + powers(v[1:], J)
        if kind == "MOONEY-RIVLIN":
            return v[0] * (I1 - 3) + v[1] * (I2 - 3) + powers(v[2:], J)
        if kind == "POLYNOMIAL":
            assert n == 2
            x, y = I1 - 3, I2 - 3
            return v[0] * x + v[1] * y + v[2] * x**2 + v[3] * x * y + v[4] * y**2 + powers(v[5:], J)
        if kind == "REDUCED POLYNOMIAL":
            return sum(v[i] * (I1 - 3) ** (i + 1) for i in range(n)) + powers(v[n:], J)
        if kind == "OGDEN":
            terms = zip(v[0 : 2 * n : 2], v[1 : 2 * n : 2])
            return sum(2 * mu / al**2 * sums(al, a, b, c) for mu, al in terms) + powers(v[2 * n :], J)
        assert kind == "ARRUDA-BOYCE"
        return eight_chains(v[0], v[1] ** 2, I1) + ((J**2 - 1) / 2 - np.log(J)) / v[2]

    return W


def ansys(text):
    """W of TB,HYPER, Ansys Material Reference."""
    head = re.search(r"^TB,HYPER,1,1,(\d*),(\w+)", text, re.M)
    n, kind = int(head[1] or 1), head[2]
    v = [x for line in re.findall(r"^TBDATA,\d+,(.*)$", text.split("TB,PRONY")[0], re.M) for x in numbers(line)]

    def W(a, b, c):
        I1, I2, J = invariants(a, b, c)
        other = (J**2 - 1) / 2 - np.log(J)
        if kind == "NEO":
            return v[0] / 2 * (I1 - 3) + powers(v[1:], J)
        if kind == "MOONEY":
            return v[0] * (I1 - 3) + v[1] * (I2 - 3) + powers(v[2:], J)
        if kind == "POLY":
            x, y = I1 - 3, I2 - 3
            return v[0] * x + v[1] * y + v[2] * x**2 + v[3] * x * y + v[4] * y**2 + powers(v[5:], J)
        if kind == "YEOH":
            return sum(v[i] * (I1 - 3) ** (i + 1) for i in range(n)) + powers(v[n:], J)
        if kind == "OGDEN":
            terms = zip(v[0 : 2 * n : 2], v[1 : 2 * n : 2])
            return sum(mu / al * sums(al, a, b, c) for mu, al in terms) + powers(v[2 * n :], J)
        if kind == "GENT":
            return -v[0] * v[1] / 2 * np.log(1 - (I1 - 3) / v[1]) + other / v[2]
        assert kind == "BOYCE"
        return eight_chains(v[0], v[1] ** 2, I1) + other / v[2]

    return W


def febio(text):
    """W of an uncoupled material, FEBio User Manual 4; U = k/2 ln(J)^2."""
    kind = re.findall(r'type="([^"]+)"', text)[-1]
    v = {tag: float(x) for tag, x in re.findall(r"<(\w+)>([^<]+)</", text)}

    def W(a, b, c):
        I1, I2, J = invariants(a, b, c)
        U = v["k"] / 2 * np.log(J) ** 2
        if kind == "Mooney-Rivlin":
            return v["c1"] * (I1 - 3) + v["c2"] * (I2 - 3) + U
        if kind == "Yeoh":
            return sum(v[f"c{i}"] * (I1 - 3) ** i for i in range(1, 7) if f"c{i}" in v) + U
        if kind == "Ogden":
            return sum(v[f"c{i}"] / v[f"m{i}"] ** 2 * sums(v[f"m{i}"], a, b, c) for i in (1, 2) if f"c{i}" in v) + U
        if kind == "Veronda-Westmann":
            return v["c1"] * (np.exp(v["c2"] * (I1 - 3)) - 1) - v["c1"] * v["c2"] / 2 * (I2 - 3) + U
        if kind == "Gent":
            return -v["G"] * v["Jm"] / 2 * np.log(1 - (I1 - 3) / v["Jm"]) + U
        assert kind == "Arruda-Boyce"
        return eight_chains(v["mu"], v["N"], I1) + U

    return W


def sofa(text):
    """W of SOFA's material headers (MooneyRivlin, Ogden, VerondaWestman), U = k0/2 ln(J)^2."""
    kind, v = re.search(r'materialName="(\w+)"', text)[1], numbers(re.search(r'ParameterSet="([^"]+)"', text)[1])

    def W(a, b, c):
        I1, I2, J = invariants(a, b, c)
        U = v[2] / 2 * np.log(J) ** 2
        if kind == "MooneyRivlin":
            return v[0] * (I1 - 3) + v[1] * (I2 - 3) + U
        if kind == "Ogden":
            return v[0] / v[1] ** 2 * sums(v[1], a, b, c) + U
        assert kind == "VerondaWestman"
        return v[0] * (np.exp(v[1] * (I1 - 3)) - 1) - v[0] * v[1] / 2 * (I2 - 3) + U

    return W


def lsdyna(text):
    """Shape part of W, LS-DYNA Keyword Manual II, MAT_077_H and MAT_077_O."""
    lines = [x for x in text.splitlines() if not x.startswith("$")]
    if "*MAT_OGDEN_RUBBER_TITLE" in lines:
        at = lines.index("*MAT_OGDEN_RUBBER_TITLE")
        terms = [(m, a) for m, a in zip(numbers(lines[at + 3]), numbers(lines[at + 4])) if m]
        return lambda a, b, c: sum(mu / al * sums(al, a, b, c) for mu, al in terms)
    v = numbers(lines[lines.index("*MAT_HYPERELASTIC_RUBBER_TITLE") + 3])

    def W(a, b, c):
        x, y = (i - 3 for i in invariants(a, b, c)[:2])
        return v[0] * x + v[1] * y + v[2] * x * y + v[3] * x**2 + v[4] * y**2 + v[5] * x**3

    return W


FORMULAS = {"abaqus": abaqus, "calculix": abaqus, "febio": febio, "ansys": ansys, "ls-dyna": lsdyna, "sofa": sofa}
LOGARITHMIC = {"febio", "sofa"}
OWN_VOLUME = {"arruda-boyce", "gent"}  # ABAQUS and ANSYS take another U for these


def test_every_card_has_a_formula_here():
    assert set(cards()) == set(FORMULAS) == set(NOT)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("solver", FORMULAS)
def test_constants_in_the_card_give_our_stress(solver, name):
    volumetric = "logarithmic" if solver in LOGARITHMIC else "quadratic"
    if name in NOT[solver]:
        with pytest.raises(InputError, match=solver):
            written(name, solver, volumetric)
        return
    theirs, own = (
        slope(FORMULAS[solver](written(name, solver, volumetric)), STRETCHES),
        ours(name, volumetric, STRETCHES),
    )
    if solver == "ls-dyna" or (name in OWN_VOLUME and solver not in LOGARITHMIC):  # shape only: pressure taken out
        theirs, own = (P * STRETCHES - (P * STRETCHES)[:, 2:] for P in (theirs, own))
    np.testing.assert_allclose(theirs, own, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(("units", "factor"), [("mm-t-s", 1e-6), ("mm-g-ms", 1e-6)])
def test_units_of_the_card(units, factor):
    plain, scaled = (
        slope(abaqus(written("ogden-2", "abaqus", "quadratic", units=u)), STRETCHES) for u in ("m-kg-s", units)
    )
    np.testing.assert_allclose(scaled, factor * plain, rtol=1e-9)


def test_relaxation_of_the_cards_is_ours():
    model = tj.material("neo-hookean", effects=["viscoelasticity-2"])
    g = {"g1": 0.25, "g2": 0.4, "tau1": 0.5, "tau2": 6.0}
    values = {"energy.mu": 2000.0} | {f"effects.viscoelasticity.{k}": v for k, v in g.items()}
    values = model.defaults | values
    time = np.array([0.0, 1e-9, 0.3, 1.0, 4.0, 20.0])
    held = recording("hold", "uniaxial", time, np.array([1.0, 1.4, 1.4, 1.4, 1.4, 1.4]))
    P = predictor(model, Sample("s", {"hold": held})).predict(values)["hold"].channels["nominal_stress"].values
    share = np.asarray(P)[1:] / (2000.0 * (1.4 - 1.4**-2))
    t = time[1:]
    subject = material(model, values, density=1000.0)
    text = card("abaqus").text(subject)
    assert "MODULI=INSTANTANEOUS" in text
    rows = [numbers(line) for line in text.split("TIME=PRONY\n")[1].splitlines()]
    np.testing.assert_allclose(1 - sum(g * (1 - np.exp(-t / tau)) for g, k, tau in rows), share, rtol=1e-6)
    v = {tag: float(x) for tag, x in re.findall(r"<(\w+)>([^<]+)</", card("febio").text(subject))}
    np.testing.assert_allclose(v["g0"] + sum(v[f"g{i}"] * np.exp(-t / v[f"t{i}"]) for i in (1, 2)), share, rtol=1e-6)
    flat = numbers(re.search(r"TB,PRONY.*\nTBDATA,1,(.*)", card("ansys").text(subject))[1])
    alphas = list(zip(flat[::2], flat[1::2]))
    np.testing.assert_allclose(1 - sum(a * (1 - np.exp(-t / tau)) for a, tau in alphas), share, rtol=1e-6)
    for solver in ("ls-dyna", "calculix", "sofa"):
        with pytest.raises(InputError, match="no card for relaxation"):
            card(solver).text(subject)


def test_laws_and_effects_without_a_card_are_refused():
    model = tj.material("neo-hookean", effects=["softening"])
    amplitude = next(p for p in model.parameters if p.split(".")[-1] in model.effects[0].amplitudes)
    with pytest.raises(InputError, match="softening"):
        material(model, model.defaults | {amplitude: 0.1})
    rig = tj.material("neo-hookean", effects=["slack"])
    gap = next(p for p in rig.parameters if p.split(".")[-1] in rig.effects[0].amplitudes)
    assert "slack belongs to the rig" in " ".join(material(rig, rig.defaults | {gap: 0.02}).notes)
    relaxing = tj.material("neo-hookean", effects=["viscoelasticity"])
    with pytest.raises(InputError, match="moduli"):
        material(
            relaxing, relaxing.defaults | {"effects.viscoelasticity.g1": 0.2, "effects.viscoelasticity.moduli": 1.0}
        )


def test_fibres_in_the_card_of_abaqus_are_ours():
    p = {"mu": 2000.0, "k1": 900.0, "k2": 3.0, "kappa": 0.12, "spread": 0.5, "angle": 0.0}
    energy = catalogue.energy("goh")
    text = card("abaqus").text(
        material(
            Model(energy, catalogue.volumetric("quadratic")),
            {f"energy.{n}": v for n, v in p.items()} | {"volumetric.K": K},
        )
    )
    C10, _, k1, k2, kappa = numbers(text.splitlines()[-1])
    directions = [numbers(d) for d in re.findall(r"^\*\*   (.*)$", text, re.M)]

    def W(a, b, c):  # Abaqus guide, Holzapfel-Gasser-Ogden form; these stretches keep the fibres in tension
        I1, _, J = invariants(a, b, c)
        E = [
            kappa * (I1 - 3) + (1 - 3 * kappa) * (J ** (-2 / 3) * ((a * x) ** 2 + (b * y) ** 2) - 1)
            for x, y, _ in directions
        ]
        return C10 * (I1 - 3) + k1 / (2 * k2) * sum(np.exp(k2 * e**2) - 1 for e in E)

    l = np.array([[1.3, 1.05, 0.8], [1.2, 0.95, 0.9]])
    P = np.asarray(stress.pk1(energy, None, p, None, jnp.asarray(l)[:, :, None] * jnp.eye(3)))
    own = np.diagonal(P, axis1=1, axis2=2) * l
    theirs = slope(W, l) * l
    np.testing.assert_allclose(theirs - theirs[:, 2:], own - own[:, 2:], rtol=1e-9)


@pytest.mark.skipif(shutil.which("ccx") is None, reason="no CalculiX here (ccx, Debian package calculix-ccx)")
@pytest.mark.parametrize("name", sorted(set(LAWS) - NOT["calculix"] - OWN_VOLUME))
def test_calculix_pulls_one_element_to_our_stress(name, tmp_path):
    stretch = 1.25
    nodes = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    deck = ["*NODE, NSET=ALL", *(f"{i}, {x}., {y}., {z}." for i, (x, y, z) in enumerate(nodes, 1))]
    deck += ["*ELEMENT, TYPE=C3D8, ELSET=CUBE", "1, 1, 2, 4, 3, 5, 6, 8, 7"]
    faces = {(k, v): [i for i, p in enumerate(nodes, 1) if p[k] == v] for k in range(3) for v in (0, 1)}
    deck += ["*NSET, NSET=PULLED", ", ".join(map(str, faces[0, 1]))]
    deck += [
        written(name, "calculix", "quadratic").rstrip(),
        "*SOLID SECTION, ELSET=CUBE, MATERIAL=tissue",
        "*BOUNDARY",
    ]
    deck += [f"{i}, {k + 1}, {k + 1}" for k in range(3) for i in faces[k, 0]]
    deck += ["*STEP, NLGEOM, INC=200", "*STATIC", "0.2, 1.", "*BOUNDARY"]
    deck += [f"{i}, 1, 1, {stretch - 1}" for i in faces[0, 1]]
    deck += ["*NODE PRINT, NSET=PULLED, TOTALS=ONLY", "RF", "*END STEP"]
    (tmp_path / "cube.inp").write_text("\n".join(deck) + "\n")
    told = subprocess.run(["ccx", "cube"], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    result = (tmp_path / "cube.dat").read_text()
    assert "total force" in result, told.stdout[-2000:]
    force = float(result.strip().splitlines()[-1].split()[0])

    def lateral(l):
        return float(ours(name, "quadratic", np.array([[stretch, l, l]]))[0, 1])

    l = brentq(lateral, 0.8, 1.0, xtol=1e-10)
    assert force == pytest.approx(float(ours(name, "quadratic", np.array([[stretch, l, l]]))[0, 0]), rel=1e-4)


def test_a_card_with_constants_that_nobody_gave_is_refused(capsys, tmp_path):
    from tissuejax.cli import main

    typed = ["export", "--energy", "mooney-rivlin", "--to", "abaqus", "--out", str(tmp_path / "cards")]
    assert main(typed) == 2
    assert "missing energy.C10, energy.C01" in capsys.readouterr().err
    assert not (tmp_path / "cards").exists()
    assert main([*typed, "--set", "energy.C10=0.3 kPa", "--set", "energy.C01=100 Pa"]) == 0
    assert "300" in next((tmp_path / "cards").iterdir()).read_text()


def test_a_simulation_says_which_constants_nobody_gave(capsys, tmp_path):
    from tissuejax.cli import main

    typed = ["simulate", "--energy", "neo-hookean", "--mode", "uniaxial", "--path", "0:1 1:1.2"]
    assert main([*typed, "--out", str(tmp_path / "a")]) == 0
    assert "typical values: energy.mu = 1000 Pa" in capsys.readouterr().out
    assert main([*typed, "--set", "energy.mu=3 kPa", "--out", str(tmp_path / "b")]) == 0
    assert "typical" not in capsys.readouterr().out
