"""Runs of which no input changes: what they tell, and that they are not refused for what they do not."""

import numpy as np
import pytest

from auvid_cli.inspection.inspect import inspect_dataset

RUN = "manoeuvre={{type: recorded, duration: 60 s, speed: 2 m/s, initial_speed: 2 m/s, file: {}, input_rate: 10 Hz}}"


@pytest.fixture(scope="module")
def verdicts_of(simulated_with, tmp_path_factory):
    """Function: the verdicts on a run at 2 m/s with constant rudder, rad, and thrust, N."""
    made = {}

    def run(rudder, thrust, *changes):
        file = tmp_path_factory.mktemp("inputs") / "constant.csv"
        rows = [[time, rudder, 0.0, thrust, 0.0] for time in (0.0, 60.0)]
        header = "time,rudder,elevator,surge_force,roll_moment"
        np.savetxt(file, rows, delimiter=",", header=header, comments="")
        if (rudder, thrust) not in made:
            checks = inspect_dataset(simulated_with(RUN.format(file), *changes).without_truth()).checks
            made[rudder, thrust] = {(check.subject, check.check): check for check in checks}
        return made[rudder, thrust]

    return run


@pytest.mark.slow
@pytest.mark.parametrize(("rudder", "thrust"), [(0.0, 0.0), (0.1, 10.0)], ids=["coast-down", "steady turn"])
def test_constant_inputs_do_not_fail(rudder, thrust, verdicts_of):
    """The compass changes by noise alone."""
    verdicts = verdicts_of(rudder, thrust)
    assert [check for check in verdicts.values() if check.passed is False] == []
    assert "is noise of heading" in verdicts["gyroscope", "r against heading"].statistic


def test_coast_down_shows_drag(verdicts_of):
    assert verdicts_of(0.0, 0.0)["surge_force", "thrust"].passed
    advice = verdicts_of(0.0, 0.0)["surge_force", "excitation"].advice
    assert "X_u|u| only from the free change of u" in advice
    assert "may not determine K_p|p|" in verdicts_of(0.0, 0.0)["roll_moment", "excitation"].advice


def test_steady_turn_shows_balanced_coefficients(verdicts_of):
    assert "Y_uudr, N_uudr only from the steady motion" in verdicts_of(0.1, 10.0)["rudder", "excitation"].advice
    assert "may not determine Z_uude, M_uude" in verdicts_of(0.1, 10.0)["elevator", "excitation"].advice
