"""Two results side by side, and the exit code that says whether they differ."""

import pytest

from .conftest import assert_one_clear_complaint, auvid

TABLE = "filter,coefficient,unit,true,estimate,standard_deviation,cpu_time_s\n"


@pytest.fixture
def folders(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for place, estimate in (("mine/tables", -5.0), ("reference/mine", -5.5)):
        (tmp_path / place).mkdir(parents=True)
        rows = "".join(f"ckf,c{i},kg/m,-5,{estimate},0.1,{estimate}\n" for i in range(25))
        (tmp_path / place / "coefficients.csv").write_text(TABLE + rows)
    return tmp_path


def test_the_same_results_agree(folders):
    result = auvid("compare", "mine", "mine", cwd=folders)
    assert (result.exit_code, result.stdout.splitlines()[-1]) == (0, "the results agree")


def test_different_results_are_listed_with_exit_code_1(folders):
    result = auvid("compare", "mine", "reference", cwd=folders)
    assert result.exit_code == 1
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["coefficients", "ckf", "c0", "estimate", "-5", "-5.5", "0.50", "0.0010"] in [
        [cell.removesuffix(".00000").removesuffix("0000") for cell in line] for line in lines
    ]
    assert "and 5 more that differ" in result.stdout
    assert "coefficients.csv: 75 of 100 values agree; values that differ: estimate 25" in result.stdout
    assert result.stdout.splitlines()[-1] == "25 of 100 values differ"


@pytest.mark.parametrize("options", [("-r", "0.1"), ("--relative", "estimate=0.1"), ("--deviations", "5")])
def test_wider_tolerances_make_results_agree(options, folders):
    assert auvid("compare", "mine", "reference", *options, cwd=folders).exit_code == 0


@pytest.mark.slow
def test_verbose_shows_all_values(folders):
    result = auvid("compare", "mine", "reference", "-v", cwd=folders)
    assert result.stdout.count("DIFFERS") == 25
    assert "standard_deviation" in result.stdout


@pytest.mark.parametrize("wrong", ["x", "rmse=", "=1", "rmse=-1", "nan", "-1"])
def test_invalid_share_is_one_error(wrong, folders):
    result = auvid("compare", "mine", "reference", f"--relative={wrong}", cwd=folders)
    assert_one_clear_complaint(result, f"--relative {wrong}: expected a share")


def test_folder_without_tables_is_one_error(folders):
    assert_one_clear_complaint(auvid("compare", "mine", "nowhere", cwd=folders), "nowhere: no such folder")
