from dataclasses import replace

import numpy as np
import pytest

from auvid_cli.evaluation.accuracy import shares_of_prior
from auvid_cli.identification.states import coefficient_priors
from auvid_cli.report.page.coefficients import coefficient_list, convergence, forest
from auvid_cli.report.page.parts import Dot, TextLabel
from auvid_cli.report.page.sections import correlation_of, correlation_parts
from auvid_cli.report.table import Symbol

from ..conftest import TRUE, evaluation_of, make_estimate
from .conftest import FEW


def test_the_list_has_a_row_for_each_coefficient_and_filter(evaluation):
    shares = {name: dict.fromkeys(TRUE, 0.125) for name in ("ekf", "ckf", "tukf")}
    table = coefficient_list(evaluation, shares)
    headers = [column.header for column in table.columns]
    assert len(table.rows) == 3 * len(TRUE)
    row = dict(zip(headers, table.rows[1], strict=True))
    # True 10, estimate 10.1, standard deviation 0.25, bound 0.2.
    assert row["coefficient"] == Symbol(next(iter(TRUE)))
    assert row["estimator"] == "CKF"
    assert (row["true"], row["error %"], row["error / sd"]) == (10.0, "1.0", "0.40")
    assert (row["bound"], row["times bound"], row["% of prior"]) == ("0.20", "1.25", "12")
    assert row["identified"] == "yes"
    last = dict(zip(headers, table.rows[-1], strict=True))
    assert (last["bound"], last["identified"]) == (None, "† no")


def test_what_is_left_of_the_prior_is_told_by_it(experiment_with):
    experiment = experiment_with()
    estimate = replace(make_estimate("ckf"), experiment=experiment)
    priors = coefficient_priors(experiment.vehicle, experiment.identification.prior)
    shares = shares_of_prior(estimate)
    assert shares == pytest.approx({symbol: 0.25 / priors[symbol].standard_deviation for symbol in TRUE})


def test_the_forest_tells_standard_deviations_from_the_truth(evaluation):
    forces, moments = forest(evaluation)
    assert [drawing.title for drawing in (forces, moments)] == [
        "Distance from the truth, forces",
        "Distance from the truth, moments",
    ]
    dots = {shape.says: shape for drawing in (forces, moments) for shape in drawing.shapes if isinstance(shape, Dot)}
    assert len(dots) == 3 * len(TRUE)
    # Of the second coefficient: true 11, by 1 % and a quarter of a standard deviation of 0.25 apart.
    symbol = list(TRUE)[1]
    near, far = dots[f"{symbol}, CKF: +0.44"], dots[f"{symbol}, EKF: +0.88"]
    middle = next(shape for shape in forces.shapes if isinstance(shape, TextLabel) and shape.text == "0")
    assert far.x - middle.x == pytest.approx(2.0 * (near.x - middle.x))
    assert all("Farthest from the truth" in drawing.says for drawing in (forces, moments))


def test_what_is_beyond_the_forest_stands_at_its_edge_with_an_arrow(dataset):
    (drawing,) = forest(evaluation_of(dataset, [make_estimate("ckf", FEW, offset=0.5)]))
    arrows = [shape for shape in drawing.shapes if isinstance(shape, TextLabel) and shape.text == "→"]
    assert len(arrows) == len(FEW)
    assert f"{len(FEW)} are farther than 5" in drawing.says


def test_without_a_truth_filters_are_compared_with_the_first(dataset):
    recorded = replace(dataset, truth=None)
    estimates = [make_estimate("smoother", FEW, offset=0.0), make_estimate("ckf", FEW, offset=0.02)]
    evaluation = evaluation_of(recorded, estimates)
    (drawing,) = forest(evaluation)
    assert drawing.title == "Distance from the smoother"
    assert [label for _, label in drawing.legend] == ["CKF"]
    assert forest(evaluation_of(recorded, [make_estimate("ckf")])) == []


def test_convergence_ends_where_the_estimate_is_off(estimates):
    plots = convergence(estimates, TRUE)
    assert [plot.title for plot in plots.plots] == list(TRUE)
    ends = {line.label: line.values[-1] for line in plots.plots[0].lines}
    assert ends == pytest.approx({"EKF": 2.0, "CKF": 1.0, "TUKF": 0.5}, rel=1e-6)
    # It begins at zero, 100 % off, and no distance is below zero.
    assert plots.plots[0].lines[0].values[0] == pytest.approx(100.0)


def test_without_a_truth_convergence_is_towards_the_end(estimates):
    line = convergence(estimates, {}).plots[0].lines[0]
    # The last part holds how far it still was at its beginning.
    assert line.values[0] == pytest.approx(100.0, rel=1e-3)
    assert np.isnan(line.values[-1]) or line.values[-1] < 1e-6


def test_the_strongest_pair_is_named(estimates):
    estimate = estimates[1]
    covariance = np.diag(np.arange(1.0, len(estimate.state) + 1.0))
    covariance[0, 2] = covariance[2, 0] = -0.95 * np.sqrt(1.0 * 3.0)
    words, matrix = correlation_of(replace(estimate, covariance=covariance))
    first, _, third, *_ = TRUE
    assert words.sentences[0] == f"Strongest pairs: {first} and {third} -0.95."
    both = (first, third), (third, first)
    # Of two correlated by -0.95 the sum has a variance of 0.05, the difference one of 1.95.
    assert any(f"{a} - 1 {b}; its standard deviation is 1.4 times" in words.sentences[1] for a, b in both)
    assert words.sentences[2].endswith(", 0.22 times.")
    assert matrix.values[0, 2] == pytest.approx(-0.95)


def test_no_strong_pair_is_said(estimates):
    words, _ = correlation_parts("Title", ["a", "b"], np.eye(2))
    assert words.sentences[0] == "No pair correlates by 0.7 or more."


def test_what_is_not_finite_has_no_correlation(estimates):
    assert correlation_of(replace(estimates[0], covariance=np.full_like(estimates[0].covariance, np.nan))) == []


def test_terms_of_the_vehicles_own_are_shown_like_the_22(experiment_with):
    experiment = experiment_with("vehicle.terms=[{name: K_up, row: K, factors: [u, p], value: -3}]")
    plain = make_estimate("ckf")
    n = len(TRUE)
    mean = np.insert(plain.mean, n, -3.0 * (1.0 - np.exp(-plain.time)), axis=1)
    covariance = np.eye(mean.shape[1])
    covariance[n, 0] = covariance[0, n] = 0.99
    estimate = replace(
        plain,
        experiment=experiment,
        state=(*plain.state[:n], "K_up", *plain.state[n:]),
        unit=(*plain.unit[:n], "kg*m/rad", *plain.unit[n:]),
        mean=mean,
        standard_deviation=np.full_like(mean, 0.25),
        covariance=covariance,
    )
    words, matrix = correlation_of(estimate)
    assert "K_up" in matrix.symbols
    assert f"{estimate.state[0]} and K_up +0.99" in words.sentences[0]
    assert "K_up" in [plot.title for plot in convergence([estimate], {}).plots]
