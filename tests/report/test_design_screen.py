"""What is lines of a design."""

import io

import numpy as np
import pytest
from rich.console import Console

from auvid_cli.design.mission import Band
from auvid_cli.design.posterior import Posterior
from auvid_cli.design.search import Design, SearchProgress, WeakCoefficient
from auvid_cli.design.trials import Extent, Trial, TrialRun
from auvid_cli.report.figures.timeline import mission_figure
from auvid_cli.report.screens import print_design, sentences

SYMBOLS = "X_u|u|", "N_uvl", "K_up"
GROWTH = (60.0, 3.14), (120.0, 1.0)
KEPT, LEFT = dict.fromkeys(("box", "roll"), 0.0), {"box": 0.0, "roll": 0.2}


def trial(percent, *, outside=0, lost=0):
    """Four vehicles, some of which leave the envelope and some of which are lost."""
    extent = Extent(100.0, 20.0, 0.3, 0.4, 1.0, 5e3)
    flights = [TrialRun(np.full(3, percent), None if k < lost else extent) for k in range(4)]
    measure = np.array([np.inf if k < lost else np.log(percent) for k in range(4)])
    return Trial(None, flights, measure, [LEFT if k < outside else KEPT for k in range(4 - lost)])


@pytest.fixture
def design():
    """Function: a design with trials of a designed run and of the spiral."""

    def make(designed, spiral, chosen="designed"):
        posterior = Posterior(np.array([0.0, 120.0]), np.ones((2, 3)), np.eye(3))
        trials = {"designed": designed, "spiral": spiral, "zigzag": trial(8.0, lost=4), "doublets": trial(0.5)}
        poor = (WeakCoefficient("N_uvl", 31.0, "cannot be told from N_url: correlation 0.97"),)
        gain = trials["designed" if chosen == "spiral" else chosen].mean_gain_over(spiral)
        end = SearchProgress(1, 13, designed), SYMBOLS
        return Design(None, chosen, gain, trials, poor, None, posterior, 40.0, GROWTH, *end)

    return make


def test_sentences_of_better_design_give_gain_duration_and_weak_coefficients(design):
    assert sentences(design(trial(1.0), trial(2.0))) == [
        "The designed run gives a gain of 2.00 over the spiral on 4 vehicles that the search did not use.",
        "After 40 of 120 s it is as informative as the whole spiral.",
        "Mean sd for the expected vehicle: 3.1 % after 60 s, 1 % after 120 s.",
        "N_uvl stays at 31 %: cannot be told from N_url: correlation 0.97.",
    ]


def test_spiral_is_written_if_as_good(design):
    lines = sentences(design(trial(1.0), trial(1.05, outside=2, lost=1), chosen="spiral"))
    assert lines[0].startswith(
        "The spiral is as good, and is written: the search found a gain of 1.05 over the spiral on 4 vehicles"
    )
    assert lines[1] == "3 of 4 trial vehicles left the limits (roll), and 1 went out of control: plan a margin."


def test_spiral_is_written_if_no_design_stays_within_limits(design):
    lines = sentences(design(trial(1.0, outside=1), trial(2.0), chosen="spiral"))
    assert lines[0] == "No designed run stays within the limits as well as the spiral: the spiral is written."


def test_usual_manoeuvre_is_written_if_best(design):
    lines = sentences(design(trial(1.0), trial(2.0, outside=1), chosen="doublets"))
    assert lines[0].startswith("The best run is doublets (a gain of 4.00 over the spiral on 4 vehicles")
    assert lines[1] == "With the spiral, 1 of them left the limits."


def test_the_table_has_a_row_for_each_and_none_of_what_is_lost(design):
    console = Console(file=io.StringIO(), width=100)
    print_design(console, design(trial(1.0), trial(2.0)))
    rows = {line.split()[0]: line.split()[1:] for line in console.file.getvalue().splitlines() if line.split()}
    assert rows["designed"] == ["1.00", "1.00", "2.00", "2.00", "2.00", "0", "of", "4", "100", "20.0"]
    assert rows["zigzag"] == ["-", "-", "-", "-", "-", "4", "of", "4", "-", "-"]


def test_a_mission_is_drawn_with_held_coefficients_left_open():
    n, time = 6, np.arange(6.0)
    spread = np.zeros((n, 3))
    band = Band(
        time,
        np.zeros((n, 3, 3)),
        *[spread] * 5,
        box=(1.0, 1.0),
        depths=(0.0, 1.0),
        length=(1.0, 1.0),
        energy=(1.0, 1.0),
        number=3,
    )
    percents = {"designed": np.array([1.0, 0.0, 5.0]), "spiral": np.array([2.0, 0.0, 9.0])}
    figure = mission_figure(time, np.zeros((n, 4)), band, SYMBOLS, percents)
    designed, spiral = figure.axes[-1].lines
    assert [line.get_label() for line in (designed, spiral)] == ["designed", "spiral"]
    assert np.isnan(designed.get_ydata()[1])
    figure.canvas.draw()
