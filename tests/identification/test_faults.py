"""Effects of fault models on motion and measurements, and the names of faults."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from auvid_cli.data.faults import Fault, FaultKind
from auvid_cli.filters.smoother_forward import Linearised
from auvid_cli.identification.fault_effects import VehicleFaults
from auvid_cli.identification.faults import DELAY_FAULTS, FAULTS, FaultedVehicle, Motion, held_coefficient
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.process import vehicle_process
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.equations import factors, vehicle_constants
from auvid_cli.vehicle.parameters import INERTIAL, ActuatorErrors
from auvid_cli.vehicle.rigid_body import GRAVITY, dvl_axes, mass_matrix, rotation_matrix

BY_NAME = {str(fault.fault): fault for fault in FAULTS}
N = 20


def names_of(faults):
    return tuple(str(model.fault) for model in faults.labels)


@pytest.fixture(scope="module")
def known(experiment_with):
    return experiment_with().vehicle.known_parameters()


@pytest.fixture(scope="module")
def model(known, experiment_with):
    return FaultedVehicle(known, factors(experiment_with().vehicle.all_coefficients()))


@pytest.fixture
def at(model, rng):
    """Some motions, as different as a vehicle makes."""
    motion = 0.2 * rng.standard_normal((N, 9)) + [2.0, *np.zeros(8)]
    inputs = 0.1 * rng.standard_normal((N, 4)) + [0.0, 0.0, 30.0, 0.0]
    current = np.tile([0.3, -0.2], (N, 1))
    ballast = rng.standard_normal((N, 2))
    rates = model.rates(motion, inputs, ballast)
    return Motion(motion, inputs, *rng.standard_normal((2, N, 4)), rates, current, ballast, 3.0 * np.arange(N))


def over_ground(motion):
    """Return the velocities that a DVL measures in that current."""
    return motion[:, :3] + [rotation_matrix(attitude).T @ [0.3, -0.2, 0.0] for attitude in motion[:, 6:9]]


def effect(name, model, at):
    return BY_NAME[name].effect(model, at)


def by_step(function, step):
    """Its derivative at 0."""
    return (function(step) - function(-step)) / (2.0 * step)


@pytest.mark.parametrize(("name", "measured"), [("gyroscope", lambda motion: motion[:, 3:6]), ("DVL", over_ground)])
def test_late_sensor_measures_the_past(name, measured, model, at):
    expected = by_step(lambda delay: measured(at.motion - delay * at.rates), 1e-4)
    assert_allclose(effect(f"delay of the {name}", model, at), expected, atol=1e-8)


@pytest.mark.parametrize(("sensor", "rows"), [("attitude", slice(6, 9)), ("magnetometer", slice(8, 9))])
def test_late_angle_is_that_of_the_past(sensor, rows, model, at):
    expected = by_step(lambda delay: (at.motion - delay * at.rates)[:, rows], 1e-4)
    assert_allclose(DELAY_FAULTS[f"delay_{sensor}"].effect(model, at), expected, atol=1e-8)


def test_a_late_depth_is_less_by_what_the_vehicle_has_sunk(model, at):
    down = [(rotation_matrix(motion[6:9]) @ motion[:3])[2] for motion in at.motion]
    assert_allclose(DELAY_FAULTS["delay_depth"].effect(model, at), -np.array(down)[:, None], atol=1e-12)


def moved_on(model, at, duration):
    """Where a vehicle is later, in some steps of Runge and Kutta, while its inputs go on to change."""
    motion, steps = at.motion.copy(), 4
    step, begin = duration / steps, 0.0

    def rates(state, time):
        return model.rates(state, at.inputs + time * at.input_rate, at.ballast)

    for _ in range(steps):
        first = rates(motion, begin)
        second = rates(motion + 0.5 * step * first, begin + 0.5 * step)
        third = rates(motion + 0.5 * step * second, begin + 0.5 * step)
        fourth = rates(motion + step * third, begin + step)
        motion, begin = motion + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth), begin + step
    return motion


def test_late_accelerometer_measures_the_past(known, at, experiment_with):
    """The specific force along a trajectory is the acceleration in earth axes minus gravity, in body axes."""
    arm, step = np.array([0.4, -0.2, 0.1]), 2e-3
    model = FaultedVehicle(known, factors(experiment_with().vehicle.all_coefficients()), arm=arm)
    motions = [moved_on(model, at, k * step) for k in (-2, -1, 0, 1, 2)]
    turns = [np.array([rotation_matrix(attitude) for attitude in motion[:, 6:9]]) for motion in motions]
    before, _, now, _, after = (
        np.einsum("nij,nj->ni", turn, motion[:, :3] + np.cross(motion[:, 3:6], arm))
        for turn, motion in zip(turns, motions, strict=True)
    )
    gravity = [0.0, 0.0, GRAVITY]
    felt = [
        np.einsum("nji,nj->ni", turns[k], (end - begin) / (2.0 * step) - gravity)
        for k, begin, end in ((1, before, now), (3, now, after))
    ]
    assert_allclose(model.specific_force(*at[:2], at.ballast), np.mean(felt, axis=0), atol=1e-3)
    expected = (felt[0] - felt[1]) / (2.0 * step)
    assert_allclose(DELAY_FAULTS["delay_accelerometer"].effect(model, at), expected, atol=1e-3 * np.abs(expected).max())


def test_late_magnetic_field_is_that_of_the_past(known, at, experiment_with):
    """By scipy's turns, in a rigid body that turns on as it does."""
    earth, step = np.array([2e-5, 1e-6, 4e-5]), 1e-4
    model = FaultedVehicle(known, factors(experiment_with().vehicle.all_coefficients()), earth_field=earth)
    attitude = Rotation.from_euler("ZYX", at.motion[:, [8, 7, 6]])
    early, late = ((attitude * Rotation.from_rotvec(by * at.motion[:, 3:6])).inv().apply(earth) for by in (-step, step))
    assert_allclose(model.magnetic_field(at.motion), attitude.inv().apply(earth), atol=1e-18)
    assert_allclose(DELAY_FAULTS["delay_magnetic_field"].effect(model, at), (early - late) / (2.0 * step), atol=1e-12)


def test_late_inputs_are_those_of_the_past(model, at):
    moved = by_step(lambda delay: model.rates(at.motion, at.inputs - delay * at.input_rate, at.ballast), 1e-3)
    assert_allclose(effect("delay of the inputs", model, at), moved, atol=1e-8 * np.abs(moved).max())


def test_biases_are_added_to_one_axis_each(model, at):
    for axis, symbol in enumerate("pqr"):
        assert np.array_equal(effect(f"bias of {symbol}", model, at), np.tile(np.eye(3)[axis], (N, 1)))


def test_scale_and_mounting_are_those_of_the_block_that_estimates_them(model, at):
    velocity = over_ground(at.motion)
    for name, turned in (("scale", lambda e: dvl_axes(e, 0.0)), ("mounting yaw", lambda e: dvl_axes(0.0, e))):
        expected = by_step(lambda e, turned=turned: velocity @ turned(e).T, 1e-4)
        assert_allclose(effect(f"{name} of the DVL", model, at), expected, atol=1e-7)


def test_a_lever_arm_adds_what_the_rotation_moves(model, at):
    for axis, name in enumerate("xyz"):
        # The velocity of a point of a body: that of its origin and w x r.
        p, q, r = at.motion[:, 3:6].T
        zero = np.zeros(N)
        turning = np.array([[zero, -r, q], [r, zero, -p], [-q, p, zero]])
        assert_allclose(effect(f"lever arm of the DVL, {name}", model, at), turning[:, axis].T, atol=1e-15)


def test_a_current_is_seen_over_ground(model, at):
    for axis, name in enumerate(("north", "east")):
        expected = [rotation_matrix(attitude).T[:, axis] for attitude in at.motion[:, 6:9]]
        assert_allclose(effect(f"current, {name}", model, at), expected, atol=1e-14)


@pytest.mark.parametrize(
    ("name", "given"), [("trim of the rudder", 0), ("trim of the elevator", 1), ("constant thrust", 2)]
)
def test_a_trim_is_added_to_an_input(name, given, model, at):
    expected = by_step(lambda by: model.rates(at.motion, at.inputs + by * np.eye(4)[given], at.ballast), 1e-3)
    assert_allclose(effect(name, model, at), expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(("name", "symbol"), [("mass", "m"), ("buoyancy", "B"), ("xG", "xG")])
def test_a_known_parameter_changes_the_rates(name, symbol, model, known, at, experiment_with):
    values = factors(experiment_with().vehicle.all_coefficients())

    def rates(by):
        return FaultedVehicle({**known, symbol: known[symbol] + by}, values).rates(at.motion, at.inputs, at.ballast)

    expected = by_step(rates, 1e-4)
    # A whole kilogram, of which the effect is not quite linear.
    assert np.abs(expected).max() > 0.0
    assert_allclose(effect(name, model, at), expected, atol=0.02 * np.abs(expected).max())


@pytest.mark.parametrize(("name", "row"), [("Y_|v|r", 1), ("N_|v|r", 5)])
def test_cross_flow_is_a_force_or_a_moment(name, row, model, known, at):
    faster = effect(name, model, at)
    forces = np.zeros((N, 6))
    forces[:, row] = np.abs(at.motion[:, 1]) * at.motion[:, 5]
    assert_allclose(faster[:, :6] @ mass_matrix(known).T, forces, atol=1e-12)
    assert not faster[:, 6:].any()


def linearised(parameters, before, moving, rows):
    """Nothing is left of a trajectory, and a transition that changes nothing."""
    residual = np.zeros(rows.shape[:2])
    transition = np.tile(np.eye(rows.shape[2])[parameters.size :], (len(moving), 1, 1))
    return Linearised(parameters, before, moving, residual, rows, np.zeros(moving.shape), transition)


@pytest.fixture
def along(simulated_with, rng):
    """A chunk of data with some motion along it: problem, timeline and what is linear about it."""
    dataset = simulated_with("manoeuvre.duration=1 s", "manoeuvre.initial_speed=2 m/s", "manoeuvre.input_rate=100 Hz")
    problem = augmented_problem(prepare(dataset))
    timeline = next(iter(problem.segments[0].timelines))
    symbols, scale = problem.layout.symbols, problem.layout.scale
    n = problem.layout.n_parameters
    parameters = np.array([dataset.truth.coefficients[symbol] for symbol in symbols[:n]]) / scale[:n]
    states = np.cumsum(0.002 * rng.standard_normal((timeline.time.size + 1, 9)), axis=0)
    states[:, 0] += 2.0
    shape = timeline.measurement.shape
    about = linearised(parameters, states[0], states[1:].copy(), np.zeros((*shape, len(symbols))))
    states[1:] = moved(problem, timeline, about, problem.known, timeline.inputs, onward=True)
    about.moving[:] = states[1:]
    for i in range(9):
        ahead, behind = (
            moved(problem, timeline, about._replace(before=start[0], moving=start[1:]), problem.known, timeline.inputs)
            for start in (states + by * np.eye(9)[i] for by in (1e-5, -1e-5))
        )
        about.transition[:, :, n + i] = (ahead - behind) / 2e-5
    return problem, timeline, about


def moved(problem, timeline, about, known, inputs, onward=False):
    """Where the process takes the motion from each event to the next, or `onward` from the first event."""
    process = vehicle_process(vehicle_constants(known), problem.held, problem.layout)
    n, before = problem.layout.n_parameters, np.vstack([about.before, about.moving])
    ends = []
    for event in range(timeline.time.size):
        pieces = slice(*timeline.substep_offset[event : event + 2])
        state = np.append(about.parameters, ends[-1] if onward and ends else before[event])
        given = inputs, timeline.substep_input[pieces], timeline.substep_duration[pieces]
        scratch = np.zeros(process.scratch_size)
        if pieces.stop > pieces.start:
            process.transition(state, *given, process.constants, process.selection, np.eye(state.size), scratch)
        ends.append(state[n:])
    return np.array(ends)


def test_fault_effects_equal_changes_of_the_process(along):
    problem, timeline, about = along
    assert timeline.substep_offset[-1] > timeline.time.size / 2
    faults = VehicleFaults(problem)
    pushed, added = faults.effects(0, timeline, about)

    def with_mass(by):
        return moved(problem, timeline, about, problem.known | {"m": problem.known["m"] + by}, timeline.inputs)

    def with_trim(by):
        return moved(problem, timeline, about, problem.known, timeline.inputs + by * np.eye(4)[0])

    for name, function in (("mass", with_mass), ("trim of the rudder", with_trim)):
        expected, f = by_step(function, 1e-3), names_of(faults).index(name)
        assert_allclose(pushed[..., f], expected, atol=2e-3 * np.abs(expected).max())
        assert not added[..., f].any()


def test_sensor_fault_changes_its_sensor_at_its_events(along):
    problem, timeline, about = along
    faults = VehicleFaults(problem)
    pushed, added = faults.effects(0, timeline, about)
    event = np.repeat(np.arange(timeline.time.size), np.diff(timeline.measurement_offset))
    for name, sensor, columns in (("lever arm of the DVL, x", "dvl", 3), ("bias of q", "gyroscope", 3)):
        f = names_of(faults).index(name)
        own = timeline.measurement_sensor == [*problem.measuring].index(sensor)
        at = Motion(
            about.moving[event[own]], *(np.zeros((own.sum(), k)) for k in (4, 4, 4, 9, 2, 2)), np.zeros(own.sum())
        )
        assert own.any()
        assert_allclose(added[own, :columns, f], BY_NAME[name].effect(None, at), atol=1e-15)
        assert not added[~own, :, f].any()
        assert not pushed[..., f].any()


@pytest.mark.parametrize("walk", [0.0, 1e-3])
def test_estimated_thrust_and_ballast_move_the_vehicle(walk, simulated_with, along):
    _, _, before = along
    walks = f"thrust: {{walk: {walk}}}, ballast: {{buoyancy_walk: {walk}, moment_walk: {walk}}}"
    asked = f"{{biases: [thrust, ballast], {walks}}}"
    dataset = simulated_with("manoeuvre.duration=1 s", f"identification.estimate={asked}")
    problem = augmented_problem(prepare(dataset))
    timeline, n = next(iter(problem.segments[0].timelines)), problem.layout.n_parameters
    values = {symbol: dataset.truth.coefficients.get(symbol, 0.2) for symbol in problem.layout.symbols[:n]}
    # Among the parameters, or behind the motion.
    assert values.get("thrust_scale") == (None if walk else 0.2)
    start = np.append(before.before, np.full(3, 0.2)) if walk else before.before
    states = np.tile(start, (timeline.time.size, 1))
    shape = timeline.measurement.shape
    rows = np.zeros((*shape, problem.layout.scale.size))
    parameters = np.array([*values.values()]) / problem.layout.scale[:n]
    about = linearised(parameters, start, states, rows)
    faults = VehicleFaults(problem)
    late = faults.effects(0, timeline, about).on_measurements[..., names_of(faults).index("delay of the DVL")]
    (last,) = np.flatnonzero(timeline.measurement_sensor == [*problem.measuring].index("dvl"))[-1:]
    event = np.searchsorted(timeline.measurement_offset, last, side="right") - 1
    inputs = timeline.inputs[timeline.substep_input[timeline.substep_offset[event + 1] - 1]]
    model = FaultedVehicle(problem.known, factors(values, ActuatorErrors(1.2)))
    assert_allclose(late[last], -model.rates(states[:1, :9], inputs[None], np.full((1, 2), 0.2))[0, :3], rtol=1e-12)


def names_with(dataset):
    return names_of(VehicleFaults(augmented_problem(prepare(dataset))))


@pytest.mark.parametrize("symbol", ["X_u|u|", "M_uql", "N_uudr", "Y_r|r|"])
def test_held_coefficient_changes_the_rates_like_another_value(symbol, model, known, at, experiment_with):
    values = experiment_with().vehicle.all_coefficients()
    changed = FaultedVehicle(known, factors(values | {symbol: values[symbol] + 1.0}))
    expected = changed.rates(at.motion, at.inputs, at.ballast) - at.rates
    (coefficient,) = (each for each in COEFFICIENTS if each.symbol == symbol)
    assert_allclose(held_coefficient(coefficient).effect(model, at), expected, atol=1e-11)


def test_coefficients_that_are_held_are_tested(short_run, with_settings):
    some = augmented_problem(prepare(with_settings(short_run, "identification.coefficients=[X_u|u|, Y_url]")))
    everything = names_of(VehicleFaults(some))
    assert {"held Y_uvl", "held M_uude"} <= {*everything}
    assert not {"held X_u|u|", "held Y_url"} & {*everything}


def test_each_fault_is_parsed_from_its_text():
    for model in (*FAULTS, *DELAY_FAULTS.values()):
        assert Fault.parse(str(model.fault)) == model.fault
        assert model.fault.remedy
    for text in ("the segment from 1e+03 s", "another minimum (cost 0.5 higher)", "a fault of an older version"):
        assert str(Fault.parse(text)) == text
    assert Fault.parse("the segment from 30 s") == Fault(FaultKind.SEGMENT, "30")
    assert Fault.parse("a fault of an older version").remedy == ""
    assert Fault.parse("rudder that answers pushes") == Fault(FaultKind.ANTICIPATING_FIN, "rudder")


def test_confounded_ballast_is_named():
    for name in ("buoyancy", "xG"):
        assert "(identification.estimate.biases: [ballast])" in BY_NAME[name].fault.remedy


def test_what_is_estimated_or_not_measured_is_not_tested(short_run, with_settings):
    everything = names_with(short_run)
    unasked = [name for name, fault in BY_NAME.items() if not fault.is_drift and not fault.reacts_to]
    assert everything == tuple(name for name in unasked if BY_NAME[name].sensor not in INERTIAL)
    assert {"Iyy", "Y_vdot", "zG", "X_u", "scale of q", "bias of theta"} <= {*everything}
    felt = names_with(with_settings(short_run, "identification.attitude_from=inertial"))
    assert felt == tuple(name for name in unasked if BY_NAME[name].sensor not in ("magnetic_field", "attitude"))
    estimated = names_with(with_settings(short_run, "identification.estimate.biases=[gyro, dvl, current, ballast]"))
    assert set(everything) - set(estimated) == {
        *(f"bias of {symbol}" for symbol in "pqr"), "scale of the DVL", "mounting yaw of the DVL",
        "current, north", "current, east", "buoyancy",
    }  # fmt: skip
    blind = replace(short_run, sensors={k: v for k, v in short_run.sensors.items() if k != "dvl"})
    assert {name for name in everything if BY_NAME[name].sensor == "dvl"} == set(everything) - set(names_with(blind))


def test_a_drift_grows_with_time(model, at):
    for name in ("trim of the rudder", "current, north"):
        assert_allclose(effect(f"drift of the {name}", model, at), at.time[:, None] * effect(name, model, at))


def test_drift_is_that_of_the_acting_input(model, at):
    rate = at.time[:, None]

    def with_thrust(by):
        return model.rates(at.motion, at.inputs * (1.0 + by * rate * np.eye(4)[2]), at.ballast)

    def with_ballast(part):
        return lambda by: model.rates(at.motion, at.inputs, at.ballast + by * rate * np.eye(2)[part])

    for name, function in (
        ("scale of the thrust", with_thrust),
        ("excess buoyancy", with_ballast(0)),
        ("moment of trim", with_ballast(1)),
    ):
        expected = by_step(function, 1e-3)
        assert np.abs(expected).max() > 0.0
        assert_allclose(effect(f"drift of the {name}", model, at), expected, atol=1e-8 * np.abs(expected).max())


def test_drifts_are_tested_of_what_is_estimated_as_a_constant(short_run, with_settings):
    drifts = {
        *("drift of the trim of the rudder", "drift of the trim of the elevator", "drift of the scale of the thrust"),
        *("drift of the excess buoyancy", "drift of the moment of trim"),
    }
    names = "biases: [fin_trim, thrust, ballast]"
    constant = names_with(with_settings(short_run, f"identification.estimate={{{names}}}"))
    walks = (
        "fin_trim: {walk: 1e-4 rad/s^0.5}, thrust: {walk: 1e-4 1/s^0.5}, "
        "ballast: {buoyancy_walk: 0.1 N/s^0.5, moment_walk: 0.1 N*m/s^0.5}"
    )
    walking = names_with(with_settings(short_run, f"identification.estimate={{{names}, {walks}}}"))
    assert drifts <= {*constant}
    assert not {name for name in (*walking, *names_with(short_run)) if name.startswith("drift")}


def test_small_moves_of_an_anticipating_fin_are_rates(model, at):
    for fin, given, turning in (("rudder", 0, 5), ("elevator", 1, 4)):
        expected = np.zeros((N, 9))
        expected[:, turning] = at.small_rate[:, given]
        assert_allclose(effect(f"{fin} reacting to disturbances", model, at), expected)


def test_large_fin_moves_are_not_anticipation(along):
    problem, timeline, about = along
    faults = VehicleFaults(problem, tested=[BY_NAME["elevator reacting to disturbances"]._replace(reacts_to="")])
    rate = problem.segments[0].timelines.input_rate()[:, 1]
    large = np.abs(rate) > np.quantile(np.abs(rate), 0.98)
    assert 0 < large.mean() < 0.03
    given = timeline.substep_input[timeline.substep_offset[:-1].clip(max=timeline.substep_input.size - 1)]
    one = np.diff(timeline.substep_offset) == 1
    pushed = faults.effects(0, timeline, about).on_states[..., 0]
    assert not pushed[one & large[given]].any()
    assert pushed[one & ~large[given]].any()
