"""Pages of commands other than `auvid run`."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml

from auvid_cli.campaign.summary import CampaignSummary
from auvid_cli.config.campaign import Campaign
from auvid_cli.data.checks import Checks, NamedRows
from auvid_cli.evaluation.judgement import Grade, Judgement
from auvid_cli.evaluation.results import CoefficientBound, FreeRun, Identifiability
from auvid_cli.inspection.inspection import Inspection, Mark
from auvid_cli.report import campaign_results
from auvid_cli.report.campaign_results import campaign_page
from auvid_cli.report.page.curves import path_parts
from auvid_cli.report.page.pages import identifiability_page, inspection_page, run_page, validation_page
from auvid_cli.report.page.parts import Box, Dot, Listing, Picture, Plots, TextLabel
from auvid_cli.report.page.render import render_page
from auvid_cli.report.page.sections import table_of_rows, what_ran
from auvid_cli.report.table import Symbol, UnitCell
from auvid_cli.validation.results import AHEAD, Prediction, Validation
from auvid_cli.vehicle.parameters import MOTION

from ..conftest import TIME, TRUE, diverged, evaluation_of, make_dataset, make_estimate, motion_at
from .conftest import FEW, check_of
from .test_render import Elements


@pytest.fixture
def known(experiment_with):
    """A dataset made by hand, with the settings of a whole experiment."""
    return replace(make_dataset(), experiment=experiment_with())


def parts_of(page, kind):
    return [part for section in page.sections for part in section.parts if isinstance(part, kind)]


def test_recorded_data_have_a_page_without_a_truth(known):
    recorded = replace(known, truth=None)
    estimates = [
        replace(make_estimate(name, FEW, by), experiment=known.experiment)
        for name, by in (("smoother", 0.0), ("ckf", 0.02))
    ]
    page = run_page(recorded, estimates, evaluation_of(recorded, estimates), [check_of("ckf", True)])
    elements = Elements(render_page(page))
    assert "Distance from the smoother" in elements.texts("h3")
    assert not any("Table IV" in heading for heading in elements.texts("h3"))
    assert "truth not known" in page.subtitle
    assert ", 80 s, " in page.subtitle


def test_page_states_the_part_of_the_data_that_was_used(known, with_settings):
    used = with_settings(known, "identification.use.spans=[[10, 30], [70, null]]")
    assert what_ran(used) == "spiral of 80 s (30 s used)"
    assert what_ran(known, used.experiment.identification.use) == "spiral of 80 s (30 s used)"
    slow = with_settings(known, "identification.use.least_speed=0.5 m/s")
    assert what_ran(slow) == "spiral of 80 s (parts used)"


def test_the_page_of_data_shades_where_something_is_the_matter(known):
    checks = Checks([check_of("", False), check_of("", True)])
    marks = [Mark("dvl", "spike", 10.0, 10.0), Mark("dvl", "gap", 20.0, 25.0)]
    page = inspection_page(known, Inspection(checks, marks, known.inputs, {"dvl": np.ones(3)}, (0.0, 80.0)))
    (plots,) = parts_of(page, Plots)
    assert {plot.title: plot.marks for plot in plots.plots}["dvl: u"] == [(10.0, 10.0), (20.0, 25.0)]
    assert {plot.title: plot.marks for plot in plots.plots}["gyroscope: p"] == ()
    text = render_page(page)
    assert "Fix these first, or leave out bad times with --use BEGIN:END: NIS of dvl." in text
    Elements(text)


def test_the_page_of_bounds_draws_them_by_class_and_names_what_is_lost(known):
    values = {"X_u|u|": 0.5, "Y_v|v|": 10.0, "N_uudr": np.inf}
    labels = dict(zip(values, ("within 1 %", "within 20 %", "not identified"), strict=True))
    bounds = [
        CoefficientBound(name, "kg/m", 1.0, 0.01 * value, value, np.nan, labels[name], "dvl", 0.75, "")
        for name, value in values.items()
    ]
    growth = [(duration, np.array([4.0, 80.0, np.inf]) / duration) for duration in (1.0, 8.0)]
    found = Identifiability(bounds, [], {}, np.eye(3), growth, {})
    page = identifiability_page(known, found, "the true coefficients")
    text = render_page(page)
    assert "These data do not determine N<sub>uuδr</sub>: fix these at known values" in text
    (drawing,) = parts_of(page, Picture)
    bars = [shape for shape in drawing.shapes if isinstance(shape, Box)]
    assert [bar.look for bar in bars] == ["sure", "rough", "lost"]
    # On a logarithmic scale from half a percent to ten is as far as from one to twenty.
    ticks = {s.text: s.x for s in drawing.shapes if isinstance(s, TextLabel) and s.text in ("1 %", "20 %")}
    assert bars[1].width - bars[0].width == pytest.approx(ticks["20 %"] - ticks["1 %"])
    assert "none" in {s.text for s in drawing.shapes if isinstance(s, TextLabel)}
    (plots,) = parts_of(page, Plots)
    assert np.isnan(plots.plots[0].lines[2].values).all()
    Elements(text)


def test_the_page_of_a_validation_draws_each_signal_over_the_horizon(known):
    rows = [
        Prediction(q.symbol, q.unit, AHEAD, horizon, 60, 0.01, 97.25, 0.02 * horizon, None, 3.0, 0.4, 0.025, 0.9, 50, 1)
        for q in MOTION
        for horizon in (1.0, 10.0)
    ]
    found = Validation(
        "ckf",
        Judgement(Grade.SOUND),
        rows,
        [],
        Checks([check_of("ckf", False)]),
        known,
        FreeRun(TIME, motion_at(TIME)),
        ["Something is missing."],
    )
    page = validation_page(found)
    # Of several manoeuvres of one experiment, which one this was.
    assert "spiral of 80 s" in page.subtitle
    horizons, _ = parts_of(page, Plots)
    assert [plot.title for plot in horizons.plots] == [q.symbol for q in MOTION]
    own = horizons.plots[3].lines[-1]
    # The roll rate, in degrees per second.
    assert (own.label, horizons.plots[3].unit) == ("CKF", "°/s")
    np.testing.assert_allclose(own.values, np.rad2deg([0.02, 0.2]))
    assert "prior" not in {line.label for line in horizons.plots[0].lines}
    text = render_page(page)
    assert "Something is missing." in text
    assert "Look at the DVL." in text
    Elements(text)


def test_the_page_of_a_campaign_draws_every_run_that_ended(monkeypatch):
    runs = pd.DataFrame(
        {
            "filter": ["ckf"] * 3 + ["<b>"] * 2,
            "seed": [1, 2, 3, 1, 2],
            "status": ["completed", "inconsistent: why", "diverged at t = 1 s: why", "completed", "completed"],
            "steady_state_error_percent": [1.0, 10.0, None, 1.0, 1e6],
        }
    )
    nothing = pd.DataFrame()

    def of(name):
        return Campaign(name=name, experiment="<i>")

    monkeypatch.setattr(
        campaign_results, "filters_table", lambda _: table_of_rows("k", "t", NamedRows(("a",), [(1.0,)]))
    )
    page = campaign_page(of("x"), CampaignSummary([], runs, nothing, nothing, nothing), {"ckf": "ckf"}, ["why <u>"])
    (drawing,) = parts_of(page, Picture)
    dots = [shape for shape in drawing.shapes if isinstance(shape, Dot)]
    assert [dot.says for dot in dots] == ["ckf: 1 %", "ckf: 10 %", "<b>: 1 %", "<b>: 1e+06 %"]
    assert dots[0].x < dots[1].x < dots[3].x
    (lost,) = [shape for shape in drawing.shapes if isinstance(shape, TextLabel) and shape.text == "33% lost"]
    assert drawing.width - lost.x >= 8.0 * len("100% lost")  # px of a letter
    elements = Elements(render_page(page))
    assert elements.texts("b") == elements.texts("u") == elements.texts("i") == []
    assert page.subtitle == "5 runs, 3 seeds"
    (listing,) = parts_of(page, Listing)
    assert yaml.safe_load(listing.text) == {"name": "x", "experiment": "<i>"}
    one = campaign_page(of("one"), CampaignSummary([], runs[:1], nothing, nothing, nothing), {"ckf": "ckf"}, [])
    assert one.subtitle == "1 run, 1 seed"


def test_rows_are_a_table_with_symbols_and_units_and_without_empty_columns():
    rows = NamedRows(("signal", "unit", "rmse", "prior_rmse", "whole"), [("p", "rad/s", 0.5, None, True)])
    table = table_of_rows("key", "Title", rows)
    assert [column.header for column in table.columns] == ["signal", "unit", "rmse", "whole"]
    assert [column.numeric for column in table.columns] == [False, False, True, False]
    assert table.rows == [[Symbol("p"), UnitCell("rad/s"), 0.5, "yes"]]


def test_the_path_of_an_estimate_begins_at_the_true_start(known):
    estimate = make_estimate("ckf")
    words, *_, space = path_parts(known.truth, [estimate])
    true, own = space.tracks
    np.testing.assert_allclose(own.position[0], true.position[0])
    # It moves at 1.5 m/s and more; the truth made by hand goes another way.
    assert f"CKF {np.linalg.norm(own.position[-1] - true.position[-1]):.3g} m" in words.sentences[0]
    assert [track.label for track in path_parts(None, [estimate])[-1].tracks] == ["CKF"]


def test_an_estimated_depth_replaces_that_of_dead_reckoning(known):
    estimate = make_estimate("ckf")
    depth = np.linspace(0.0, 50.0, TIME.size)[:, None]
    columns = {name: np.hstack([getattr(estimate, name), depth]) for name in ("mean", "standard_deviation")}
    deeper = replace(estimate, state=(*estimate.state, "down"), unit=(*estimate.unit, "m"), **columns)
    for truth in (None, known.truth):
        plain, other = (path_parts(truth, [each])[-1].tracks[-1].position for each in (estimate, deeper))
        np.testing.assert_array_equal(other[:, :2], plain[:, :2])
        assert np.ptp(plain[:, 2]) < 40.0
        np.testing.assert_allclose(np.ptp(other[:, 2]), 50.0)
    says = [path_parts(None, [each])[0].sentences[0] for each in (estimate, deeper)]
    assert "depth drifts" in says[0]
    assert "depth is the estimated one" in says[1]


def test_a_filter_that_diverged_has_its_verdict_and_no_numbers_that_it_has_not(known):
    good, bad = (replace(make_estimate(name, FEW), experiment=known.experiment) for name in ("smoother", "ekf"))
    estimates = [good, diverged(bad, 2)]
    page = run_page(known, estimates, evaluation_of(known, estimates, blown_up=("ekf",)), [])
    elements = Elements(render_page(page))
    assert elements.texts("article")[1].split()[:2] == ["EKF", "diverged"]
    assert "the state was not finite after a measurement of dvl" in elements.texts("article")[1]
    assert "Checks" not in elements.texts("h2")


def test_many_bounds_take_two_pictures_of_one_scale(known):
    bounds = [
        CoefficientBound(name, "kg/m", 1.0, 0.01, float(place + 1), np.nan, "within 5 %", "dvl", 0.75, "")
        for place, name in enumerate(TRUE)
    ]
    growth = [(duration, np.ones(len(bounds)) / duration) for duration in (1.0, 8.0)]
    page = identifiability_page(known, Identifiability(bounds, [], {}, np.eye(len(bounds)), growth, {}), "the truth")
    forces, moments = parts_of(page, Picture)
    assert (forces.title, moments.title) == ("Bounds, forces", "Bounds, moments")
    ticks = [
        {s.text: s.x for s in each.shapes if isinstance(s, TextLabel) and "%" in s.text} for each in (forces, moments)
    ]
    assert ticks[0] == ticks[1]
