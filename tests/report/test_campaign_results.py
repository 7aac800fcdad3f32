"""Tables, sentences and figures of a campaign say what its statistics say."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.summary import summarize
from auvid_cli.report.campaign_results import comparison_sentences, print_summary, write_summary
from auvid_cli.report.figures.coefficients import map_figure, spread_figure

SEEDS = 20
FILTERS = {"ckf": "ckf", "wide": "ckf", "ekf": "ekf"}
COLUMNS = ["rate", "identification.prior.factor"]


def rows_of(name, factor, rate, error, lost):
    rows = []
    for seed in range(SEEDS):
        run = f"{name}-{factor}-{rate}-{seed}"
        judged = ("diverged at t = 1 s: why", "diverged", "why") if seed < lost else ("completed", "sound", "")
        known = None if seed < lost else error * (1.0 + 0.01 * seed)
        of_run = Measure(run, name, seed, "run", "", "", *judged, steady_state_error_percent=known, components=1)
        coefficient = Measure(run, name, seed, "coefficient", "X_u|u|", "kg/m", *judged, true=-2.0)._replace(
            estimate=-2.1, standard_deviation=0.1, cramer_rao_bound=0.05, times_bound=2.0, rmse=known
        )
        rows += [of_run._replace(squares=None if seed < lost else 1.0), coefficient]
    return pd.DataFrame(rows).assign(rate=rate, **{"identification.prior.factor": factor})


@pytest.fixture(scope="module")
def summary():
    parts = [
        rows_of(name, factor, rate, error, lost if factor > 1.0 else 0)
        for rate in ("slow", "fast")
        for factor in (1.0, 10.0)
        for name, error, lost in (("ckf", 1.0, 0), ("wide", 1.0, 0), ("ekf", 2.0, 10))
    ]
    return summarize(pd.concat(parts, ignore_index=True), COLUMNS)


@pytest.mark.slow
def test_files_hold_every_combination(summary, tmp_path):
    paths = write_summary(summary, tmp_path)
    tables = {f"{name}.csv" for name in ("runs", "filters", "coefficients", "comparisons")}
    assert {path.name for path in paths} == tables | {"campaign.md"}
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "filters.csv"), summary.filters, check_dtype=False)
    text = (tmp_path / "campaign.md").read_text()
    assert "| fast | 10 | ekf | 20 | 0 | 50.00 |" in text
    # Two rates, two factors, three pairs, two measures, and twelve filters.
    assert sum(line.startswith(("| slow", "| fast")) for line in text.splitlines()) == 12 + 24


@pytest.mark.slow
def test_sentences_count_the_combinations(summary):
    sentences = comparison_sentences(summary)
    assert "ckf and wide, steady-state error: tie in 4 (of 4 settings)" in sentences
    lost = "ckf is better in 2, ekf diverges more often in 2 (of 4 settings)"
    assert f"ckf and ekf, steady-state error: {lost}" in sentences


@pytest.mark.slow
@pytest.mark.parametrize("width", [40, 80, 200])
def test_the_screen_shows_what_it_has_room_for(summary, width):
    screen = io.StringIO()
    print_summary(Console(file=screen, width=width, highlight=False), summary, [])
    text = screen.getvalue()
    assert "ckf and wide" in text.replace("\n", " ")
    if width >= 80:
        assert max(map(len, text.splitlines())) <= width
        assert text.count("ekf") >= 4


def test_screen_explains_only_columns_that_it_shows(summary):
    texts = {}
    for width in (80, 300):
        screen = io.StringIO()
        print_summary(Console(file=screen, width=width, highlight=False), summary, [])
        texts[width] = screen.getvalue()
    assert "Inconsistent: share" in texts[80]
    assert "Inconsistent: share" in texts[300]
    assert "By chance: range" in texts[300]
    assert "By chance: range" not in texts[80]


def test_boxes_are_drawn_for_every_combination_and_losses_are_written(summary):
    figure = spread_figure(summary.runs, COLUMNS, FILTERS)
    assert [axes.get_title() for axes in figure.axes] == ["rate slow", "rate fast"]
    for axes in figure.axes:
        assert len(axes.patches) == 6
        assert [text.get_text() for text in axes.texts] == ["50%"]
        medians = [line.get_ydata()[0] for line in axes.lines if line.get_color() == "white"]
        assert np.isclose(sorted(medians)[0], 1.0 + 0.01 * (SEEDS - 1) / 2)


def test_the_map_writes_error_and_losses_into_each_cell(summary):
    figure = map_figure(summary.filters, COLUMNS, FILTERS)
    panels = {axes.get_title(): [text.get_text() for text in axes.texts] for axes in figure.axes if axes.get_title()}
    assert list(panels) == list(FILTERS)
    assert panels["ckf"] == ["1.1"] * 4
    assert [text.splitlines()[1:] for text in panels["ekf"]] == [[], ["50% lost"], [], ["50% lost"]]


def test_one_axis_or_none_has_boxes_too():
    rows = rows_of("ckf", 1.0, "slow", 1.0, 0)
    for columns in ([], ["rate"]):
        figure = spread_figure(summarize(rows, columns).runs, columns, {"ckf": "ckf"})
        (axes,) = figure.axes
        assert len(axes.patches) == 1


def test_runs_too_few_for_quartiles_are_drawn_one_by_one():
    rows = rows_of("ckf", 1.0, "slow", 1.0, 0)
    runs = summarize(rows[rows["seed"] == 1], []).runs
    figure = spread_figure(runs, [], {"ckf": "ckf"})
    (axes,) = figure.axes
    assert [list(line.get_ydata()) for line in axes.lines] == [[pytest.approx(1.01)]]
    low, high = axes.get_ylim()
    assert high / low >= 3.9, "a difference of nothing does not fill the axis"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["ckf", "a mark for each run"]


def test_a_campaign_of_which_all_runs_were_lost_is_told_as_well(tmp_path):
    rows = pd.concat([rows_of(name, 1.0, "slow", 1.0, SEEDS) for name in ("ckf", "ekf")], ignore_index=True)
    summary = summarize(rows, ["rate", "identification.prior.factor"])
    write_summary(summary, tmp_path)
    assert set(summary.filters["diverged"]) == {1.0}
    assert set(summary.comparisons["conclusion"]) == {"no difference found"}
    spread_figure(summary.runs, summary.columns, {"ckf": "ckf", "ekf": "ekf"})
    map_figure(summary.filters, summary.columns, {"ckf": "ckf", "ekf": "ekf"})
