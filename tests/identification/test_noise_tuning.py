"""Noise of a simulated run, of which the truth is known."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import yaml

from auvid_cli.config.enums import FilterName
from auvid_cli.config.loading import dump_experiment, parse_run
from auvid_cli.identification.noise import _part, choose_disturbance, process_noises, tune_coarsely, tune_noise
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.problem_setup import augmented_problem
from auvid_cli.identification.run import identify

FEW = "identification.coefficients=[X_u|u|, N_url, N_uudr]"
SLOW = "sensors.attitude={source: direct, rate: 20 Hz}", "sensors.gyroscope.rate=20 Hz", "manoeuvre.input_rate=20 Hz"
LONG = (
    "manoeuvre.duration=640 s",
    "manoeuvre.input_rate=2 Hz",
    "identification.integration_step=0.1 s",
    "sensors.gyroscope.rate=2 Hz",
    "sensors.dvl.rate=2 Hz",
    "sensors.attitude={source: direct, rate: 2 Hz}",
)


@pytest.fixture(scope="module")
def overstated(simulated_with):
    """Some seconds with white noise and without process noise; the stated noise of the DVL is twice the true one."""
    dataset = simulated_with("manoeuvre.duration=8 s", *SLOW, FEW)
    dvl = dataset.sensors["dvl"]
    return replace(
        dataset, sensors=dataset.sensors | {"dvl": replace(dvl, standard_deviation=2 * dvl.standard_deviation)}
    )


@pytest.fixture(scope="module")
def tuned(overstated):
    return tune_noise(prepare(overstated), with_sensors=True)[0]


def test_wrong_sensor_noise_is_corrected(tuned):
    noises = {noise.setting: noise for noise in tuned.noises}
    for sensor, factor in (("dvl", 0.5), ("gyroscope", 1.0), ("attitude", 1.0)):
        noise = noises[f"identification.measurement_noise.{sensor}"]
        width = np.log(noise.high / noise.low) / 4.0
        assert abs(np.log(noise.tuned / factor)) < 3.0 * width, sensor
        assert width < 0.1
    assert tuned.gain > 20.0


def test_a_simulation_without_disturbances_needs_no_process_noise(tuned):
    for noise in tuned.noises[:3]:
        assert noise.low == 0.0 < noise.high < np.inf, noise
        # Less noise changes nothing, and the smoother would hardly converge with it.
        assert noise.tuned > 1e-4 * noise.high, noise


def test_estimators_use_the_tuned_noise(tuned, overstated):
    dataset = replace(overstated, experiment=tuned.experiment)
    assert dataset.experiment.identification.measurement_noise["dvl"] == pytest.approx(0.5, rel=0.2)
    estimate = identify(dataset, FilterName.CKF)
    tally = estimate.innovations["dvl"].sums()
    assert tally.squares.sum() / tally.components.sum() == pytest.approx(1.0, abs=0.15)


def test_depth_and_walks_have_noise_levels(simulated_with):
    asked = "{biases: [gyro, dvl], gyro: {walk: 1e-4 rad/s/s^0.5}, dvl: {yaw_walk: 1e-3 rad/s^0.5}}"
    dataset = simulated_with(
        "manoeuvre.duration=4 s", FEW, "sensors.depth={rate: 5 Hz, noise: 1 cm}", f"identification.estimate={asked}"
    )
    augmented = augmented_problem(prepare(dataset))
    noises = {noise.path: noise for noise in process_noises(augmented, dataset.experiment.identification)}
    moving = augmented.layout.symbols[augmented.layout.n_parameters :]
    drives = {".".join(path): [moving[i] for i in noise.group.moving] for path, noise in noises.items()}
    assert drives == {
        "process_noise.velocity": ["u", "v", "w"],
        "process_noise.rate": ["p", "q", "r"],
        "process_noise.attitude": ["phi", "theta", "psi"],
        "process_noise.depth": ["down"],
        "estimate.gyro.walk": ["bias_p", "bias_q", "bias_r"],
        "estimate.dvl.yaw_walk": ["dvl_yaw"],
    }
    assert noises["estimate", "dvl", "yaw_walk"].stated == pytest.approx(1e-3)


def test_noise_of_each_axis_is_tuned(simulated_with):
    listed = "identification.process_noise.velocity=[1e-4, 2e-4, 3e-4]"
    dataset = simulated_with("manoeuvre.duration=4 s", FEW, listed)
    augmented = augmented_problem(prepare(dataset))
    noises = {noise.path: noise for noise in process_noises(augmented, dataset.experiment.identification)}
    moving = augmented.layout.symbols[augmented.layout.n_parameters :]
    of_velocity = {
        path: (moving[noise.group.moving[0]], noise.stated) for path, noise in noises.items() if len(path) > 2
    }
    assert of_velocity == {
        ("process_noise", "velocity", str(axis)): (symbol, pytest.approx(stated))
        for axis, (symbol, stated) in enumerate((("u", 1e-4), ("v", 2e-4), ("w", 3e-4)))
    }
    density = augmented.joint.process.noise_density
    assert density[:3].tolist() == pytest.approx([1e-4, 2e-4, 3e-4])
    assert density[3:6].tolist() == pytest.approx([1e-4] * 3)


DISTURBED = (
    "{biases: [disturbance], disturbance: {force: {standard_deviation: 2 N, time_constant: 2 s}, "
    "moment: {standard_deviation: [0, 1, 1], time_constant: 2 s}}}"
)


@pytest.fixture(scope="module")
def tuned_disturbance(simulated_with):
    """The stated disturbance has too small a force, a yaw moment that is not there, and twice the time constant."""
    pushes = (
        "manoeuvre.disturbance={force: {standard_deviation: 5 N, time_constant: 1 s}, "
        "moment: {standard_deviation: [0, 2, 0], time_constant: 1 s}}"
    )
    asked = DISTURBED.replace("2 N", "3 N")
    run = simulated_with("manoeuvre.duration=15 s", *SLOW, FEW, pushes, f"identification.estimate={asked}")
    return tune_noise(prepare(run), with_time_constants=True)[0]


@pytest.mark.slow
def test_disturbance_is_sized(tuned_disturbance):
    noises = {noise.setting.partition("disturbance.")[2]: noise for noise in tuned_disturbance.noises}
    sizes = ("force.standard_deviation", 5.0), ("moment.standard_deviation.1", 2.0)
    times = ("force.time_constant", 1.0), ("moment.time_constant", 1.0)
    # In 15 s there are 15 time constants, which determine the logarithm of one to sqrt(2 / 15) = 0.37.
    for key, true, widest in (*((*size, 0.5) for size in sizes), *((*time, 1.3) for time in times)):
        width = np.log(noises[key].high / noises[key].low) / 4.0
        assert abs(np.log(noises[key].tuned / true)) < 3.0 * width < widest, key
    yaw = noises["moment.standard_deviation.2"]
    assert yaw.low == 0.0 < yaw.high < 0.2
    # Not quite none, which a smoother could hardly follow.
    held = tuned_disturbance.experiment.identification.estimate.disturbance.moment.standard_deviation[2]
    assert held == pytest.approx(yaw.worth_stating, rel=0.01)
    assert yaw._replace(tuned=0.0).worth_stating == pytest.approx(0.1 * yaw.high)
    assert yaw._replace(high=np.inf).worth_stating == yaw.tuned


@pytest.mark.slow
def test_disturbance_sizes_are_written_and_read_as_lists(tuned_disturbance, experiment_with):
    asked = f"identification.estimate={DISTURBED}"
    settings = yaml.safe_load(tuned_disturbance.settings())["identification"]
    assert settings["smoother"] == {"answer": "marginal"}
    held = settings["estimate"]["disturbance"]
    read = experiment_with(asked, f"identification.estimate.disturbance={held}").identification.estimate.disturbance
    assert read == tuned_disturbance.experiment.identification.estimate.disturbance
    assert read.moment.standard_deviation[0] == 0.0


@pytest.mark.slow
def test_tuned_file_states_its_biases(tuned_disturbance, experiment_with):
    """The process noise of a run that something disturbs is no more that of the same without."""
    estimate = yaml.safe_load(tuned_disturbance.settings())["identification"]["estimate"]
    read = experiment_with(f"identification.estimate={estimate}").identification.estimate
    assert read.biases == ("disturbance",)
    assert read == tuned_disturbance.experiment.identification.estimate


@pytest.mark.slow
def test_disturbance_is_chosen_in_disturbed_data(simulated_with):
    """Nothing is stated of it; each axis is sized, and what pushes none is not."""
    pushes = (
        "manoeuvre.disturbance={force: {standard_deviation: 5 N, time_constant: 1 s}, "
        "moment: {standard_deviation: [0, 2, 2], time_constant: 1 s}}"
    )
    chosen = choose_disturbance(prepare(simulated_with("manoeuvre.duration=15 s", *SLOW, FEW, pushes)))[0]
    assert chosen.choice.is_kept
    assert chosen.choice.n_parameters == 8
    assert chosen.gain > chosen.choice.gain > chosen.choice.needed
    assert chosen.experiment.identification.estimate.biases == ("disturbance",)
    noises = {noise.setting.partition("disturbance.")[2]: noise for noise in chosen.noises}
    true = {"force.time_constant": 1.0, "moment.time_constant": 1.0}
    true |= {f"force.standard_deviation.{axis}": 5.0 for axis in range(3)}
    true |= {f"moment.standard_deviation.{axis}": 2.0 for axis in (1, 2)}
    for key, value in true.items():
        width = np.log(noises[key].high / noises[key].low) / 4.0
        assert abs(np.log(noises[key].tuned / value)) < 3.0 * width < 2.0, key
    assert noises["moment.standard_deviation.0"].low == 0.0


@pytest.mark.slow
def test_no_disturbance_is_chosen_in_undisturbed_data(overstated):
    chosen = choose_disturbance(prepare(overstated))[0]
    assert not chosen.choice.is_kept
    assert chosen.choice.gain < 5.0 < chosen.choice.needed
    assert chosen.experiment.identification.estimate.biases == ()
    assert yaml.safe_load(chosen.settings())["identification"]["estimate"] == {"biases": []}


@pytest.mark.slow
def test_time_constant_of_near_white_noise_is_uncertain(simulated_with):
    """A force drawn independently at each input."""
    pushes = "manoeuvre.disturbance.force={standard_deviation: 100 N, time_constant: 1e-9 s}"
    asked = "{biases: [disturbance], disturbance: {force: {standard_deviation: 2 N, time_constant: 2 s}}}"
    prepared = prepare(simulated_with("manoeuvre.duration=8 s", *SLOW, FEW, pushes, f"identification.estimate={asked}"))
    assert not any(noise.is_time_constant for noise in tune_noise(prepared)[0].noises)
    tuned, _ = tune_noise(prepared, with_time_constants=True)
    lasts = next(noise for noise in tuned.noises if noise.is_time_constant)
    assert lasts.low == 0.0
    assert lasts.tuned < 1.0
    stated = tuned.experiment.identification.estimate.disturbance.force.time_constant
    assert stated == pytest.approx((lasts.tuned,), rel=0.01)


def test_settings_accept_a_level_that_is_tuned_to_nothing(simulated_with):
    walk = "identification.estimate={biases: [gyro], gyro: {walk: 2e-12 rad/s/s^0.5}}"
    dataset = simulated_with("manoeuvre.duration=8 s", *SLOW, FEW, walk)
    least = dataset.experiment.identification.process_noise
    found = tune_coarsely(prepare(dataset), least, (), lambda progress: None)
    assert found is not None
    tuning, _ = found
    read = parse_run(dump_experiment(tuning.experiment), "tuned", ())
    assert read.identification.estimate.gyro.walk >= 1e-12


@pytest.mark.slow
def test_search_on_long_data_begins_on_a_part_and_finds_the_same_noise(simulated_with):
    dataset = simulated_with(*LONG, FEW)
    dvl = dataset.sensors["dvl"]
    stated = replace(dvl, standard_deviation=3.0 * dvl.standard_deviation)
    wrong = prepare(replace(dataset, sensors=dataset.sensors | {"dvl": stated}))
    steps: list[str] = []
    tuned, _ = tune_noise(wrong, with_sensors=True, on_progress=lambda progress: steps.append(str(progress)))
    on_part = ["the windows" in step for step in steps]
    assert on_part[0]
    assert not on_part[-1]
    assert on_part == sorted(on_part, reverse=True)
    (noise,) = [noise for noise in tuned.noises if noise.setting.endswith("measurement_noise.dvl")]
    width = np.log(noise.high / noise.low) / 4.0
    assert abs(np.log(3.0 * noise.tuned)) < 3.0 * width


def test_long_data_of_short_segments_have_no_part(simulated_with):
    spans = [f"[{10 * k} s, {10 * k + 9.9} s]" for k in range(63)]
    assert _part(prepare(simulated_with(*LONG, f"identification.use.spans=[{', '.join(spans)}]"))) is None


def test_part_of_long_data_has_the_windows_with_turns(simulated_with):
    dataset = simulated_with(*LONG)
    time = dataset.inputs.time
    turns = [60.0, 120.0, 300.0, 420.0, 540.0]
    # The rudder is at 0.2 rad for 20 s of these windows, and oscillates by 0.01 rad all the time.
    values = np.zeros_like(dataset.inputs.values)
    values[:, 0] = 0.01 * np.sin(time)
    values[np.isin(time // 60.0 * 60.0, turns) & (time % 60.0 > 40.0), 0] += 0.2
    part = _part(prepare(replace(dataset, inputs=replace(dataset.inputs, values=values))))
    assert part is not None
    assert [begin for begin, _ in part.experiment.identification.use.spans] == pytest.approx(turns, abs=1.0)


def test_interrupt_before_the_first_trajectory_of_the_second_search_keeps_the_first(simulated_with):
    """With a choice of disturbance, all progress of the second search refers to the finished first one."""
    dataset, seen = simulated_with("manoeuvre.duration=4 s", FEW), []
    choose_disturbance(prepare(dataset), on_progress=seen.append)
    second = [now for before, now in itertools.pairwise(seen) if now.search.passes < before.search.passes]
    assert second[0].search.trajectories == 0
    tuning, _ = second[0].so_far()
    assert all(np.isfinite(noise.high) for noise in tuning.noises if noise.low > 0.0)
    assert seen[0].so_far is None
