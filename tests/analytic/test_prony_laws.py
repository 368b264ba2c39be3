"""Whose Prony series is ours: against FEBio's recurrence by hand, and how far apart laws are that relax another stress.

docs/into-abaqus-febio.md states the numbers of the second half.
"""

import numpy as np
import pytest

import tissuejax as tj
from tests.specimens import ramp, recording, stresses

MU, G, TAU = 2000.0, (0.3, 0.2), (0.5, 4.0)


def test_ours_is_the_recurrence_of_febio():
    """Isochoric stress pulled back to the reference, relaxed there, pushed forward: FEBio's "uncoupled viscoelastic"
    (FEUncoupledViscoElasticMaterial, version 2), with tensors, in tension and in simple shear."""
    time = np.linspace(0, 9, 181)
    stretch, shear = (
        1 + ramp(time, (0, 0), (2, 0.5), (5, 0.5), (7, -0.2), (9, 0.1)),
        ramp(time, (0, 0), (3, 0.8), (9, 0)),
    )
    F = {"pull": np.zeros((len(time), 3, 3)), "shear": np.tile(np.eye(3), (len(time), 1, 1))}
    F["pull"][:, 0, 0] = stretch
    F["pull"][:, 1, 1] = F["pull"][:, 2, 2] = stretch**-0.5
    F["shear"][:, 0, 1] = shear
    expected = {}
    for name, path in F.items():
        H, before, P = [np.zeros((3, 3)) for _ in G], np.zeros((3, 3)), []
        for k, f in enumerate(path):
            b = f @ f.T
            cauchy = MU * (b - np.trace(b) / 3 * np.eye(3))
            inverse = np.linalg.inv(f)
            S = inverse @ cauchy @ inverse.T
            if k:
                x = [(time[k] - time[k - 1]) / tau for tau in TAU]
                H = [np.exp(-a) * h - np.expm1(-a) / a * (S - before) for h, a in zip(H, x, strict=True)]
            before = S
            cauchy = f @ ((1 - sum(G)) * S + sum(g * h for g, h in zip(G, H, strict=True))) @ f.T
            P.append((cauchy - cauchy[2, 2] * np.eye(3)) @ inverse.T)  # no stress on the face across 3
        expected[name] = np.array(P)
    model = tj.material("neo-hookean", effects=["viscoelasticity-2"])
    tests = {
        "pull": recording("pull", "uniaxial", time, stretch),
        "shear": recording("shear", "simple-shear", time, shear),
    }
    values = {f"effects.viscoelasticity.{k}{i}": v for k, vs in (("g", G), ("tau", TAU)) for i, v in enumerate(vs, 1)}
    found = stresses(tj.predictor(model, tj.Sample("s", tests)).predict(model.defaults | values | {"energy.mu": MU}))
    np.testing.assert_allclose(found["pull"], expected["pull"][:, 0, 0], atol=1e-9 * MU)
    np.testing.assert_allclose(found["shear"], expected["shear"][:, 0, 1], atol=1e-9 * MU)


def tension(top, duration, after, g=0.5, tau=1.0, n=4000):
    """Nominal stress of a neo-Hookean block (mu 1) pulled to `top` within `duration` and held for `after`, in which the
    isochoric second Piola-Kirchhoff, the Kirchhoff or the nominal stress relaxes."""
    time = np.concatenate([np.linspace(0, duration, n + 1), duration + np.linspace(0, after, n + 1)[1:]])
    l = 1 + (top - 1) * np.minimum(time / duration, 1)

    def relaxed(s):
        h, decay = np.zeros_like(s), np.exp(-np.diff(time) / tau)
        for k, d in enumerate(decay):  # midpoint rule
            h[k + 1] = d * h[k] + np.sqrt(d) * (s[k + 1] - s[k])
        return s - g * (s - h)

    apart = l**2 - 1 / l  # of the principal Kirchhoff stresses
    second = l * relaxed(2 / 3 * apart / l**2) + relaxed(apart * l / 3) / l**2
    return second, relaxed(apart) / l, relaxed(apart / l)


@pytest.mark.parametrize(
    ("top", "at_the_end", "later"),
    [(1.01, 0.0006, 0.0003), (1.1, 0.006, 0.003), (1.5, 0.029, 0.014), (0.7, -0.018, -0.009)],
)
def test_how_far_apart_the_laws_are(top, at_the_end, later):
    """A ramp within one relaxation time: at its end, and one relaxation time later."""
    second, kirchhoff, nominal = tension(top, 1.0, 1.0)
    for k, expected in ((4000, at_the_end), (-1, later)):
        assert kirchhoff[k] / second[k] - 1 == pytest.approx(expected, rel=0.1)
        assert abs(nominal[k] / second[k] - 1) < 0.005
    fast = tension(top, 1e-4, 1.0)
    np.testing.assert_allclose(fast[1][4000:], fast[0][4000:], rtol=2e-5)  # after a step all relax alike
    np.testing.assert_allclose(fast[2][4000:], fast[0][4000:], rtol=2e-5)
