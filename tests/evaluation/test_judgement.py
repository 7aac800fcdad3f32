"""Each thing that stands against an estimate gives its grade, its reason and what to do; else it is sound."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from auvid_cli.data.faults import ConsideredErrors, Fault, FaultKind, FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.evaluation.innovations import LARGEST_FAULT
from auvid_cli.evaluation.judgement import (
    FARTHEST,
    FARTHEST_MINIMUM,
    FARTHEST_SEGMENT,
    LARGEST_NIS,
    LARGEST_PORTMANTEAU,
    Grade,
    distances_to,
    judge,
    judge_one,
    whiteness,
)

N = 5000


def white(rng, scale=1.0, memory=0.0, n=N):
    """Innovations of three components, said to be of unit variance; each remembers a share of the one before."""
    noise = lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal((n, 3)), axis=0)
    values = scale * noise
    return Innovations(np.arange(float(n)), values, np.ones((n, 3)), (values**2).sum(axis=1), np.ones(3))


def fault(size, name="delay of the gyroscope", unit="s"):
    return FaultTest(Fault.parse(name), unit, size, 1e-3, "N_url", 2.5)


@pytest.fixture
def smoother(hand_made, rng):
    """A sound one; its attitude is from an AHRS, and coloured."""
    innovations = {"dvl": white(rng), "gyroscope": white(rng), "attitude": white(rng, 0.3, 0.95)}
    estimate = hand_made([0, 1], {"Y_url": [0.0, 3.0], "N_url": [0.0, -2.0]}, innovations=innovations)
    return replace(estimate, filter="smoother", faults=(fault(2e-3), fault(-3.4e-3, "bias of r")))


@pytest.fixture
def ckf(hand_made):
    return replace(hand_made([0, 1], {"Y_url": [0.0, 3.4], "N_url": [0.0, -2.0]}), filter="ckf")


def test_what_nothing_stands_against_is_sound(ckf, smoother):
    judgements = judge([ckf, smoother])
    assert list(judgements) == ["ckf", "smoother"]
    for judgement in judgements.values():
        assert judgement[:3] == (Grade.SOUND, "", "")
        assert str(judgement) == "sound"


def test_one_that_diverged_is_called_so_whoever_judges(ckf, smoother):
    ended = replace(ckf, status="diverged at t = 3.000 s: why")
    for reference in (None, smoother):
        assert str(judge_one(ended, reference)).startswith("diverged: at t = 3.000 s: why; narrow the prior")


def test_one_that_its_innovations_belie_is_inconsistent(ckf, smoother, rng):
    belied = replace(ckf, innovations={"dvl": white(rng, 3.0)})
    for reference in (None, smoother):
        judgement = judge_one(belied, reference)
        assert judgement.grade is Grade.INCONSISTENT
        assert judgement.reason.startswith("innovations of dvl are")


def test_without_a_smoother_nobody_judges(ckf):
    judgement = judge_one(ckf, None)
    assert judgement.grade is Grade.UNJUDGED
    assert "not judged" in judgement.reason
    assert "--filter smoother" in judgement.remedy


def test_a_smoother_that_did_not_end_well_judges_nobody(ckf, smoother):
    lost = replace(smoother, status="unconverged: out of passes")
    judgements = judge([lost, ckf])
    assert judgements["smoother"].grade is Grade.DIVERGED
    assert judgements["ckf"].grade is Grade.UNJUDGED
    assert judgements["ckf"].reason.endswith("unconverged: out of passes")


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_largest_fault_makes_all_doubtful_and_is_named_with_its_remedy(sign, ckf, smoother):
    late = fault(sign * 1.01e-3 * LARGEST_FAULT)
    for judgement in judge([ckf, replace(smoother, faults=(*smoother.faults, late))]).values():
        assert judgement.grade is Grade.DOUBTFUL
        assert f"delay of the gyroscope ({late.size:.3g} +- 0.001 s, 3.5 sigma)" in judgement.reason
        assert judgement.remedy.endswith(
            "if the fault remains, subtract it from the times of the gyroscope where they are recorded or "
            "imported, or state it (identification.delays.gyroscope)"
        )


def test_a_segment_that_disagrees_makes_all_doubtful(ckf, smoother):
    for sigmas, grade in ((0.99 * FARTHEST_SEGMENT, Grade.SOUND), (1.01 * FARTHEST_SEGMENT, Grade.DOUBTFUL)):
        own = fault(1e-3 * sigmas, "the segment from 50 s", "kg*m/rad")
        judgements = judge([ckf, replace(smoother, faults=(*smoother.faults, own))])
        assert {judgement.grade for judgement in judgements.values()} == {grade}
    assert judgements["ckf"].reason == "the segment from 50 s has another N_url (0.00404 +- 0.001 kg*m/rad, 4.0 sigma)"
    assert "one model does not hold for all" in judgements["ckf"].remedy


def test_a_segment_that_disagrees_is_told_beside_the_fault_that_it_looks_like(smoother):
    tests = fault(9e-3), fault(-8e-3, "the segment from 0 s", "kg*m/rad")
    reason = judge_one(replace(smoother, faults=tests), None).reason
    assert "delay of the gyroscope (0.009 +- 0.001 s, 9.0 sigma), and the segment from 0 s has another N_url" in reason


def test_another_minimum_that_is_far_off_makes_all_doubtful(smoother):
    for sigmas, grade in ((0.99 * FARTHEST_MINIMUM, Grade.SOUND), (1.01 * FARTHEST_MINIMUM, Grade.DOUBTFUL)):
        other = fault(1e-3 * sigmas, "another minimum (cost 1 higher)", "kg*m/rad")
        assert judge_one(replace(smoother, faults=(other,)), None).grade is grade


def test_a_fault_without_a_unit_is_told_without(smoother):
    scaled = replace(smoother, faults=(fault(0.02, "scale of the DVL", "1"),))
    assert "scale of the DVL (0.02 +- 0.001, 20.0 sigma)" in judge_one(scaled, None).reason


def test_fault_that_only_others_show_states_both_sizes():
    alone = FaultTest(Fault.parse("bias of r"), "rad/s", 0.002, 1e-3, "N_url", 2.5)
    assert str(alone) == "bias of r (0.115 +- 0.057 deg/s, 2.0 sigma)"
    assert str(alone._replace(significance=2.5)) == str(alone)
    assert str(alone._replace(significance=4.2)).endswith("2.0 sigma alone, 4.2 beside the others)")


def test_innovations_of_the_smoother_that_are_too_large_are_told_with_their_sensor(ckf, smoother, rng):
    large = replace(smoother, innovations=smoother.innovations | {"gyroscope": white(rng, 1.1)})
    for judgement in judge([ckf, large]).values():
        assert judgement.grade is Grade.DOUBTFUL
        assert judgement.reason.startswith("innovations of gyroscope are larger than expected")
        assert "more noise of gyroscope" in judgement.remedy


def test_innovations_are_judged_without_what_errors_within_tolerances_explain(ckf, smoother, rng):
    large = {sensor: white(rng, 4.0, 0.9) for sensor in ("dvl", "gyroscope")}
    explained = {sensor: white(rng).statistics() for sensor in large}
    misfit = replace(smoother, innovations=smoother.innovations | large)
    filtered = replace(ckf, innovations=large)
    for judgement in judge([filtered, misfit]).values():
        assert judgement.grade is Grade.INCONSISTENT
    for judgement in judge([filtered, replace(misfit, explained=explained)]).values():
        assert judgement.grade is Grade.SOUND
    # What is left counts as before.
    left = replace(misfit, explained=explained | {"dvl": white(rng, 1.0, 0.5).statistics()})
    assert judge([left])["smoother"].reason.startswith("innovations of dvl are correlated in time")


def test_a_filter_whose_innovations_are_larger_than_the_explained_ones_is_inconsistent(ckf, smoother, rng):
    # Ten measurements a second, so that every window has enough of them.
    of_smoother, larger, lost = (
        replace(innovations, time=0.1 * innovations.time)
        for innovations in (white(rng, 2.0), white(rng, 4.0), white(rng, 2.0))
    )
    late = lost.innovation * np.where(lost.time > lost.time[-1] - 20.0, 3.0, 1.0)[:, None]
    late_lost = replace(lost, innovation=late, nis=(late**2).sum(axis=1))
    explained = {"dvl": white(rng).statistics()}
    misfit = replace(smoother, innovations=smoother.innovations | {"dvl": of_smoother}, explained=explained)
    grades = [
        judge([replace(ckf, innovations={"dvl": each}), misfit])["ckf"].grade for each in (lost, larger, late_lost)
    ]
    assert grades == [Grade.SOUND, Grade.INCONSISTENT, Grade.INCONSISTENT]


def test_overstated_noise_is_no_doubt(smoother, rng):
    """Innovations that are smaller than stated and corrected too far have standard deviations that are too large."""
    small = replace(smoother, innovations=smoother.innovations | {"gyroscope": white(rng, 0.8, -0.3)})
    assert judge([small])["smoother"].grade is Grade.SOUND
    large = replace(smoother, innovations=smoother.innovations | {"gyroscope": white(rng, 1.1, -0.3)})
    assert judge([large])["smoother"].grade is Grade.DOUBTFUL


def test_innovations_that_last_are_told_with_their_sensor(ckf, smoother, rng):
    coloured = replace(smoother, innovations=smoother.innovations | {"dvl": white(rng, 0.9, 0.3)})
    for judgement in judge([ckf, coloured]).values():
        assert judgement.grade is Grade.DOUBTFUL
        assert judgement.reason.startswith("innovations of dvl are correlated in time")


@pytest.mark.parametrize(("source", "grade"), [("ahrs", Grade.SOUND), ("direct", Grade.DOUBTFUL)])
def test_small_autocorrelation_is_doubted_only_without_an_ahrs(source, grade, smoother, experiment_with, rng):
    innovations = {"dvl": white(rng, 1.0, 0.15), "gyroscope": white(rng)}
    experiment = experiment_with(f"sensors.attitude.source={source}")
    attitude = {"attitude": smoother.innovations["attitude"]} if source == "ahrs" else {}
    assert judge_one(replace(smoother, experiment=experiment, innovations=innovations | attitude), None).grade is grade


def test_an_attitude_is_judged_where_it_is_no_ahrs(smoother, experiment_with):
    direct = replace(smoother, experiment=experiment_with("sensors.attitude.source=direct"))
    assert judge_one(smoother, None).grade is Grade.SOUND
    judgement = judge_one(direct, None)
    assert judgement.grade is Grade.DOUBTFUL
    assert judgement.reason.startswith("innovations of attitude are correlated")


def test_one_far_from_the_smoother_is_doubtful_by_its_worst_coefficient(ckf, smoother):
    # By its own standard deviation of 0.25.
    for distance, grade in ((0.99 * FARTHEST, Grade.SOUND), (1.01 * FARTHEST, Grade.DOUBTFUL)):
        mean = ckf.mean.copy()
        mean[-1, 1] = -2.0 - 0.25 * distance
        judgements = judge([replace(ckf, mean=mean), smoother])
        assert judgements["ckf"].grade is grade
        assert judgements["smoother"].grade is Grade.SOUND
    assert judgements["ckf"].reason == "N_url is 2.3 standard deviations from the smoother's estimate"
    assert judgements["ckf"].remedy == "use the smoother's estimate"


def test_coefficients_that_one_of_both_holds_have_no_distance(hand_made, smoother):
    other = replace(hand_made([0, 1], {"Y_url": [0.0, 9.0], "X_u|u|": [0.0, 1.0]}), filter="ckf")
    assert distances_to(other, smoother) == {"Y_url": pytest.approx(24.0)}


@given(
    values=st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=4),
    deviations=st.lists(st.floats(1e-3, 1e3), min_size=2, max_size=2),
)
def test_a_distance_is_the_same_from_both_sides_and_none_to_itself(values, deviations):
    one, other = (_two_coefficients(values[k::2], deviations[k]) for k in range(2))
    assert distances_to(one, other) == distances_to(other, one)
    assert set(distances_to(one, one).values()) == {0.0}
    assert all(distance >= 0.0 for distance in distances_to(one, other).values())


class _two_coefficients:
    """As much of an estimate as has a distance."""

    state = ("Y_url", "N_url", "u")
    coefficient_rows = (0, 1)

    def __init__(self, values, deviation):
        self.mean = np.array([[*values, 1.0]])
        self.standard_deviation = np.full((1, 3), deviation)


def test_white_innovations_of_the_stated_variance_are_within_chance():
    found = [whiteness(white(np.random.default_rng(seed)).statistics()) for seed in range(20)]
    nis, portmanteau, correlation = np.transpose(found)
    assert np.abs(nis).max() < 3.0
    # Its own mean and deviation; the larger of three is told.
    assert abs(nis.mean()) < 0.7
    assert 0.6 < nis.std() < 1.4
    assert portmanteau.max() < 5.0
    # The standard deviation of an autocorrelation of n white samples is 1 / sqrt(n).
    assert correlation.max() < 5.0 / np.sqrt(N)


def test_larger_ones_are_told_by_nis_alone(rng):
    large = whiteness(white(rng, 1.1).statistics())
    # 15000 components with 21 % more of squares.
    assert large.nis == pytest.approx(0.21 * np.sqrt(15000 / 2), rel=0.15)
    assert large.nis > LARGEST_NIS
    assert large.portmanteau < LARGEST_PORTMANTEAU / 2


def test_coloured_ones_are_told_by_the_portmanteau_and_their_nis_counts_for_less(rng):
    coloured, noise = whiteness(white(rng, 1.1, 0.8).statistics()), whiteness(white(rng, 1.1).statistics())
    assert coloured.portmanteau > 10 * LARGEST_PORTMANTEAU
    assert coloured.correlation == pytest.approx(0.8, abs=0.03)
    # The squares of an AR(1) sequence remember 0.64 to the power of the lag.
    assert coloured.nis < 0.8 * noise.nis


def test_missing_components_do_not_count(rng):
    whole = white(rng)
    innovation, variance = whole.innovation.copy(), whole.variance.copy()
    hole = rng.random(innovation.shape) < 0.3
    innovation[hole] = variance[hole] = np.nan
    holed = replace(whole, innovation=innovation, variance=variance, nis=np.nansum(innovation**2, axis=1))
    assert abs(whiteness(holed.statistics()).nis) < 3.0
    assert whiteness(holed.statistics()).portmanteau < 5.0


def test_of_few_only_their_size_is_judged(rng):
    few = white(rng, 2.0, 0.9, n=150)
    assert whiteness(few.statistics()).portmanteau == 0.0
    assert whiteness(few.statistics()).nis > LARGEST_NIS


def test_of_none_nothing_is_said(rng):
    assert whiteness(white(rng, n=0).statistics()) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("times", "grade"), [(0.2, Grade.DOUBTFUL), (0.7, Grade.SOUND), (1.6, Grade.SOUND), (2.0, Grade.DOUBTFUL)]
)
def test_fins_far_stronger_or_weaker_than_the_vehicle_file_states_are_doubtful(times, grade, hand_made, rng):
    stated = hand_made([0, 1], {"N_uudr": [0.0, 1.0]}).experiment.vehicle.all_coefficients()["N_uudr"]
    estimate = hand_made([0, 1], {"N_uudr": [0.0, times * stated]}, innovations={"dvl": white(rng)})
    judgement = judge([replace(estimate, filter="smoother")])["smoother"]
    assert judgement.grade is grade
    if grade is Grade.DOUBTFUL:
        assert judgement.reason == f"N_uudr is {times:.2g} times the value of the vehicle file"
        assert "unit and scale" in judgement.remedy


def test_fins_twice_as_strong_are_doubtful_whatever_the_tolerance_of_their_scale(hand_made, rng):
    stated = hand_made([0, 1], {"N_uudr": [0.0, 1.0]}).experiment.vehicle.all_coefficients()["N_uudr"]
    estimate = hand_made([0, 1], {"N_uudr": [0.0, 2.0 * stated]}, innovations={"dvl": white(rng)})
    scale = Fault(FaultKind.FIN_SCALE, "rudder")
    row = estimate.state.index("N_uudr")
    effect = np.zeros((row + 1, 1))
    effect[row] = 2.0 * stated
    considered = ConsideredErrors((scale,), ("1",), np.full((1, 1), 0.1**2), effect, np.ones(row + 1))
    judgement = judge([replace(estimate, filter="smoother", considered=considered)])["smoother"]
    assert judgement.grade is Grade.DOUBTFUL
    assert judgement.reason == "N_uudr is 2 times the value of the vehicle file"
