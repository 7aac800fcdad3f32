"""A worker performs a group like the single commands do."""

import json

import numpy as np
import pytest

from auvid_cli.campaign.cluster import run_group, shortened_group
from auvid_cli.config.experiment import Experiment
from auvid_cli.errors import ConfigError
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS, SYMBOLS

TEXT = """\
name: short
settings:
  manoeuvre: manoeuvres/spiral_gentle.yaml
  manoeuvre.duration: 20 s
  manoeuvre.input_rate: 25 Hz
  sensors.attitude.source: direct
  identification.judge: false
seeds: [4]
filters: [ckf, {name: wide, filter: ckf, settings: {identification.prior.factor: 10}}]
"""


@pytest.fixture
def performed(planned):
    (group,) = planned(TEXT).groups()
    return group, run_group(group, with_estimates=True)


def test_shortened_group_has_the_first_data(planned):
    (group,) = planned(TEXT).groups()
    short, share = shortened_group(group, 5.0)
    assert share == 0.25
    assert [done.failure for done in run_group(short)] == ["", ""]
    assert json.loads(short.simulated)["manoeuvre"]["duration"] == 5.0


@pytest.mark.slow
def test_measures_equal_those_of_the_report(performed):
    group, done = performed
    for assumed, result in zip(group.assumed, done, strict=True):
        assert result.failure == ""
        experiment = Experiment.model_validate_json(assumed)
        dataset = simulate(experiment)
        estimate = identify(dataset, experiment.identification.filters[0])
        wanted = evaluate(prepare(dataset), [estimate], BoundsOf(prepare(dataset)))
        rows = {(row.kind, row.name): row for row in result.rows}
        for row in wanted.coefficients:
            measure = rows["coefficient", row.coefficient]
            assert (measure.true, measure.estimate, measure.standard_deviation, measure.rmse) == (
                row.true,
                row.estimate,
                row.standard_deviation,
                row.rmse,
            )
            assert measure.cramer_rao_bound == pytest.approx(row.cramer_rao_bound)
        for row in wanted.consistency:
            measure = rows["sensor", row.sensor]
            assert measure.squares / measure.components == pytest.approx(row.mean_nis)
        run = rows["run", ""]
        assert run.steady_state_error_percent == wanted.summary[0].average_steady_state_error_percent
        # NEES by the definition, with an inverse.
        error = [estimate.mean[-1, i] - dataset.truth.coefficients[estimate.state[i]] for i in range(N_COEFFICIENTS)]
        nees = error @ np.linalg.inv(estimate.covariance[:N_COEFFICIENTS, :N_COEFFICIENTS]) @ error
        assert run.squares == pytest.approx(nees, rel=1e-4)
        assert run.components == N_COEFFICIENTS
        roll = np.interp(estimate.time, dataset.truth.time, dataset.truth.motion[:, 6])
        wanted_rmse = np.sqrt(np.mean((estimate.mean[:, estimate.state.index("phi")] - roll) ** 2))
        assert rows["motion", "phi"].rmse == pytest.approx(wanted_rmse)
        np.testing.assert_array_equal(result.estimate.mean, estimate.mean)


@pytest.mark.slow
def test_bounds_use_the_sensors_of_the_filter(planned):
    text = TEXT + "vary: [{setting: identification.attitude_from, values: [ahrs, inertial]}]\n"
    (group,) = planned(text).groups()
    for assumed, result in zip(group.assumed, run_group(group), strict=True):
        experiment = Experiment.model_validate_json(assumed)
        prepared = prepare(simulate(experiment))
        wanted = BoundsOf(prepared)(identify(prepared.dataset, experiment.identification.filters[0])).of_data
        bounds = {row.name: row.cramer_rao_bound for row in result.rows if row.kind == "coefficient"}
        assert bounds == pytest.approx({symbol: wanted[symbol] for symbol in SYMBOLS})


def test_estimates_are_returned_only_on_request(planned):
    (group,) = planned(TEXT).groups()
    assert [done.estimate for done in run_group(group)] == [None, None]


def test_filter_assumes_noise_of_the_experiment_by_default(planned):
    text = TEXT + "vary: [{setting: sensors.dvl.noise, values: [0.05 m/s], known: false}]\n"
    (group,) = planned(text).groups()
    rows = run_group(group)[0].rows
    (dvl,) = [row for row in rows if row.kind == "sensor" and row.name == "dvl"]
    nominal = Experiment.model_validate_json(group.assumed[0]).sensors.dvl.stated_standard_deviation()[0]
    # Innovations are larger by about the square of how much more noise there is than the filter believes.
    assert dvl.squares / dvl.components > 0.3 * (0.05 / nominal) ** 2
    assert rows[0].status.startswith(("inconsistent", "diverged"))


def test_error_in_one_run_does_not_stop_the_others(planned):
    (group,) = planned(TEXT).groups()
    broken = group.assumed[0].replace('"length": 2.194', '"length": -1.0')
    assert broken != group.assumed[0]
    first, second = run_group(replace_assumed(group, [broken, group.assumed[1]]))
    assert "length" in first.failure
    assert first.rows == []
    assert second.failure == ""
    assert len(second.rows) > N_COEFFICIENTS


def test_worker_of_another_version_is_refused(planned):
    (group,) = planned(TEXT).groups()
    with pytest.raises(ConfigError, match=r"worker has auvid \d.*expected 0\.0\.1"):
        run_group(group._replace(version="0.0.1"))


def test_failed_simulation_fails_all_its_runs(planned):
    text = TEXT.replace("duration: 20 s", "duration: 20 s\n  manoeuvre.pitch: 1.5\n  manoeuvre.initial_pitch: 1.5")
    (group,) = planned(text).groups()
    for done in run_group(group):
        assert done.failure
        assert done.rows == []


def replace_assumed(group, assumed):
    return group._replace(assumed=assumed)


@pytest.mark.slow
def test_fit_is_measured_with_what_it_added(planned):
    text = """\
name: fit
settings:
  manoeuvre.duration: 30 s
  manoeuvre.input_rate: 20 Hz
  sensors.attitude: {source: direct, rate: 10 Hz}
  sensors.gyroscope.rate: 20 Hz
seeds: [3]
filters: [{name: fit, filter: smoother, fit: true}]
vary:
  - {setting: sensors.gyroscope.bias, values: [0.2 deg/s], known: false}
"""
    (group,) = planned(text).groups()
    (done,) = run_group(group)
    assert done.failure == ""
    (run,) = (row for row in done.rows if row.kind == "run")
    assert run.additions == "bias of the gyroscope"
    coefficients = [row for row in done.rows if row.kind == "coefficient"]
    errors = [abs(row.estimate - row.true) / row.total_standard_deviation for row in coefficients]
    assert run.largest_error_sigmas == pytest.approx(max(errors))
    assert max(errors) < 5.0
