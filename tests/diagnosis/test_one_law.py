"""What an isotropic law lacks is one function of the stretch along an axis and the second one, whatever the test."""

import numpy as np
import pytest

from tissuejax.diagnosis.judgement.blocks import blocks, series
from tissuejax.diagnosis.material import MaterialBench, strain_states
from tissuejax.energies.catalogue import energy
from tissuejax.energies.hgo import HolzapfelGasserOgden
from tissuejax.estimation.discrepancy import Series, discrepancy, loading_states
from tissuejax.recordings.recording import Channel, Recording, Sample

TIME = np.linspace(0.02, 1.0, 40)
ALONG = 1 + 0.4 * TIME
TESTS = {  # of each: what is driven, and the second stretch
    "uniaxial": (ALONG, ALONG**-0.5),
    "equibiaxial": (ALONG, ALONG),
    "planar": (ALONG, np.ones_like(ALONG)),
    "biaxial": (np.stack([ALONG, 1 + 0.2 * TIME], axis=1), None),
}


def nominal(own, second, c1, c2):
    """Mooney-Rivlin without change of volume, third face free: T = 2 (c1 + c2 s^2) (l^2 - 1 / (l s)^2), P = T / l."""
    return 2 * (c1 + c2 * second**2) * (own**2 - (own * second) ** -2) / own


def recorded(c1, c2):
    made = {}
    for kind, (drive, second) in TESTS.items():
        if kind == "biaxial":
            stress = np.stack([nominal(drive[:, i], drive[:, 1 - i], c1, c2) for i in (0, 1)], axis=1)
        else:
            stress = nominal(drive, second, c1, c2)
        inputs = {"time": TIME, "stretch": drive}
        made[kind] = Recording(kind, kind, inputs, {"nominal_stress": Channel(TIME, stress, "Pa", 1.0)}, {})
    return Sample("s", made)


def whole(base):
    sample = recorded(800.0, 200.0)
    bench = MaterialBench.of(sample, base, tuple(TESTS), (), dict.fromkeys(TESTS, 1.0), ["slack"])
    return bench, blocks(bench)


def law(bench, cut):
    """Covariance of the broad law's share of the stress between all blocks, and the strain of each."""
    states = strain_states(bench)
    of = discrepancy(series(bench, cut, states), cut.spread(bench.sigma))
    (factor,) = (f for name, f in of.laws if name == "law")
    return factor @ factor.T, np.concatenate([cut.mean(np.concatenate([s.strain for s in states]))], axis=0)


def test_where_the_strain_is_one_the_law_lacks_one_share_whatever_the_test():
    bench, cut = whole(energy("neo-hookean"))
    shared, strain = law(bench, cut)
    share = cut.mean(
        bench.y / np.concatenate([nominal(*np.exp(s.strain).T, 1000.0, 0.0) for s in strain_states(bench)])
    )
    moved = np.linalg.norm(strain, axis=1) > 0.02
    near = np.linalg.norm(strain[:, None] - strain[None], axis=-1) < 0.02
    near &= moved[:, None] & moved[None] & (cut.owner[:, None] != cut.owner[None])
    assert len({tuple(sorted(pair)) for pair in zip(*cut.owner[np.stack(np.nonzero(near))], strict=True)}) >= 3
    one, other = np.nonzero(near)
    # of the algebra: what Mooney-Rivlin has beyond neo-Hooke differs by no more than strains do
    assert share[one] == pytest.approx(share[other], abs=0.02)
    assert np.ptp(share) > 0.1
    assert np.all(shared[near] > 0.99)


def test_a_specimen_of_its_own_is_isotropic_too():
    """Both directions of one test share what is its own: at equal stretches they can't differ, as fibres make them."""
    t = np.linspace(0.0, 0.3, 30)
    both = np.stack([t, t], axis=1)
    pulled = [Series("equibiaxial", "extension", t, both, loading_states(t), 1.0) for _ in range(2)]
    other = [Series("again", "extension", t, both, loading_states(t), 1.0)]
    own = next(p for p in discrepancy([*pulled, *other], np.ones(90)).about(np.ones(90)) if p.name == "own law").factor
    np.testing.assert_allclose(own[:30], own[30:60], atol=1e-9)
    assert not np.any(own[:60] @ own[60:].T)


def test_a_law_with_fibres_has_one_for_each_axis():
    bench, cut = whole(HolzapfelGasserOgden())
    shared, _ = law(bench, cut)
    apart = cut.owner[:, None] != cut.owner[None]
    assert not np.any(shared[apart])
