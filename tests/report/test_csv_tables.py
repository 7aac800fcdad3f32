import csv

import numpy as np

from auvid_cli.data.checks import csv_text
from auvid_cli.report.text_tables import write_csv_tables

COLUMNS = {
    "coefficients": "filter,coefficient,unit,true,estimate,standard_deviation,rmse,steady_state_error_percent,"
    "cramer_rao_bound,times_bound,identified,bound_with_process_noise,corrected_standard_deviation"
    ",total_standard_deviation,contributors",
    "summary": "filter,average_steady_state_error_percent,mean_relative_rmse,median_relative_rmse,mean_nis,cpu_time_s,"
    "steps,microseconds_per_step,status,grade,reason,remedy,doubted",
    "velocity_error": "filter,component,unit,mean_absolute_error",
    "consistency": "filter,sensor,measurements,rejected,mean_weight,mean_nis,expected_low,expected_high",
    "sensor_errors": "filter,state,segment,sensor,unit,estimate,standard_deviation,prior_standard_deviation,observed",
    "faults": "filter,fault,unit,size,standard_deviation,coefficient,susceptibility,tolerance,"
    "significance,rank,alternatives,moved,z",
}


def read(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_columns_are_exactly_those_promised(tmp_path, evaluation):
    paths = write_csv_tables(evaluation.tables(), tmp_path / "tables")
    assert [path.stem for path in paths] == list(COLUMNS)
    for path in paths:
        assert path.read_text(encoding="utf-8").splitlines()[0] == COLUMNS[path.stem]


def test_every_row_is_there_with_all_its_digits(tmp_path, evaluation):
    path = write_csv_tables(evaluation.tables(), tmp_path)[0]
    rows = read(path)
    assert len(rows) == len(evaluation.coefficients) == 66
    for text, row in zip(rows, evaluation.coefficients, strict=True):
        assert text["coefficient"] == row.coefficient
        assert float(text["estimate"]) == row.estimate
        assert float(text["rmse"]) == row.rmse


def test_what_is_not_known_is_an_empty_cell(tmp_path, evaluation):
    rows = [row._replace(true=None, rmse=None, steady_state_error_percent=None) for row in evaluation.coefficients]
    path = write_csv_tables(evaluation._replace(coefficients=rows).tables(), tmp_path)[0]
    assert all(row["true"] == row["rmse"] == row["steady_state_error_percent"] == "" for row in read(path))


def test_a_status_with_commas_stays_one_cell(tmp_path, evaluation):
    status = "diverged at t = 1.000 s: this, that"
    changed = evaluation._replace(summary=[row._replace(status=status) for row in evaluation.summary])
    assert {row["status"] for row in read(write_csv_tables(changed.tables(), tmp_path)[1])} == {status}


def test_what_is_no_number_is_an_empty_cell():
    assert csv_text(("a", "b", "c"), [(float("nan"), np.float64("nan"), float("inf"))]) == "a,b,c\n,,inf\n"
