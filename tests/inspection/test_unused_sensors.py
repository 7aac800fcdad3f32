"""An accelerometer that no estimator uses, against the DVL."""

from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.data.dataset import InputRecord
from auvid_cli.inspection.inspect import contradictions_of_unused
from auvid_cli.report.sentences import contradiction_sentences


@pytest.fixture
def felt(sound_run, changed):
    """Function: a sound run whose accelerometer has its axes times these."""

    def run(*factors):
        def turn(time, values):
            values *= factors

        return changed(sound_run(), "accelerometer", turn)

    return run


def test_agreeing_unused_sensor_is_not_mentioned(felt):
    assert contradiction_sentences(contradictions_of_unused(felt(1.0, 1.0, 1.0))) == []


@pytest.mark.parametrize("factors", [(-1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (1 / 9.81, 1 / 9.81, 1 / 9.81)])
def test_contradicting_unused_sensor_is_mentioned(factors, felt):
    (said,) = contradiction_sentences(contradictions_of_unused(felt(*factors)))
    assert said.startswith("The unused accelerometer contradicts the DVL")


def test_used_sensor_is_no_unused_contradiction(felt, with_settings):
    used = with_settings(felt(-1.0, 1.0, 1.0), "identification.attitude_from=inertial")
    assert contradictions_of_unused(used) == []


def test_contradiction_after_a_long_rest_is_mentioned(felt, rng):
    """In 2500 s without motion no velocity is checked."""
    run, rest = felt(-1.0, 1.0, 1.0), 2500.0

    def rested(record):
        time = np.arange(0.0, rest, 0.2)
        still = record.values[0] + rng.normal(scale=record.standard_deviation, size=(time.size, record.values.shape[1]))
        return replace(record, time=np.append(time, rest + record.time), values=np.vstack([still, record.values]))

    still = np.zeros((1, run.inputs.values.shape[1]))
    inputs = InputRecord(np.append(0.0, rest + run.inputs.time), np.vstack([still, run.inputs.values]))
    late = replace(run, inputs=inputs, sensors={name: rested(record) for name, record in run.sensors.items()})
    (said,) = contradiction_sentences(contradictions_of_unused(late))
    assert said.startswith("The unused accelerometer contradicts the DVL")
