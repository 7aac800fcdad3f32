"""Tables, screen and figure of a validation."""

import csv
from io import StringIO

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from rich.console import Console

from auvid_cli.data.checks import Check, Checks
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.report.figures.validation import horizon_figure
from auvid_cli.report.screen import print_validation
from auvid_cli.report.text_tables import write_csv_tables
from auvid_cli.validation.results import (
    AHEAD,
    FREE_RUN,
    LEGS,
    TURNS,
    UNCERTAINTY_NOT_TOO_LARGE,
    ManoeuvreNumber,
    Prediction,
    Score,
    Validation,
    verdict_on,
)
from auvid_cli.vehicle.parameters import MOTION

HORIZONS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


def prediction(quantity, kind=AHEAD, horizon=120.0, share=0.9):
    band = (0.025, share, 50, 1) if kind == AHEAD else ()
    return Prediction(quantity.symbol, quantity.unit, kind, horizon, 60, 0.01, 97.25, 0.02, None, 3.0, 0.4, *band)


@pytest.fixture
def validation(dataset):
    rows = [prediction(quantity, FREE_RUN) for quantity in MOTION]
    rows += [prediction(quantity, horizon=horizon) for horizon in HORIZONS for quantity in MOTION]
    overshoots = [ManoeuvreNumber("zigzag 20", f"overshoot {k}", 10.0 * k, "rad", 0.1, 0.05 * k) for k in (1, 2)]
    turn = ManoeuvreNumber("turning circle 15", "radius", 20.0, "m", 14.25, None)
    check = Check.of(
        "ckf",
        "start",
        "filter completed",
        statistic="diverged at t = 3 s",
        threshold="to the end of the data",
        passed=False,
        advice="Look again.",
    )
    run = FreeRun(np.arange(3.0), np.zeros((3, 9)))
    return Validation(
        "ckf",
        Judgement(Grade.SOUND),
        rows,
        [*overshoots, turn],
        Checks([check]),
        dataset,
        run,
        ["one [thing] is missing"],
    )


def shown(validation, width):
    text = StringIO()
    print_validation(Console(file=text, width=width), validation, passed=False)
    return text.getvalue()


def test_tables_hold_every_row(validation, tmp_path):
    paths = write_csv_tables(validation.tables(), tmp_path)
    assert [path.name for path in paths] == ["validation.csv", "manoeuvres.csv", "validation_checks.csv"]
    tables = [list(csv.DictReader(StringIO(path.read_text(encoding="utf-8")))) for path in paths]
    assert [len(table) for table in tables] == [9 + 63, 3, 1]
    free, ahead = tables[0][0], tables[0][9]
    assert (free["kind"], free["horizon_s"], free["share_within_band"], free["prior_rmse"]) == (
        "free_run",
        "120.0",
        "",
        "",
    )
    assert (ahead["signal"], ahead["horizon_s"], ahead["share_within_band"]) == ("u", "0.5", "0.9")
    assert tables[1][2] == {
        "manoeuvre": "turning circle 15",
        "number": "radius",
        "time_s": "20.0",
        "unit": "m",
        "measured": "14.25",
        "predicted": "",
    }


def test_the_screen_speaks_of_degrees_and_ends_with_the_verdict(validation):
    text = shown(validation, 100)
    line = next(line for line in text.splitlines() if line.startswith(" psi"))
    # 0.01, 0.02, 0.4 and 3 rad.
    assert line.split() == ["psi", "deg", "0.573", "97.2", "1.15", "22.9", "-", "172"]
    assert "zigzag 20, overshoot (mean of 2) in deg: measured 5.730, predicted 4.297" in text
    assert "turning circle 15, radius in m: measured 14.25, predicted -" in text
    assert "One [thing] is missing." in text
    assert text.splitlines()[-1] == "The model of the CKF does not predict these data."
    assert next(line for line in text.splitlines() if line.startswith(" % within")).split()[-7:] == ["90.0"] * 7


def test_errors_next_to_the_vehicle_file_come_first_then_the_judgement(validation):
    # 0.02 and 3 rad/s.
    first = "Yaw rate 20 s ahead: 1.15 deg/s, vehicle file 172: 99 % better."
    assert shown(validation, 100).splitlines()[0] == first
    for grade in (Grade.INCONSISTENT, Grade.DOUBTFUL):
        doubted = validation._replace(judgement=Judgement(grade, "because"))
        assert shown(doubted, 100).splitlines()[2] == f"CKF {grade}: because."


def test_signal_beaten_by_an_unchanged_motion_is_named(validation):
    rows = [row._replace(rmse=0.8) if row.signal == "w" else row for row in validation.predictions]
    text = " ".join(shown(validation._replace(predictions=rows, checks=Checks()), 200).split())
    assert "predicts u, v, p, q, r, phi, theta, psi of these data. Worse than another prediction: w." in text


def test_unstable_signal_leaves_the_others_predicted(validation):
    rows = [
        row._replace(rmse=None, fit_percent=None) if row.signal == "theta" else row for row in validation.predictions
    ]
    unstable = Checks(check._replace(check="stable") for check in validation.checks)
    text = " ".join(shown(validation._replace(predictions=rows, checks=unstable), 200).split())
    assert "predicts u, v, w, p, q, r, phi, psi of these data. Worse than another prediction: theta." in text


def test_equal_errors_are_the_same_and_errors_within_the_noise_decide_nothing():
    score = Score("v", TURNS, 20.0, "m/s", 0.01, 0.1, 0.10004, 0.2)
    assert str(score) == "Sway in turns 20 s ahead: 0.1 m/s, vehicle file 0.1: the same"
    assert str(score._replace(vehicle_file=0.1005)).endswith("less than 1 % better")
    assert str(score._replace(model=0.15, vehicle_file=0.1)).endswith("vehicle file 0.1: 50 % worse")
    assert str(score._replace(model=0.25, vehicle_file=0.1)).endswith("vehicle file 0.1: 2.5 times as large")
    assert str(score._replace(model=4.2, vehicle_file=0.1)).endswith("vehicle file 0.1: 42 times as large")
    assert str(score._replace(vehicle_file=None)).endswith("unchanged motion 0.2: 50 % better")
    assert verdict_on([score]) == "The vehicle file predicts as well."
    assert "not recommended" in verdict_on([score._replace(model=0.2)])
    assert verdict_on([score._replace(model=0.05)]) == ""
    assert score._replace(noise=1.0, model=0.2).gain == 0.0


def test_only_wide_bands_are_told_from_other_failures(validation):
    failed = validation.checks[0]._replace(passed=False)
    wide, unstable = failed._replace(check="uncertainty not too large"), failed._replace(check="stable")
    assert validation._replace(checks=Checks([wide])).has_only_wide_bands
    assert not validation._replace(checks=Checks([wide, unstable])).has_only_wide_bands


def test_turns_are_scored_before_straight_legs(validation):
    rows = [row._replace(kind=kind) for kind in (LEGS, TURNS) for row in validation.predictions if row.kind == AHEAD]
    scores = validation._replace(predictions=[*validation.predictions, *rows]).scores
    assert [(score.kind, score.signal) for score in scores] == [(k, s) for k in (TURNS, LEGS) for s in "rv"]


@pytest.mark.parametrize("width", [60, 80, 120])
def test_nothing_is_cut_off(validation, width):
    text = shown(validation, width)
    assert max(len(line) for line in text.splitlines()) <= width
    assert "…" not in text
    assert ("left out at 60 columns (widen the terminal): vehicle file" in " ".join(text.split())) == (width < 80)


def test_a_model_that_passes_predicts(validation):
    sound = validation._replace(checks=Checks(check._replace(passed=True, advice="") for check in validation.checks))
    assert shown(sound, 80).splitlines()[-1] == "The model of the CKF predicts these data."


@pytest.mark.parametrize("passed", [True, False])
def test_what_is_worse_than_its_mean_is_not_predicted(validation, passed):
    """Of v the free run, of heading predictions over 20 and 50 s."""
    worse = {("v", FREE_RUN, 120.0), ("psi", AHEAD, 20.0), ("psi", AHEAD, 50.0)}
    rows = [
        row._replace(fit_percent=-0.1 if (row.signal, row.kind, row.horizon_s) in worse else row.fit_percent)
        for row in validation.predictions
    ]
    checks = Checks(check._replace(passed=passed) for check in validation.checks)
    text = " ".join(shown(validation._replace(predictions=rows, checks=checks), 200).split())
    assert "predicts these data" not in text
    assert ("predicts u, w, p, q, r, phi, theta of these data." in text) == passed
    assert ("does not predict these data." in text) != passed
    assert text.endswith("Worse than their mean (fit below 0): v in the free run; psi ahead.")


def test_a_model_that_is_worse_than_every_mean_predicts_nothing(validation):
    rows = [row._replace(fit_percent=-5.0) for row in validation.predictions]
    checks = Checks(check._replace(passed=True) for check in validation.checks)
    text = shown(validation._replace(predictions=rows, checks=checks), 200)
    assert "The model of the CKF does not predict these data. Worse" in text


def test_band_is_explained(validation):
    assert "known defects of the model" in shown(validation, 120)
    rows = [row._replace(share_within_band=None) for row in validation.predictions]
    assert "process noise" not in shown(validation._replace(predictions=rows), 120)


@pytest.mark.slow
def test_each_panel_shows_errors_over_the_horizon_with_what_explains_them(validation):
    figure = horizon_figure("ckf", validation.predictions)
    assert len(figure.axes) == 9
    heading = figure.axes[8]
    lines = [np.asarray(line.get_ydata(), dtype=float) for line in heading.lines]
    assert any(np.allclose(line, np.rad2deg(0.02)) for line in lines)
    assert any(np.allclose(line, np.rad2deg(0.4)) for line in lines)
    (band,) = heading.collections
    assert band.get_facecolor()[0] == pytest.approx(to_rgba("0.85"))
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(np.rad2deg(0.025))
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    # Of the prior there is nothing.
    assert labels == ["CKF", "unchanged", "vehicle file", "noise of the sensor", "explained by the stated uncertainty"]


@pytest.mark.slow
def test_what_the_prior_predicts_does_not_set_the_axis(validation):
    heights = []
    for prior in (None, 1e6):
        rows = [row._replace(prior_rmse=prior) for row in validation.predictions]
        axes = horizon_figure("ckf", rows).axes[0]
        heights.append(axes.get_ylim())
    # But for the room that the words take.
    (low, high), (lower, higher) = heights
    assert lower == low
    assert high < higher < 3.0 * high
    assert [text.get_text() for text in axes.texts] == ["prior: above the axis"]


@pytest.mark.slow
def test_a_depth_that_is_predicted_has_a_panel_of_its_own(validation):
    depth = [row._replace(signal="down", unit="m") for row in validation.predictions if row.signal == "u"]
    rows = [*validation.predictions, *depth]
    figure = horizon_figure("ckf", rows)
    assert [axes.get_ylabel() for axes in figure.axes[8:]] == [r"RMSE of $\psi$ (°)", "RMSE of depth (m)"]
    for drawn, surge in zip(figure.axes[9].lines, figure.axes[0].lines, strict=True):
        np.testing.assert_array_equal(drawn.get_ydata(), surge.get_ydata())
    # The axis of horizons stands below the last panel of each column.
    assert [i for i, axes in enumerate(figure.axes) if axes.get_xlabel()] == [7, 8, 9]


@pytest.mark.slow
def test_a_signal_without_measurements_says_so(validation):
    rows = [row for row in validation.predictions if row.signal != "v"]
    axes = horizon_figure("ckf", rows).axes[1]
    assert [text.get_text() for text in axes.texts] == ["no measurements ahead"]


def test_a_model_that_is_better_than_its_bands_still_predicts(validation):
    (failed,) = validation.checks
    too_wide = validation._replace(checks=Checks([failed._replace(check=UNCERTAINTY_NOT_TOO_LARGE)]))
    assert "The model of the CKF predicts these data, with bands too wide." in shown(too_wide, 120)
    both = too_wide._replace(checks=Checks([failed, *too_wide.checks]))
    assert "does not predict these data" in shown(both, 120)


def test_errors_of_reference_models_are_explained(validation):
    words = " ".join(shown(validation, 100).split())
    assert "Unchanged: error if the motion stayed as at the start." in words
    assert "Vehicle file: error of the vehicle as stated" in words
