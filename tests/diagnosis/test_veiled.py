"""A weak effect of a probing that leaves less than one a sample: calm markers and a cautious sigma must not hide it."""

from dataclasses import replace
from types import SimpleNamespace

from tissuejax.diagnosis.decide import MIMICKED, SEEN_DEAR, SURE_DEAR, needed, too_little
from tissuejax.diagnosis.quality import CHANNEL, TOLERATED_HELD, VEILED, Quality, veiled


def searched(gain: float, numerical: float | None = None, dear: bool = True, keys: tuple[str, ...] = ()):
    numerics = {} if numerical is None else {frozenset(): SimpleNamespace(gain=numerical)}
    scores = [SimpleNamespace(gain=gain), SimpleNamespace(gain=0.0)]
    return SimpleNamespace(bench=SimpleNamespace(dear=dear, numerics=numerics), scored={frozenset(keys): scores})


def test_a_force_that_is_off_is_not_averaged_away_by_many_markers():
    calm = Quality(fitted=1.05, held=1.0, z_fitted=3.0, z_held=0.0, z_correlation=9.0, dear=True, channel=1.05)
    assert calm.noise
    assert not replace(calm, channel=CHANNEL + 0.1).noise
    assert not replace(calm, held=TOLERATED_HELD + 0.1).noise


def test_what_a_candidate_would_remove_tells_a_weak_effect_from_none():
    fit = SimpleNamespace(keys=(), n=10_000)
    assert veiled(searched(2 * VEILED * fit.n), fit)
    assert not veiled(searched(0.5 * VEILED * fit.n), fit)
    assert not veiled(searched(2 * VEILED * fit.n, numerical=1.5 * VEILED * fit.n), fit), "mesh and step would as well"
    assert not veiled(searched(2 * VEILED * fit.n, dear=False), fit), "material tests have no numerical error"
    assert not veiled(searched(2 * VEILED * fit.n, keys=("friction",)), fit), "not scored there yet"


def test_no_answer_about_a_probing_is_stated_as_certain():
    assert all(
        sure(noise, left) <= 0.95 for sure in SURE_DEAR.values() for noise in (True, False) for left in (0.0, 1.0)
    )
    assert SURE_DEAR["found"](False, 0.3) < SURE_DEAR["found"](False, 0.1) < SURE_DEAR["found"](True, 0.1)


def fits_of(gained: float, n: int = 10_000):
    """A search whose larger fit lowers the criterion by `gained`, half of it held out; what was missing is small."""

    def fit(keys, chi2):
        return SimpleNamespace(keys=keys, chi2=chi2, held=chi2, n=n, n_held=n, k=3, own={})

    small, large = fit((), 1.04 * n), fit(("softening",), 1.04 * n - gained / 2)
    bench = SimpleNamespace(dear=True, numerics={})
    search = SimpleNamespace(
        bench=bench, empty=small, scored={}, criterion=lambda r: 2 * r.chi2, outside=lambda r: r.chi2
    )
    return search, large, small


def test_an_effect_that_gains_less_than_laws_and_meshes_differ_by_is_not_needed():
    assert not needed(*fits_of(0.5 * SEEN_DEAR * 20_000))
    assert needed(*fits_of(1.5 * SEEN_DEAR * 20_000))


def test_what_mesh_and_step_would_take_up_as_well_is_no_second_effect():
    search, large, small = fits_of(6 * SEEN_DEAR * 20_000)
    gained = small.chi2 - large.chi2
    small.keys, large.keys = ("base-slip",), ("base-slip", "clock-lag")
    search.bench.numerics[frozenset(small.keys)] = SimpleNamespace(gain=0.9 * gained / MIMICKED)
    assert needed(search, large, small)
    search.bench.numerics[frozenset(small.keys)] = SimpleNamespace(gain=1.1 * gained / MIMICKED)
    assert not needed(search, large, small)


def test_a_set_that_leaves_half_of_a_weak_misfit_is_not_what_was_missing_though_noise_is_all_that_is_left():
    noise = Quality(fitted=1.1, held=1.05, z_fitted=5.0, z_held=2.0, z_correlation=9.0, dear=True, channel=1.1)
    chosen = SimpleNamespace(own={}, n=10_000, n_held=5_000)
    s = SimpleNamespace(bench=SimpleNamespace(dear=True, held_out=("r3",)))
    assert noise.noise
    assert too_little(s, chosen, noise, (2000.0, 500.0), (1100.0, 300.0))
    assert not too_little(s, chosen, noise, (2000.0, 500.0), (400.0, 100.0))
    s.bench.dear = False
    assert not too_little(s, chosen, noise, (2000.0, 500.0), (1100.0, 300.0)), "of material tests noise is known"
