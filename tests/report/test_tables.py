import re

import pytest

from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.report.layout import estimates, lay_out, write_tables
from auvid_cli.report.table import Unidentified, UnitCell, number, symbol_math, unit_latex, unit_text
from auvid_cli.report.table_iv import published, published_filters, table_iv
from auvid_cli.report.text_tables import escape_latex, render_latex, render_markdown
from auvid_cli.vehicle.coefficients import COEFFICIENTS, SYMBOLS


def markdown_rows(text, begin):
    """Cells of the lines that begin with a cell."""
    lines = [line for line in text.splitlines() if line.startswith(f"| {begin} |")]
    return [[cell.strip().replace(r"\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (12.3996, "12.40"),
        (9.99996, "10.00"),
        (-0.012354, "-0.01235"),
        (554.21, "554.2"),
        (12345.6, "12350"),
        (1.23456e-7, "1.235e-07"),
        (31800, "31800"),
        (float("nan"), None),
        (float("inf"), None),
    ],
)
def test_numbers_have_four_significant_digits(value, text):
    assert number(value) == text


def test_symbols_and_units_in_print():
    assert symbol_math("X_u|u|") == "$X_{u|u|}$"
    assert symbol_math("Y_url") == "$Y_{url}$"
    assert symbol_math("M_uude") == r"$M_{uu\delta_e}$"
    assert symbol_math("psi") == symbol_math("heading") == r"$\psi$"
    assert symbol_math("fx") == "$f_{x}$"
    assert unit_text("kg*m^2/rad^2") == "kg·m²/rad²"
    assert unit_latex("kg*m^2/rad^2") == r"kg\,m$^{2}$/rad$^{2}$"


def test_table_iv_has_the_published_values_next_to_ours(evaluation):
    text = render_markdown(lay_out(evaluation))
    rmse, error = markdown_rows(text, r"X_u\|u\|")[:2]
    ours = [row for row in evaluation.coefficients if row.coefficient == "X_u|u|"]
    assert rmse[:3] == error[:3] == ["X_u|u|", "kg/m", "10.00"]
    assert rmse[3::2] == [number(row.rmse) for row in ours]
    assert rmse[4::2] == ["0.0201", "0.0186", "0.01235"]
    assert error[3::2] == [number(row.steady_state_error_percent) for row in ours] == ["2.000", "1.000", "0.5000"]
    assert error[4::2] == ["0.3692", "0.0408", "0.0324"]
    assert markdown_rows(text, "average")[0][3:] == ["2.000", "6.064", "1.000", "1.815", "0.5000", "0.7672"]
    assert markdown_rows(text, "CPU time")[0][3:] == ["0.1250", "3.543", "0.1250", "75.897", "0.1250", "77.328"]
    assert markdown_rows(text, "u")[0][5:] == ["0.174", "0.142", "0.1379"]
    assert "10.20 ± 0.25" in text
    assert "not published" in text


def test_table_iv_averages_are_those_of_its_rows(evaluation):
    """Relative RMSE over the coefficients, and the number of rows below the paper's, recomputed from the CSV file."""
    table = table_iv(evaluation)["table_iv"].to_pandas().set_index("coefficient")
    own = table.iloc[: len({row.coefficient for row in evaluation.coefficients})]
    for name in ("ekf", "ckf", "tukf"):
        relative = own[f"rmse_{name}"].astype(float) / own["true"].astype(float).abs()
        summary = next(row for row in evaluation.summary if row.filter == name)
        assert table.loc["rel. mean", f"rmse_{name}"] == pytest.approx(relative.mean())
        assert summary.mean_relative_rmse == pytest.approx(relative.mean())
        assert table.loc["rel. median", f"rmse_{name}"] == pytest.approx(relative.median())
        for half in ("rmse", "steady_state_error_percent"):
            pair = own[[f"{half}_{name}", f"{half}_{name}_paper"]].astype(float).dropna()
            below = int((pair.iloc[:, 0] < pair.iloc[:, 1]).sum())
            assert f"{below} of {len(pair)}" in set(table.loc["below paper", f"{half}_{name}"])


def test_table_iv_exists_in_latex_with_the_paper(evaluation):
    latex = render_latex(lay_out(evaluation))
    assert r"\label{tab:rmse}" in latex
    assert "0.01235" in latex


def test_markdown_tables_are_rectangular(evaluation):
    for block in re.findall(r"(?:^\|.*\n)+", render_markdown(lay_out(evaluation)), re.MULTILINE):
        widths = {len(re.split(r"(?<!\\)\|", line)) for line in block.splitlines()}
        assert len(widths) == 1


def test_a_column_of_units_is_called_so(evaluation):
    named = {
        column.header
        for table in lay_out(evaluation)
        for row in table.rows
        for column, cell in zip(table.columns, row, strict=True)
        if isinstance(cell, UnitCell)
    }
    assert {name.capitalize() for name in named} == {"Unit"}


def test_unidentified_coefficient_is_marked_and_mark_explained(evaluation):
    """The data say nothing of N_uudr; of the others the standard deviation is 0.25, a fraction of the value."""
    markdown = render_markdown(lay_out(evaluation))
    assert all(cell.endswith(" †") for half in (0, 1) for cell in markdown_rows(markdown, "N_uudr")[half][3::2])
    assert markdown_rows(markdown, "N_uudr")[2][2:] == ["31.62 ± 0.25 †", "31.31 ± 0.25 †", "31.15 ± 0.25 †"]
    assert markdown_rows(markdown, "N_uudr")[3][2:] == ["—"] * 4
    assert "†" not in "".join(markdown_rows(markdown, "Y_url")[2])
    assert markdown_rows(markdown, "Y_url")[3][2:] == ["0.2000", "1.250", "1.250", "1.250"]
    assert markdown.count("† do not rely on it") == 3
    latex = render_latex(lay_out(evaluation))
    assert r"$31.62$ $\pm$ $0.25$\,$\dagger$" in latex
    identified = evaluation._replace(coefficients=[row._replace(identified=True) for row in evaluation.coefficients])
    assert "†" not in render_markdown(lay_out(identified))


def test_each_filter_has_its_own_bound_where_there_is_no_truth(evaluation):
    rows = [row._replace(cramer_rao_bound=0.4) if row.filter == "ckf" else row for row in evaluation.coefficients]
    changed = evaluation._replace(coefficients=rows, remarks=["no Cramer-Rao bound: why"])
    markdown = render_markdown(lay_out(changed))
    assert markdown_rows(markdown, "Y_url")[3][2:5] == ["0.2000", "0.4000", "0.2000"]
    assert "No Cramer-Rao bound: why." in markdown


def test_no_filter_is_marked_as_the_best(evaluation):
    assert "**" not in render_markdown(lay_out(evaluation))
    assert r"\textbf" not in render_latex(lay_out(evaluation))


def test_only_filters_that_ran_stand_beside_the_paper(evaluation):
    ukf = evaluation._replace(
        coefficients=[row._replace(filter="ukf") for row in evaluation.coefficients if row.filter == "ekf"],
        summary=[evaluation.summary[0]._replace(filter="ukf")],
        velocity_errors=[row._replace(filter="ukf") for row in evaluation.velocity_errors if row.filter == "ekf"],
        consistency=[],
    )
    text = render_markdown(lay_out(ukf))
    assert "paper" not in text
    assert "| true | UKF |" in text.lower().replace("ukf", "UKF")


def test_latex_balances_and_is_rectangular(evaluation):
    text = render_latex(lay_out(evaluation))
    assert "0.7672" in text
    unescaped = re.sub(r"\\[{}$&%_#]", "", text)
    assert unescaped.count("{") == unescaped.count("}")
    assert unescaped.count("$") % 2 == 0
    begun, ended = re.findall(r"\\begin\{(\w+)\}", text), re.findall(r"\\end\{(\w+)\}", text)
    assert sorted(begun) == sorted(ended)
    for tabular in re.findall(r"\\begin\{tabular\}\{([lr]+)\}(.*?)\\end\{tabular\}", text, re.DOTALL):
        alignment, body = tabular
        for line in (line for line in body.splitlines() if line.endswith(r"\\")):
            spans = [int(width) for width in re.findall(r"\\multicolumn\{(\d+)\}", line)]
            assert line.count("&") + 1 + sum(spans) - len(spans) == len(alignment)
    assert "$X_{u|u|}$ & kg/m & $10.00$" in text
    assert text.isascii()


def test_latex_escapes_what_it_must():
    assert escape_latex("50 % of a_b & c#") == r"50 \% of a\_b \& c\#"
    assert escape_latex("\\") == r"\textbackslash{}"


def test_a_diverged_filter_is_said_to_be_and_has_dashes(evaluation):
    judged = Judgement(Grade.DIVERGED, "at t = 0.200 s: not finite")
    first = evaluation.summary[0]
    changed = evaluation._replace(
        summary=[first._replace(judgement=judged, average_steady_state_error_percent=None), *evaluation.summary[1:]],
        coefficients=[
            row._replace(rmse=None, steady_state_error_percent=None, estimate=float("nan"))
            if row.filter == "ekf"
            else row
            for row in evaluation.coefficients
        ],
    )
    markdown = render_markdown(lay_out(changed))
    assert "EKF diverged: at t = 0.200 s: not finite." in markdown
    assert markdown_rows(markdown, "Y_url")[0][3] == "—"
    assert "— ± 0.25" in markdown
    assert "EKF diverged: at t = 0.200 s: not finite." in render_latex(lay_out(changed))


def test_without_truth_there_is_no_table_of_accuracy(evaluation):
    rows = [row._replace(true=None, rmse=None, steady_state_error_percent=None) for row in evaluation.coefficients]
    text = render_markdown(lay_out(evaluation._replace(coefficients=rows)))
    assert "RMSE" not in text
    assert "EKF ± sd" in text


def test_published_tables_are_complete():
    assert [symbol for symbol in published("table_iv") if symbol in SYMBOLS] == [c.symbol for c in COEFFICIENTS]
    assert all(len(published("table_iv")[symbol]) == 6 for symbol in SYMBOLS)
    assert list(published("table_v")) == list("uvwpqr")
    assert published_filters("table_iv", "rmse", ["ukf", "tukf", "ekf"]) == ["tukf", "ekf"]


def test_files_are_written(tmp_path, evaluation):
    paths = write_tables(evaluation, tmp_path)
    assert {path.name for path in paths} == {path.name for path in tmp_path.iterdir()}
    assert {"tables.md", "tables.tex"} <= {path.name for path in paths}


def test_total_deviation_stands_with_that_of_the_data_and_its_causes(evaluation):
    rows = [
        row._replace(
            corrected_standard_deviation=1.5 * row.standard_deviation,
            total_standard_deviation=4.0 * row.standard_deviation,
            contributors="Iyy 5 %; M_qdot 2 %",
        )
        for row in evaluation.coefficients
        if row.filter == "ckf"
    ]
    table = estimates(evaluation._replace(coefficients=rows), ["ckf"])
    assert [column.header for column in table.columns[2:]] == ["CKF ± total", "± data", "mostly from"]
    for cells, row in zip(table.rows, rows, strict=True):
        shown = cells[2].cell if isinstance(cells[2], Unidentified) else cells[2]
        assert shown.deviation == 4.0 * row.standard_deviation
        assert cells[3:] == [number(1.5 * row.standard_deviation, 2), "Iyy 5 %, M_qdot 2 %"]
    without = estimates(evaluation, ["ckf"])
    assert [column.header for column in without.columns[2:]] == ["CKF ± sd"]
