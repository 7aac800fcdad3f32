"""An accelerometer that no estimator uses, against the DVL."""

import pytest

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
