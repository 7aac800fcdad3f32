"""Score tests of faults in simulated data: found with their size, and removed by the advice."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.config.enums import FilterName
from auvid_cli.config.vehicle import VehicleEntry
from auvid_cli.data.faults import FaultKind
from auvid_cli.evaluation.innovations import LARGEST_FAULT
from auvid_cli.evaluation.judgement import FARTHEST_SEGMENT, judge
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import FAULTS, FaultedVehicle
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.equations import factors

BY_NAME = {str(fault.fault): fault for fault in FAULTS}
DEGREE = np.pi / 180.0


@pytest.fixture(scope="module")
def clean(simulated_with):
    """With all turns that a fault may show in, and white noise only."""
    slow = "sensors.attitude={source: direct, rate: 25 Hz}", "sensors.gyroscope.rate=25 Hz"
    return simulated_with("manoeuvre.duration=60 s", *slow)


def biased(data):
    gyroscope = data.sensors["gyroscope"]
    values = gyroscope.values + np.array([0.0, 0.0, 0.05 * DEGREE])
    return replace(data, sensors=data.sensors | {"gyroscope": replace(gyroscope, values=values)})


def late(data):
    gyroscope = data.sensors["gyroscope"]
    inside = gyroscope.time < data.inputs.time[-1] - 0.1
    changed = replace(gyroscope, time=gyroscope.time[inside] + 0.002, values=gyroscope.values[inside])
    return replace(data, sensors=data.sensors | {"gyroscope": changed})


def early_inputs(data):
    """Return data whose recorded inputs act 20 ms later."""
    values = np.array([np.interp(data.inputs.time + 0.02, data.inputs.time, column) for column in data.inputs.values.T])
    return replace(data, inputs=replace(data.inputs, values=values.T.copy()))


def trimmed(data):
    values = data.inputs.values - np.array([0.3 * DEGREE, 0.0, 0.0, 0.0])
    return replace(data, inputs=replace(data.inputs, values=values))


def stated(data, symbol, by):
    """Return data whose vehicle file understates a parameter by `by`."""
    vehicle = data.experiment.vehicle
    entry = VehicleEntry(value=vehicle.known_parameters()[symbol] - by)
    wrong = vehicle.model_copy(update={"parameters": vehicle.parameters.model_copy(update={symbol: entry})})
    return replace(data, experiment=data.experiment.model_copy(update={"vehicle": wrong}))


def buoyant(data):
    return stated(data, "B", 0.1)


def bow_heavy(data):
    return stated(data, "xG", 1e-4)


def results_of(dataset):
    estimate = identify(dataset, FilterName.SMOOTHER)
    assert estimate.status == "completed"
    return {str(fault.fault): fault for fault in estimate.faults}


@pytest.fixture(scope="module")
def faults_of(clean):
    """Return a function: findings in the clean data with a planted fault; made once."""
    return cache(lambda plant: results_of(plant(clean)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "name", "size"),
    [
        (biased, "bias of r", 0.05 * DEGREE),
        (late, "delay of the gyroscope", 0.002),
        (early_inputs, "delay of the inputs", 0.02),
        (trimmed, "trim of the rudder", 0.3 * DEGREE),
        (buoyant, "buoyancy", 0.1),
        (bow_heavy, "xG", 1e-4),
    ],
)
def test_a_fault_in_the_data_is_found_with_its_size_and_named_as_the_worst(plant, name, size, faults_of):
    found = faults_of(plant)
    worst = max(found.values(), key=lambda fault: abs(fault.z))
    assert (str(worst.fault), abs(worst.z) > LARGEST_FAULT) == (name, True), worst
    assert abs(worst.size - size) < 4.0 * worst.standard_deviation + 0.1 * size


def earlier(data, size):
    gyroscope = data.sensors["gyroscope"]
    return replace(data, sensors=data.sensors | {"gyroscope": replace(gyroscope, time=gyroscope.time - size)})


def later_inputs(data, size):
    time = data.inputs.time
    values = np.array([np.interp(time - size, time, column) for column in data.inputs.values.T])
    return replace(data, inputs=replace(data.inputs, values=values.T.copy()))


def turned(data, size):
    return replace(data, inputs=replace(data.inputs, values=data.inputs.values + np.array([size, 0.0, 0.0, 0.0])))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "name", "obey"),
    [
        (late, "delay of the gyroscope", earlier),
        (early_inputs, "delay of the inputs", later_inputs),
        (trimmed, "trim of the rudder", turned),
    ],
)
def test_advice_of_a_fault_removes_most_of_it(plant, name, obey, clean, faults_of):
    said = {
        "delay of the gyroscope": "subtract it from the times",
        "delay of the inputs": "add it to the times",
        "trim of the rudder": "add it to the recorded angle",
    }
    assert BY_NAME[name].fault.remedy.startswith(said[name])
    fault = faults_of(plant)[name]
    # Large faults are found to some percent only, because the test is linear.
    assert abs(results_of(obey(plant(clean), fault.size))[name].z) < 0.1 * abs(fault.z)


@pytest.mark.slow
def test_clean_data_have_no_fault(clean):
    found = results_of(clean)
    labels = VehicleFaults(augmented_problem(prepare(clean))).labels
    # Coefficients compensate a scale of a fin completely, so that no data show it.
    hidden = {str(model.fault) for model in labels} - {*found}
    assert {"scale of the rudder", "scale of the elevator"} <= hidden
    assert max(abs(fault.z) for fault in found.values()) < LARGEST_FAULT
    assert all(fault.unit == BY_NAME[name].unit for name, fault in found.items())
    assert all(fault.susceptibility >= 0.0 for fault in found.values())


@pytest.mark.slow
def test_autocorrelated_errors_of_an_ahrs_are_no_fault_and_hide_none(simulated_with):
    """On a zigzag white tests find a lever arm of the DVL by 6 of their standard deviations."""
    slow = "sensors.attitude.rate=25 Hz", "sensors.gyroscope.rate=25 Hz"
    honest = simulated_with("manoeuvre=manoeuvres/zigzag_20_20.yaml", "manoeuvre.speed=3.9 m/s", "seed=202", *slow)
    sound, doubtful = (identify(data.without_truth(), FilterName.SMOOTHER) for data in (honest, biased(honest)))
    assert judge([sound])["smoother"].grade == "sound"
    assert max(test.excess for test in sound.faults) < LARGEST_FAULT
    (worst,) = (test for test in doubtful.faults if test.rank == 1)
    assert str(worst.fault) == "bias of r"
    assert worst.excess > 5.0 * LARGEST_FAULT
    assert abs(worst.size - 0.05 * DEGREE) < 4.0 * worst.standard_deviation


def changing(data):
    """Another rudder trim in the second half, as after a blow."""
    values = data.inputs.values.copy()
    values[data.inputs.time > 30.0, 0] += 0.05 * DEGREE
    return replace(data, inputs=replace(data.inputs, values=values))


@pytest.mark.slow
def test_segments_of_one_model_agree_and_others_do_not(clean, with_settings):
    halves = with_settings(clean, "identification.use.spans=[[0, 30], [30, 60]]")
    for dataset, disagree in (halves, False), (changing(halves), True):
        found = [test for test in results_of(dataset).values() if test.fault.kind is FaultKind.SEGMENT]
        assert [test.fault.component for test in found] == ["0", "30"]
        assert [abs(test.z) > FARTHEST_SEGMENT for test in found] == [disagree] * 2
        assert all(test.unit == COEFFICIENTS.units[test.coefficient] for test in found)


@pytest.mark.slow
def test_a_trim_that_drifts_by_less_than_a_tenth_of_a_degree_is_named(multisine_with):
    """The rudder's zero moves by .08 deg in 40 s, of which nothing is known but the constant."""
    dataset, rate = multisine_with("identification.estimate={biases: [fin_trim], fin_trim: {fins: [rudder]}}"), 2e-3
    values = dataset.inputs.values.copy()
    values[:, 0] -= rate * DEGREE * dataset.inputs.time
    moved = replace(dataset.without_truth(), inputs=replace(dataset.inputs, values=values))
    steady, drifting = (identify(data, FilterName.SMOOTHER) for data in (dataset, moved))
    tests = [{str(test.fault): test for test in estimate.faults} for estimate in (steady, drifting)]
    before, found = (of["drift of the trim of the rudder"] for of in tests)
    assert abs(before.z) < 3.5 < found.z
    assert abs(found.size - rate * DEGREE) < 3.0 * found.standard_deviation
    assert max(tests[1].values(), key=lambda test: abs(test.z)) == found
    assert "fin_trim.walk" in judge([drifting])["smoother"].remedy


def of_growing_ballast(dataset, per_second):
    """The same run with a ballast that grows: what that does to the motion is added to what was measured."""
    truth, known = dataset.truth, dataset.experiment.vehicle.known_parameters()
    model = FaultedVehicle(known, factors(truth.coefficients))
    held = np.searchsorted(dataset.inputs.time, truth.time + 1e-9, side="right") - 1
    motions = [[truth.motion[0]], [truth.motion[0]]]
    for k, (begin, step) in enumerate(zip(truth.time[:-1], np.diff(truth.time), strict=True)):
        given = dataset.inputs.values[held[k] : held[k] + 1]
        for motion, growth in zip(motions, (np.zeros(2), np.array(per_second)), strict=True):

            def rates(state, time, growth=growth, given=given):
                return model.rates(state[None], given, (growth * time)[None])[0]

            first = rates(motion[-1], begin)
            second = rates(motion[-1] + 0.5 * step * first, begin + 0.5 * step)
            third = rates(motion[-1] + 0.5 * step * second, begin + 0.5 * step)
            fourth = rates(motion[-1] + step * third, begin + step)
            motion.append(motion[-1] + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth))
    steady, grown = map(np.array, motions)
    assert_allclose(steady, truth.motion, atol=1e-4)
    sensors = {}
    for name, rows in (("gyroscope", slice(3, 6)), ("dvl", slice(0, 3)), ("attitude", slice(6, 9))):
        record = dataset.sensors[name]
        more = [np.interp(record.time, truth.time, column) for column in (grown - steady)[:, rows].T]
        sensors[name] = replace(record, values=record.values + np.stack(more, axis=1))
    return replace(dataset.without_truth(), sensors=sensors)


def of_slipping_thrust(dataset, per_second):
    """The same run with a record of the thrust that falls behind what acts."""
    values = dataset.inputs.values.copy()
    values[:, 2] /= 1.0 + per_second * dataset.inputs.time
    return replace(dataset.without_truth(), inputs=replace(dataset.inputs, values=values))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bias", "name", "changed", "rate"),
    [
        ("thrust", "scale of the thrust", of_slipping_thrust, 5e-5),
        ("ballast", "excess buoyancy", lambda data, rate: of_growing_ballast(data, (rate, 0.0)), 3e-3),
        ("ballast", "moment of trim", lambda data, rate: of_growing_ballast(data, (0.0, rate)), 3e-3),
    ],
)
def test_thrust_and_ballast_that_drift_and_are_estimated_as_constants_are_named(
    bias, name, changed, rate, multisine_with
):
    """By two thousandths of the thrust, a tenth of a newton or of a newton metre in 40 s."""
    dataset = multisine_with(f"identification.estimate.biases=[{bias}]", "manoeuvre.duration=30 s")
    steady, drifting = (identify(data, FilterName.SMOOTHER) for data in (dataset, changed(dataset, rate)))
    before, found = (
        {str(test.fault): test for test in estimate.faults}[f"drift of the {name}"] for estimate in (steady, drifting)
    )
    assert abs(before.z) < LARGEST_FAULT < found.z
    assert abs(found.size - rate) < 3.0 * found.standard_deviation
    # At one speed buoyancy and trim moment are confounded.
    assert f"(identification.estimate.{bias}." in judge([drifting])["smoother"].remedy


@pytest.mark.slow
def test_an_autopilot_that_steers_by_more_than_is_logged_is_named(simulated_with):
    """Depth and heading are held under disturbances; the log has neither gyroscope nor the true pitch."""
    pushes = "{moment: {standard_deviation: [0.005 N*m, 0.1 N*m, 0.1 N*m], time_constant: 3 s}}"
    dataset = simulated_with(
        "manoeuvre={type: lawnmower, duration: 80 s, speed: 1.5 m/s, leg: 25 s, turn_rate: 6 deg/s, "
        f"autopilot: {{speed: false}}, input_rate: 10 Hz, disturbance: {pushes}}}",
        "sensors={attitude: {source: direct, rate: 10 Hz, noise: 0.15 deg}, dvl: {rate: 5 Hz, noise: 1 cm/s}}",
        "identification.coefficients=[M_uude, M_uwl, M_uql, N_uudr]",
        f"identification.estimate={{biases: [disturbance], disturbance: {pushes}}}",
        "identification.process_noise={velocity: 1e-5, rate: 1e-5, attitude: 1e-6}",
        "identification.integration_step=0.05 s",
    )
    estimate = identify(dataset.without_truth(), FilterName.SMOOTHER)
    worst = max(estimate.faults, key=lambda test: abs(test.z))
    assert str(worst.fault) == "elevator reacting to disturbances"
    assert worst.z > LARGEST_FAULT
