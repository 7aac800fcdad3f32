"""What is said of a design."""

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


def test_a_gain_is_said_with_what_it_saves_and_what_stays_bad(design):
    assert sentences(design(trial(1.0), trial(2.0))) == [
        "The designed run gives x2.00 over the spiral on 4 vehicles not seen by the search.",
        "After 40 of 120 s it has told what the spiral tells in all.",
        "Mean sd with the vehicle as it is believed to be: 3.1 % after 60 s, 1 % after 120 s.",
        "N_uvl stays at 31 %: cannot be told from N_url: correlation 0.97.",
    ]


def test_where_the_spiral_is_as_good_this_is_said_and_its_own_faults(design):
    said = sentences(design(trial(1.0), trial(1.05, outside=2, lost=1), chosen="spiral"))
    assert said[0].startswith("The spiral is as good (x1.05 over the spiral on 4 vehicles")
    assert said[1] == "It leaves the envelope with 3 of 4 vehicles (roll), of which 1 are lost: keep room for it."


def test_a_search_that_finds_nothing_in_the_envelope_says_so(design):
    said = sentences(design(trial(1.0, outside=1), trial(2.0), chosen="spiral"))
    assert said[0] == "No designed run keeps the envelope as the spiral does: the spiral is what is written."


def test_what_is_usual_is_named_where_it_is_best(design):
    said = sentences(design(trial(1.0), trial(2.0, outside=1), chosen="doublets"))
    assert said[0].startswith("Best of all that was tried: doublets (x4.00 over the spiral on 4 vehicles")
    assert said[1] == "The spiral itself leaves the envelope with 1 of them."


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
