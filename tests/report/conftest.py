"""A small dataset with estimates, made by hand: nothing is simulated or filtered here."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.config.experiment import Experiment
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord, TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import Innovations
from auvid_cli.evaluation.accuracy import average_steady_state_error, coefficient_results, relative_rmse
from auvid_cli.evaluation.evaluate import Evaluation, FilterSummary
from auvid_cli.evaluation.free_run import VelocityError
from auvid_cli.evaluation.innovations import mean_nis, sensor_consistency
from auvid_cli.evaluation.judgement import Grade, Judgement, judge_one, status_of
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import MOTION, MOTION_SYMBOLS, SENSORS

EXPERIMENT = Experiment.model_construct(name="stub", vehicle=VehicleSettings.model_construct(terms=()))
TRUE = {c.symbol: 10.0 + i for i, c in enumerate(COEFFICIENTS)}
# Of the last the data say nothing.
BOUNDS = {symbol: 0.2 for symbol in TRUE} | {"N_uudr": np.inf}
TIME = np.linspace(0.0, 80.0, 401)
WIDTHS = {"gyroscope": 3, "dvl": 3, "attitude": 3}


def motion_at(time):
    waves = np.sin(np.outer(time, np.linspace(0.2, 0.5, 9)))
    waves[:, 0] += 1.5
    waves[:, 8] = 0.1 * time
    return waves


@pytest.fixture
def dataset() -> Dataset:
    return make_dataset()


def make_dataset() -> Dataset:
    rng = np.random.default_rng(0)
    motion = motion_at(TIME)
    columns = {"dvl": slice(0, 3), "gyroscope": slice(3, 6), "attitude": slice(6, 9)}
    sensors = {
        name: SensorRecord(TIME, motion[:, part] + 0.01 * rng.standard_normal((TIME.size, 3)), np.full(3, 0.01))
        for name, part in columns.items()
    }
    sensors["attitude"].values[:, 2] = (sensors["attitude"].values[:, 2] + np.pi) % (2 * np.pi) - np.pi
    sensors["dvl"].values[50:60] = np.nan
    position = np.stack([np.cos(0.1 * TIME), np.sin(0.1 * TIME), 0.2 * TIME], axis=1) * 10.0
    truth = TruthRecord(TIME, motion, position, TRUE)
    return Dataset(InputRecord(TIME, np.zeros((TIME.size, 4))), sensors, EXPERIMENT, truth)


def make_estimate(name: str, symbols=tuple(TRUE), offset=0.01) -> Estimate:
    """Estimates that settle to (1 + offset) times the truth."""
    rng = np.random.default_rng(len(name))
    units = {c.symbol: c.unit for c in COEFFICIENTS}
    settled = np.array([TRUE[symbol] for symbol in symbols]) * (1.0 + offset)
    coefficients = settled * (1.0 - np.exp(-TIME[:, None]))
    innovation = {key: 0.01 * rng.standard_normal((TIME.size, width)) for key, width in WIDTHS.items()}
    variance = np.full((TIME.size, 3), 1e-4)
    mean = np.concatenate([coefficients, motion_at(TIME)], axis=1)
    return Estimate(
        filter=name,
        experiment=EXPERIMENT,
        state=(*symbols, *MOTION_SYMBOLS),
        unit=(*(units[symbol] for symbol in symbols), *(quantity.unit for quantity in MOTION)),
        time=TIME,
        mean=mean,
        standard_deviation=np.full_like(mean, 0.25),
        covariance=np.eye(mean.shape[1]),
        innovations={
            key: Innovations(TIME, values, variance, (values**2 / variance).sum(axis=1), np.sqrt(variance[0]))
            for key, values in innovation.items()
        },
        held={symbol: TRUE[symbol] for symbol in TRUE if symbol not in symbols},
        status="completed",
        steps=TIME.size,
        cpu_time=0.125,
        wall_time=0.125,
        dataset_sha256="",
    )


def diverged(estimate: Estimate, samples: int) -> Estimate:
    """The same, ended early."""
    return replace(
        estimate,
        time=estimate.time[:samples],
        mean=estimate.mean[:samples],
        standard_deviation=estimate.standard_deviation[:samples],
        innovations={
            name: replace(
                i,
                time=i.time[:samples],
                innovation=i.innovation[:samples] * np.nan,
                variance=i.variance[:samples],
                nis=i.nis[:samples] * np.nan,
            )
            for name, i in estimate.innovations.items()
        },
        status="diverged at t = 0.200 s: the state was not finite after a measurement of dvl",
    )


def evaluation_of(dataset: Dataset, estimates: list[Estimate], blown_up: tuple[str, ...] = ()) -> Evaluation:
    """What `evaluate` gives, with a free run that needs no vehicle."""
    evaluation = Evaluation([], [], [], [], [], [], {}, [])
    for estimate in estimates:
        judgement = Judgement(Grade.SOUND) if status_of(estimate) == "completed" else judge_one(estimate, None)
        results = coefficient_results(estimate, dataset.truth, BOUNDS, judgement)
        motion = motion_at(TIME) + 0.02
        if estimate.filter in blown_up:
            motion[100:] = np.inf
            motion[90:100] = 1e300
        run = FreeRun(TIME, motion)
        measured = {quantity.symbol for name in dataset.sensors for quantity in SENSORS[name]}
        errors = [
            VelocityError(
                estimate.filter,
                q.symbol,
                q.unit,
                0.02 if q.symbol in measured and estimate.filter not in blown_up else None,
            )
            for q in MOTION[:6]
        ]
        steps = estimate.time.size
        evaluation.coefficients.extend(results)
        evaluation.velocity_errors.extend(errors)
        evaluation.consistency.extend(sensor_consistency(estimate))
        evaluation.summary.append(
            FilterSummary(
                estimate.filter,
                average_steady_state_error(results),
                float(np.mean(relative_rmse(results))) if relative_rmse(results) else None,
                float(np.median(relative_rmse(results))) if relative_rmse(results) else None,
                mean_nis(estimate),
                estimate.cpu_time,
                steps,
                estimate.cpu_time / steps * 1e6,
                estimate.status,
                judgement,
            )
        )
        evaluation.free_runs[estimate.filter] = run
    return evaluation


@pytest.fixture
def estimates() -> list[Estimate]:
    return [make_estimate("ekf", offset=0.02), make_estimate("ckf"), make_estimate("tukf", offset=0.005)]


@pytest.fixture
def evaluation(dataset, estimates) -> Evaluation:
    return evaluation_of(dataset, estimates)
