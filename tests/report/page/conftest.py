"""A small run with a page, made by hand."""

from dataclasses import replace

import pytest

from auvid_cli.data.checks import Check
from auvid_cli.report.page.pages import run_page
from auvid_cli.report.page.parts import Page

from ..conftest import TRUE, evaluation_of, make_dataset, make_estimate

# Enough for every kind of plot.
FEW = ("X_u|u|", "Y_v|v|", "Y_uudr", "N_uudr")


def check_of(name: str, passed: bool | None) -> Check:
    return Check.of(name, "dvl", "NIS", statistic="1.2", threshold="<= 1.1", passed=passed, advice="Look at the DVL.")


@pytest.fixture(scope="session")
def page(experiment_with) -> Page:
    """The page of a run with a truth and three filters."""
    experiment, dataset = experiment_with(), make_dataset()
    offsets = {"ekf": 0.02, "ckf": 0.01, "tukf": 0.005}
    estimates = [replace(make_estimate(name, FEW, by), experiment=experiment) for name, by in offsets.items()]
    checks = [check_of("ekf", True), check_of("ckf", False), check_of("tukf", None)]
    evaluation = evaluation_of(dataset, estimates)
    assert {*FEW} <= {*TRUE}
    return run_page(replace(dataset, experiment=experiment), estimates, evaluation, checks)
