"""What innovations look like, where they are no noise: closed forms, and faults that are in the data."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from auvid_cli.config.enums import FilterName
from auvid_cli.data.faults import Fault, FaultTest
from auvid_cli.data.innovations import Innovations
from auvid_cli.evaluation.innovations import likely_causes, noise_cause
from auvid_cli.identification.run import identify
from auvid_cli.vehicle.parameters import SENSORS


def innovations_of(values):
    time = 0.1 * np.arange(len(values))
    squares = (values**2).sum(axis=1)
    return Innovations(time, values, np.ones_like(values), squares, np.ones(values.shape[1]))


def cause_of(values):
    return noise_cause("dvl", innovations_of(values).statistics())


def autoregressive(rng, memory, n=20_000):
    """Noise of variance 1 in each of three components."""
    return lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal((n, 3)), axis=0)


def test_a_gain_by_memory_is_that_of_the_likelihood_of_an_autoregression(rng):
    values = autoregressive(rng, 0.5)
    cause = cause_of(values)
    steps = (values[1:] - 0.5 * values[:-1]) / np.sqrt(0.75)
    difference = 0.5 * (values[1:] ** 2).sum() - 0.5 * (steps**2).sum() - 0.5 * steps.size * np.log(0.75)
    assert cause.gain == pytest.approx(difference, rel=0.03)
    assert "correlated" in cause.name
    assert "more process noise" in cause.remedy


def test_a_gain_by_size_is_that_of_the_likelihood_of_white_noise(rng):
    values = 1.3 * rng.standard_normal((20_000, 3))
    cause = cause_of(values)
    scale = np.sqrt((values**2).mean())
    assert cause.gain == pytest.approx(0.5 * (values**2).sum() * (1.0 - scale**-2) - values.size * np.log(scale))
    assert cause.name == "more noise of dvl than stated, or more process noise"
    assert "too large" in cause_of(0.5 * values).name


def test_what_is_larger_and_lasts_is_no_larger_noise_of_its_sensor(rng):
    """Whatever size alone would gain: white noise as large explains no memory, and what lasts explains the size too."""
    values = 5.0 * autoregressive(rng, 0.5)
    cause = cause_of(values)
    assert cause.name.startswith("errors of dvl that are correlated")
    assert "disturbance" in cause.remedy
    alone = cause_of(autoregressive(rng, 0.5))
    larger = cause_of(5.0 * rng.standard_normal(values.shape))
    assert cause.gain == pytest.approx(alone.gain + larger.gain, rel=0.03)


def test_what_was_corrected_too_far_asks_for_less_process_noise(rng):
    assert "less process noise" in cause_of(autoregressive(rng, -0.5)).name


def test_where_something_lasts_no_other_sensor_asks_for_less_process_noise(rng, short_estimates):
    noise = {"gyroscope": autoregressive(rng, 0.5), "dvl": autoregressive(rng, -0.5)}
    innovations = {sensor: innovations_of(values) for sensor, values in noise.items()}
    causes = likely_causes(replace(short_estimates[FilterName.CKF], innovations=innovations))
    assert {cause.name.split(" that ")[0] for cause in causes} >= {
        "errors of gyroscope",
        "more noise of dvl than stated",
    }
    assert not any("less process noise" in f"{cause.name} {cause.remedy}" for cause in causes)


def test_white_noise_of_the_stated_size_has_no_cause(rng, short_estimates):
    noise = {name: innovations_of(rng.standard_normal((20_000, len(SENSORS[name])))) for name in ("gyroscope", "dvl")}
    assert likely_causes(replace(short_estimates[FilterName.CKF], innovations=noise)) == []


def test_causes_stand_in_the_order_of_their_gain(rng, short_estimates):
    faults = [FaultTest(Fault.parse("delay of the DVL"), "s", size, 1.0, "X_u|u|", 1.0) for size in (40.0, 3.0, -5.0)]
    noise = {"dvl": innovations_of(autoregressive(rng, 0.2, 4000))}
    causes = likely_causes(replace(short_estimates[FilterName.CKF], innovations=noise, faults=tuple(faults)))
    assert [round(cause.gain) for cause in causes] == [800, pytest.approx(245, rel=0.25), 12]
    assert ["delay" in cause.name for cause in causes] == [True, False, True]


@pytest.mark.parametrize(("size", "first"), [(30.0, "delay of the inputs"), (8.0, "errors of dvl that are correlated")])
def test_a_fault_that_explains_most_of_what_lasts_stands_before_it(size, first, rng, short_estimates):
    faults = [FaultTest(Fault.parse("delay of the inputs"), "s", size, 1.0, "N_uudr", 1.0)]
    noise = {"dvl": innovations_of(autoregressive(rng, 0.2, 10_000))}
    plain = likely_causes(replace(short_estimates[FilterName.CKF], innovations=noise, faults=()))
    causes = likely_causes(replace(short_estimates[FilterName.CKF], innovations=noise, faults=tuple(faults)))
    assert causes[0].name.startswith(first)
    lasts = next(cause for cause in causes if cause.lasts)
    explained = 0.5 * size**2 if first.startswith("delay") else 0.0
    assert lasts.gain == pytest.approx(plain[0].gain - explained)


@pytest.mark.slow
def test_errors_of_a_gyroscope_that_last_are_named_and_nobody_says_to_lower_the_process_noise(simulated_with, rng):
    dataset = simulated_with("manoeuvre.duration=40 s", "sensors.attitude={source: direct, rate: 20 Hz}")
    gyroscope = dataset.sensors["gyroscope"]
    last = autoregressive(rng, 0.99, len(gyroscope.time)) * gyroscope.standard_deviation
    sensors = dataset.sensors | {"gyroscope": replace(gyroscope, values=gyroscope.values + last)}
    cause = likely_causes(identify(replace(dataset, sensors=sensors), FilterName.SMOOTHER))[0]
    assert cause.name.startswith("errors of gyroscope that are correlated")
    assert cause.remedy.startswith("more process noise")
