from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from auvid_cli.data.checks import Check
from auvid_cli.evaluation.accuracy import SensorErrorResult
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.evaluation.results import CoefficientBound, Identifiability
from auvid_cli.report.screen import print_checks, print_files, print_identifiability, print_summary
from auvid_cli.report.text_tables import printed as printed_number


def printed(evaluation, width):
    text = StringIO()
    print_summary(Console(file=text, width=width), evaluation)
    return text.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("width", [60, 80, 100, 140])
def test_nothing_is_cut_off(evaluation, width):
    text = printed(evaluation, width)
    assert max(len(line) for line in text.splitlines()) <= width
    assert "…" not in text.partition("filter")[0]
    for row in evaluation.coefficients:
        assert row.coefficient in text


def test_table_iv_at_100_columns_has_the_paper_next_to_each_filter(evaluation):
    lines = [line.split() for line in printed(evaluation, 100).splitlines() if line.startswith(" X_u|u|")]
    rmse, error, estimates = lines
    assert rmse[-6:] == ["0.878", "0.0201", "0.868", "0.0186", "0.868", "0.01235"]
    assert error[-6:] == ["2.00", "0.3692", "1.00", "0.0408", "0.500", "0.0324"]
    assert " ".join(estimates[-9:]) == "10.20 ± 0.25 10.10 ± 0.25 10.05 ± 0.25"


def test_averages_stand_below_table_iv(evaluation):
    text = printed(evaluation, 80)
    for heading in ("rel. mean", "rel. median", "average", "below paper"):
        assert f" {heading} " in text
    assert "RMSE / |true value|" in " ".join(text.split())


@pytest.mark.slow
def test_a_narrow_terminal_drops_columns_and_names_them(evaluation):
    assert "left out at 60 columns (widen the terminal): unit, true, paper" in " ".join(printed(evaluation, 60).split())
    assert "left out" not in printed(evaluation, 100)


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_estimates_have_total_deviations_at_any_width(evaluation, width):
    rows = [row._replace(total_standard_deviation=0.75, contributors="Iyy 5 %") for row in evaluation.coefficients]
    text = printed(evaluation._replace(coefficients=rows), width)
    assert text.count("± total") >= (1 if width > 60 else 3)
    assert text.count("± 0.75") == len(rows)


def of_ckf(evaluation, causes):
    """The results of the CKF alone, with causes of its total standard deviations."""
    rows = [
        row._replace(total_standard_deviation=0.75, contributors=causes)
        for row in evaluation.coefficients
        if row.filter == "ckf"
    ]
    return evaluation._replace(coefficients=rows, summary=[row for row in evaluation.summary if row.filter == "ckf"])


def test_a_narrow_terminal_drops_the_widest_column_of_one_estimate(evaluation):
    causes = "rudder reacting to disturbances 5 %, elevator reacting to disturbances 4 %"
    text = printed(of_ckf(evaluation, causes), 80)
    assert "left out at 80 columns (widen the terminal): mostly from" in " ".join(text.split())
    assert "± data" in text


@pytest.mark.parametrize(("width", "missing"), [(120, []), (90, ["second cause"]), (68, ["second cause", "± data"])])
def test_a_narrow_terminal_drops_the_unit_of_one_estimate_last(evaluation, width, missing):
    causes = "scale of the elevator 2 %; scale of the DVL in roll 0.38 %"
    text = " ".join(printed(of_ckf(evaluation, causes), width).split())
    left_out = f"left out at {width} columns (widen the terminal): {', '.join(missing)}"
    assert (left_out in text) if missing else ("left out" not in text)
    assert ("scale of the DVL" in text) is not bool(missing)
    assert "symbol unit CKF ± total" in text


@pytest.mark.parametrize(("width", "has_all"), [(120, True), (50, False)])
def test_estimated_errors_are_printed_with_those_of_the_last_filter_at_least(evaluation, width, has_all):
    names = [row.filter for row in evaluation.summary]
    rows = [SensorErrorResult(name, "rudder_trim", None, "", "rad", 0.0175, 2e-5, 0.05, True) for name in names]
    text = printed(evaluation._replace(sensor_errors=rows), width)
    assert text.count("0.01750 ± 2.0e-05") == (len(names) if has_all else 1)


def test_what_an_error_is_of_is_said_where_there_is_one(evaluation):
    explained = "Steady-state error: distance of the mean over the last tenth of the run from the true value."
    assert explained in printed(evaluation, 200)
    rows = [row._replace(true=None, rmse=None, steady_state_error_percent=None) for row in evaluation.coefficients]
    assert explained not in printed(evaluation._replace(coefficients=rows), 200)


def verdict(name, check, passed, advice=""):
    return Check.of(name, "dvl", check, statistic="1", threshold="2", passed=passed, advice=advice)


def checks_printed(checks, passed):
    text = StringIO()
    print_checks(Console(file=text, width=100), checks, passed)
    return text.getvalue()


def test_checks_that_passed_are_counted_and_listed_only_if_asked_for():
    checks = [
        verdict("ckf", "gap", True),
        verdict("ckf", "NIS", False, "Mend it."),
        verdict("ckf", "noise", None, "So."),
    ]
    short, long = (checks_printed(checks, passed) for passed in (False, True))
    assert short.splitlines()[0] == "CKF: 1 of 3 passed, 1 failed, 1 noted"
    assert ("gap" in short, "gap" in long) == (False, True)
    assert all("dvl (NIS): Mend it." in text and "dvl (noise): So." in text for text in (short, long))


def test_advice_that_is_the_same_for_several_filters_stands_there_once():
    checks = [verdict(name, "NIS", False, "Mend it.") for name in ("ckf", "tukf")]
    text = checks_printed([*checks, verdict("ckf", "gap", None, "Look."), verdict("tukf", "gap", True)], passed=False)
    assert text.count("dvl (NIS): Mend it.") == 1
    # Of each a row, with whose it is.
    assert text.count("FAIL") == 1
    assert [line.split()[:4] for line in text.splitlines() if line.startswith(" note")] == [
        ["note", "CKF", "dvl", "gap"]
    ]
    assert "dvl (gap), CKF: Look." in text


def test_all_verdicts_of_every_filter_are_printed_if_asked_for():
    checks = [verdict(name, "NIS", False, "Mend it.") for name in ("ckf", "tukf")]
    assert checks_printed(checks, passed=True).count("FAIL") == 2


def test_nis_is_explained_below_its_table(evaluation):
    assert "1 is right" in " ".join(printed(evaluation, 80).split())


def test_without_truth_estimates_and_deviations_only(evaluation):
    rows = [row._replace(true=None, rmse=None, steady_state_error_percent=None) for row in evaluation.coefficients]
    summary = [row._replace(average_steady_state_error_percent=None) for row in evaluation.summary]
    text = printed(evaluation._replace(coefficients=rows, summary=summary), 80)
    headings = text.strip().splitlines()[0]
    assert "true" not in headings
    assert "error" not in headings
    assert "10.20 ± 0.25" in text


def test_the_reason_of_a_divergence_is_printed(evaluation):
    reason = "at t = 0.200 s: [odd] reason"
    rows = [row._replace(judgement=Judgement(Grade.DIVERGED, reason)) for row in evaluation.summary]
    assert f"EKF, CKF, TUKF diverged: {reason}." in printed(evaluation._replace(summary=rows), 100)


def test_files_are_counted_by_folder():
    text = StringIO()
    print_files(Console(file=text, width=100), [Path("results/a[b]/x.csv"), Path("results/a[b]/y.csv"), Path("c/d")])
    assert text.getvalue().splitlines() == [f"2 files in {Path('results/a[b]')}", "1 file in c"]


def test_an_inconsistent_filter_is_named_so(evaluation):
    judged = Judgement(Grade.INCONSISTENT, "innovations of dvl are 9 times as large as the filter says")
    changed = evaluation._replace(summary=[row._replace(judgement=judged) for row in evaluation.summary])
    text = printed(changed, 100)
    assert text.count("inconsistent:") == 1
    # In the table, and in the sentence below it.
    assert text.count("inconsistent") == 3 + 1


def test_what_differs_is_said_of_each_filter_by_itself(evaluation):
    ekf, ckf, tukf = evaluation.summary
    rows = [ekf._replace(judgement=Judgement(Grade.DOUBTFUL, "it is far off", "use another")), ckf]
    rows.append(tukf._replace(judgement=Judgement(Grade.UNJUDGED, "nobody did")))
    text = printed(evaluation._replace(summary=rows), 100)
    assert "EKF doubtful: it is far off; use another." in text
    assert "TUKF unjudged: nobody did." in text
    assert "CKF sound" not in text


def test_each_sensor_stands_beside_what_chance_makes_of_its_innovations(evaluation):
    lines = printed(evaluation, 100).splitlines()
    for row in evaluation.consistency:
        (line,) = (line for line in lines if line.startswith(f" {row.sensor} ") and " to " in line)
        assert f"{row.expected_low:.3f} to {row.expected_high:.3f}" in line
        assert printed_number(row.mean_nis, 3) in line


def test_an_ascii_terminal_gets_ascii(tmp_path, evaluation):
    with (tmp_path / "out").open("w", encoding="ascii") as file:
        print_summary(Console(file=file, width=100), evaluation)
    assert "+- sd" in (tmp_path / "out").read_text(encoding="ascii")


def test_bounds_are_explained_below_their_table():
    names = ["X_u|u|", "Y_v|v|"]
    bounds = [CoefficientBound(s, "kg/m", 1.0, 0.01, 1.0, 1.2, "within 5 %", "dvl", 0.75, "") for s in names]
    found = Identifiability(bounds, [], {}, np.eye(2), [(duration, np.ones(2)) for duration in (1.0, 8.0)], {})
    text = StringIO()
    print_identifiability(Console(file=text, width=80), found)
    words = " ".join(text.getvalue().split())
    assert "Bound: smallest standard deviation" in words
    assert "Mostly from: the sensor" in words
