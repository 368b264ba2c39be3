"""What happens at once: found where it was put in, no effect's business, and nothing where nothing happened."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import halfnorm
from test_judgement import made

from tissuejax.diagnosis.diagnose import asked_of, diagnose
from tissuejax.diagnosis.judgement.criteria import Criteria
from tissuejax.diagnosis.judgement.effort import Effort
from tissuejax.diagnosis.judgement.explore import Exploration
from tissuejax.diagnosis.judgement.kept import Kept
from tissuejax.diagnosis.judgement.marginal import Widths, amplitudes, marginal
from tissuejax.diagnosis.judgement.mass import amplitude_mass
from tissuejax.diagnosis.judgement.scales import Scales
from tissuejax.diagnosis.judgement.search import based
from tissuejax.diagnosis.judgement.sudden import disrupted, gains, held, known_moments
from tissuejax.estimation.discrepancy import Part
from tissuejax.estimation.sudden import Disturbed, Timed
from tissuejax.recordings.recording import Channel, Recording, Sample
from tissuejax.report.judged_sentences import lead, sure

MU, NOISE, STEP = 900.0, 4.0, 0.05
TRIED = ("drift", "energy-form", "viscoelasticity", "slack", "periodic")
QUICK = Effort(most=1, singles=5, reshaped=(1, 0, 0), starts=1)


def stepping(n: int, at: int) -> np.ndarray:
    return 1.0 * (np.arange(n) >= at)[:, None]


def test_the_gain_of_a_moment_is_the_integral_over_the_amplitude():
    linear, parts, blocked = made(n=40)
    v, n = np.full(len(parts), 1e-5), len(linear.residual)
    factors = [50.0 * stepping(n, at) for at in (5, 17, 60)]
    found = gains(blocked, parts, v, linear, factors, 0.1)
    a = np.linspace(0, 0.5, 4000)
    for factor, gain in zip(factors, found, strict=True):
        wide = (*parts, Part("step", "sudden", factor))
        values = [marginal(linear, wide, np.append(v, x**2), blocked).value for x in a[::20]]
        logs = np.interp(a, a[::20], values) - marginal(linear, parts, v, blocked).value
        exact = math.log(np.trapezoid(np.exp(logs) * halfnorm(scale=0.1).pdf(a), a))
        assert gain == pytest.approx(exact, abs=0.03)


def test_the_mass_of_a_part_that_is_nothing_or_a_thousand_times_as_wide_is_its_integral():
    linear, _, blocked = made(n=40)
    part = [Part("step", "sudden", 50.0 * stepping(len(linear.residual), 17))]
    priors = Widths(np.array([1e-4]), np.array([1e-3]), np.array([1e3]))
    v, m = amplitudes(linear, part, priors, blocked, np.array([0.01]))
    a = np.concatenate([np.linspace(0, 1e-3, 3000), np.linspace(1.01e-3, 0.6, 6000)])
    logs = np.array([marginal(linear, part, np.array([x**2]), blocked).value for x in a[::5]])
    logs = np.interp(a, a[::5], logs)
    density = 0.999 * halfnorm(scale=1e-4).pdf(a) + 1e-3 * halfnorm(scale=0.1).pdf(a)
    exact = math.log(np.trapezoid(np.exp(logs - m.value) * density, a))
    assert amplitude_mass(linear, part, priors, blocked, v, m) == pytest.approx(exact, abs=0.05)


def moment_of(time, owner, start, name, strain=None):
    names = tuple(f"r{k + 1}" for k in np.unique(owner))
    timed = Timed(time, owner, owner, names, np.zeros(len(time)) if strain is None else strain, start)
    return timed, next(m for m in timed.moments(every=1) if m.name == name)


def test_a_moment_adds_a_step_a_gain_and_a_late_clock():
    time, owner = np.tile(np.linspace(0, 10, 21), 2), np.repeat([0, 1], 21)
    timed, moment = moment_of(time, owner, np.zeros(42), "at once in r2 at 5 s")
    prediction = 3.0 * time
    step, within, gain, slip, late = moment.factor(Disturbed(prediction, timed)).T
    inside = (owner == 1) & (time >= 5)
    assert step == pytest.approx(30.0 * inside)
    assert within == pytest.approx(30.0 * ((owner == 1) & (time == 4.5)))  # the mean in which it happens
    assert gain == pytest.approx(prediction * inside)
    assert not np.any(slip)  # where the strain stands still
    assert late == pytest.approx(0.3 * 3.0 * 10 * inside)  # slope times the duration


def test_a_grip_that_lets_go_takes_the_slope_of_the_curve():
    time, owner = np.linspace(0, 10, 81), np.zeros(81, int)
    strain = 0.3 * np.sin(0.5 * time)
    timed, moment = moment_of(time, owner, np.zeros(81), "at once in r1 at 5 s", strain)
    slip = moment.factor(Disturbed(100 * strain + 400 * strain**3, timed))[:, 3]
    assert slip == pytest.approx(np.ptp(strain) * (100 + 1200 * strain**2) * (time >= 5), rel=1e-6)


def test_what_tears_stays_torn_in_recordings_that_begin_later():
    time, owner = np.tile(np.linspace(0, 10, 21), 3), np.repeat([0, 1, 2], 21)
    start, prediction = np.repeat([100.0, 50.0, 0.0], 21), 3.0 + time
    timed, moment = moment_of(time, owner, start, "at once in r2 at 5 s")
    lasting = moment.factor(Disturbed(prediction, timed))[:, -1]
    assert lasting == pytest.approx(prediction * (((owner == 1) & (time >= 5)) | (owner == 0)))


@pytest.mark.parametrize("lost", [0.5, 1.0, 4.0, -2.0])
def test_a_block_that_a_recorder_skipped_or_repeated_is_what_a_moment_may_do(lost):
    """Ramps and holds of which a part is missing: least squares leave little of it, and the slope alone most."""
    time, owner = np.linspace(0, 40, 101), np.zeros(101, int)
    timed, moment = moment_of(time, owner, np.zeros(101), "at once in r1 at 13.2 s")
    prediction = np.interp(time, [0, 2, 10, 20, 22, 30, 38, 40], [0, 0, 10, 10, 2, 2, 10, 10])
    change = np.where(time < 13.2, 0.0, np.interp(time + lost, time, prediction) - prediction)

    def left(m) -> float:
        f = m.factor(Disturbed(prediction, timed))
        return float(np.linalg.norm(change - f @ np.linalg.lstsq(f, change, rcond=None)[0]))

    jumping = moment.jumping(timed)
    assert sum(m.chance for m in jumping) == pytest.approx(moment.chance)
    best = min(jumping, key=left)
    assert 40 * best.jump == pytest.approx(lost, rel=0.3)
    assert left(best) < 0.12 * np.linalg.norm(change)
    if abs(lost) >= 1:
        assert left(moment) > 3 * left(best)


def test_every_time_is_scanned_first_or_lies_beside_one_that_is():
    time, owner = np.concatenate([np.linspace(0, 10, 203), np.linspace(0, 4, 30)]), np.repeat([0, 1], [203, 30])
    timed = Timed(time, owner, owner, ("r1", "r2"), time, np.zeros(233))
    first, every = timed.moments(), timed.moments(every=1)
    assert sum(m.chance for m in every) == pytest.approx(0.5)
    found = {m.name for f in first for m in (f, *timed.near(f))}
    assert found == {m.name for m in every}


@pytest.mark.parametrize(("v", "strange"), [((0.001, 0.0), False), ((0.001, 0.2), False), ((0.6, 0.0), True)])
def test_what_happened_at_once_calls_for_no_other_form(v, strange):
    """A rest that lasts may be a law in another form than those tried; a step at a time that is known may not."""
    evidence = SimpleNamespace(keys=(), void=False, log_evidence=-math.inf)
    criteria, weighed = Criteria(), SimpleNamespace(evidence=evidence, v=np.square(v))
    scales = Scales(SimpleNamespace(candidates={}), None, ("law", "sudden"), None, None, {}, np.zeros(1), 1.0)
    scales.moments = (0.01,)
    assert scales.lasting.tolist() == [True, False]
    e = Exploration(SimpleNamespace(), criteria, Effort(), scales, weighed={frozenset(): weighed})
    assert e.strange == strange


def recorded(disturbed) -> Sample:
    """Pulls and pushes with holds of a neo-Hookean specimen in closed form, `disturbed` in stretch and stress."""
    rng, recordings, start = np.random.default_rng(5), {}, 0.0
    for name, far, ramp in (("slow", 1.3, 6.0), ("quick", 1.25, 2.0), ("push", 0.8, 3.0), ("last", 1.2, 2.5)):
        time = np.arange(0, 3 * ramp + 12, STEP)
        stretch = np.interp(time, [0, 1, 1 + ramp, 9 + ramp, 9 + 2 * ramp], [1, 1, far, far, 1])
        y = disturbed(name, time, stretch, lambda x: MU * (x - x**-2))
        channel = Channel(time, y + NOISE * rng.standard_normal(len(time)), "Pa", NOISE)
        known = {"area": 1e-4, "height": 0.01, "start": start}
        start += 60.0
        recordings[name] = Recording(
            name, "uniaxial", {"time": time, "stretch": stretch}, {"nominal_stress": channel}, known
        )
    return Sample("at once", recordings)


def slipping(name, time, stretch, law):
    """The grip lets go by 0.04 in the hold of one recording, and by 0.03 in that of another."""
    gone = {"slow": (10.0, 0.04), "last": (7.0, 0.03)}.get(name, (1e9, 0.0))
    return law(stretch - gone[1] * (time >= gone[0]))


def tearing(name, time, stretch, law):
    """A third of the specimen tears in the hold of the first recording and bears nothing from then on."""
    return law(stretch) * np.where((time >= 10.0) | (name != "slow"), 2 / 3, 1.0)


def skipping(name, time, stretch, law):
    """Every recording loses 1.2 s somewhere; what follows is shown too early and its end lasts."""
    at = {"slow": 5.0, "quick": 2.2, "push": 9.0, "last": 6.5}[name]
    return law(np.where(time < at, stretch, np.interp(time + 1.2, time, stretch)))


def relaxing(name, time, stretch, law):
    """A share of 0.3 of the stress relaxes with 2 s: a sum over the steps of the elastic stress."""
    elastic = law(stretch)
    decay, carried, out = np.exp(-STEP / 2.0), 0.0, np.zeros(len(time))
    for i in range(1, len(time)):
        carried = decay * carried + (elastic[i] - elastic[i - 1])
        out[i] = 0.7 * elastic[i] + 0.3 * carried
    return out


def test_a_tear_is_found_though_a_gain_that_wanes_had_taken_it_up():
    asked = asked_of(recorded(tearing), "neo-hookean")
    cut, of = asked.left()
    criteria = asked.question.criteria
    scales, base = based(asked.whole, cut, of, criteria, Kept())
    assert base.evidence.amplitudes["waning gain"] > 0.1
    scales, disturbed = disrupted(scales, base, criteria)
    (moment,) = [m for m in scales.discrepancy.sudden if held(disturbed, m)]
    assert (moment.recording, moment.time) == (0, pytest.approx(10.0, abs=0.4))
    assert disturbed.evidence.amplitudes["waning gain"] < 0.01
    assert disturbed.evidence.log_evidence > base.evidence.log_evidence + 50
    again = known_moments(scales.discrepancy)[moment.name]
    assert (again.jump, again.chance) == (moment.jump, moment.chance)
    assert np.array_equal(again.rows, moment.rows)


def asked(disturbed):
    return diagnose(recorded(disturbed), "neo-hookean", effects=TRIED, effort=QUICK)


@pytest.mark.slow
def test_a_grip_that_slips_is_no_relaxation_and_the_page_says_when():
    answer = asked(slipping)
    assert answer.verdict.kind == "unexplained"
    parts = answer.as_dict()["rest"]["parts"]
    when = {k.split()[3]: float(k.split()[-2]) for k, v in parts.items() if k.startswith("at once") and v > 1e-3}
    assert when["slow"] == pytest.approx(10.0, abs=0.8)
    assert when["last"] == pytest.approx(7.0, abs=0.8)
    assert any("at once in slow" in sentence for sentence in sure(answer))
    moments = answer.as_dict()["rest"]["at_once"]
    assert {m["recording"] for m in moments} >= {"slow", "last"}
    assert lead(answer).startswith(
        f"Something happened at once that no effect of the catalogue explains, in {moments[0]['recording']} at "
    )


@pytest.mark.slow
@pytest.mark.parametrize("disturbed", [tearing, skipping])
def test_a_tear_and_a_recorder_that_skips_are_called_by_no_name(disturbed):
    answer = asked(disturbed)
    assert answer.verdict.kind == "unexplained"
    assert answer.verdict.confidence > 0.5


@pytest.mark.slow
def test_what_relaxes_is_not_taken_for_something_that_happened_at_once():
    answer = asked(relaxing)
    assert [e["name"] for e in answer.as_dict()["effects"]] == ["viscoelasticity"]
    assert answer.verdict.kind == "found"
    parts = answer.as_dict()["rest"]["parts"]
    assert not [k for k, v in parts.items() if k.startswith("at once") and v > 1e-3]
