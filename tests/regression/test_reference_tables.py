"""The default experiment against the tables in results/reference, and against the paper's averages.

After an intended change of numbers: `pytest tests/regression --update-reference`, and read the difference.
"""

import csv
import math
from pathlib import Path

import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.evaluation.bounds import BoundsOf
from auvid_cli.evaluation.evaluate import evaluate
from auvid_cli.identification.prepared_data import prepare
from auvid_cli.identification.run import identify
from auvid_cli.report.text_tables import write_csv_tables
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.coefficients import N_COEFFICIENTS

REFERENCE = Path(__file__).parents[2] / "results/reference/spiral"
PUBLISHED = Path(__file__).parents[2] / "auvid_cli/report/published/table_iv.csv"

# Another processor or library rounds differently, and a filter carries that on; nothing else may.
# Estimates may move by a hundredth of their standard deviation, everything else by a percent.
SHARE_OF_DEVIATION = 0.01
RELATIVE = 0.01


@pytest.fixture(scope="module")
def tables(tmp_path_factory, request):
    experiment = load_experiment(find_experiment("spiral"))
    dataset = simulate(experiment)
    estimates = [identify(dataset, name) for name in experiment.identification.filters]
    evaluation = evaluate(prepare(dataset), estimates, BoundsOf(prepare(dataset)))
    folder = tmp_path_factory.mktemp("tables")
    if request.config.getoption("--update-reference"):
        folder = REFERENCE
    write_csv_tables(evaluation.tables(), folder)
    return folder


def rows(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_coefficients_are_those_of_the_reference(tables):
    new, old = rows(tables, "coefficients.csv"), rows(REFERENCE, "coefficients.csv")
    assert len(new) == len(old) == 3 * N_COEFFICIENTS
    for a, b in zip(new, old, strict=True):
        assert (a["filter"], a["coefficient"], a["unit"], a["true"]) == (
            *(b["filter"], b["coefficient"], b["unit"], b["true"]),
        )
        deviation = float(b["standard_deviation"])
        assert float(a["estimate"]) == pytest.approx(float(b["estimate"]), abs=SHARE_OF_DEVIATION * deviation)
        assert float(a["standard_deviation"]) == pytest.approx(deviation, rel=RELATIVE)
        assert float(a["rmse"]) == pytest.approx(float(b["rmse"]), rel=RELATIVE)
        percent = 100.0 * SHARE_OF_DEVIATION * deviation / abs(float(b["true"]))
        assert float(a["steady_state_error_percent"]) == pytest.approx(
            float(b["steady_state_error_percent"]), abs=percent
        )


@pytest.mark.slow
def test_summary_is_that_of_the_reference(tables):
    for a, b in zip(rows(tables, "summary.csv"), rows(REFERENCE, "summary.csv"), strict=True):
        assert (a["filter"], a["steps"], a["status"]) == (b["filter"], b["steps"], b["status"])
        for column in ("average_steady_state_error_percent", "mean_nis"):
            assert float(a[column]) == pytest.approx(float(b[column]), rel=RELATIVE)


@pytest.mark.slow
def test_velocity_errors_are_those_of_the_reference(tables):
    for a, b in zip(rows(tables, "velocity_error.csv"), rows(REFERENCE, "velocity_error.csv"), strict=True):
        assert (a["filter"], a["component"], a["unit"]) == (b["filter"], b["component"], b["unit"])
        assert float(a["mean_absolute_error"]) == pytest.approx(float(b["mean_absolute_error"]), rel=RELATIVE)


def test_every_filter_is_at_least_as_accurate_as_the_paper_publishes(tables):
    average = next(row for row in rows(PUBLISHED.parent, PUBLISHED.name) if row["coefficient"] == "average")
    for row in rows(tables, "summary.csv"):
        bar = float(average[f"sse_percent_{row['filter']}"])
        assert float(row["average_steady_state_error_percent"]) <= bar


def test_most_rmse_are_below_the_published_ones(tables):
    """Over 100 seeds EKF, CKF and TUKF have at least 18, 15 and 15 of 22 rows below the paper's."""
    published = {row["coefficient"]: row for row in rows(PUBLISHED.parent, PUBLISHED.name)}
    for name in ("ekf", "ckf", "tukf"):
        own = [row for row in rows(tables, "coefficients.csv") if row["filter"] == name]
        below = sum(float(row["rmse"]) < float(published[row["coefficient"]][f"rmse_{name}"]) for row in own)
        relative = sorted(float(row["rmse"]) / abs(float(row["true"])) for row in own)
        assert below >= 15
        assert relative[len(relative) // 2] <= 0.08


def test_what_the_filters_claim_is_true(tables):
    """Truth within the claimed uncertainty: normalised errors of the coefficients, per filter.

    The errors are correlated, so the bound is generous: a mean square above 4 means that standard deviations are
    half of what they should be.
    """
    table = rows(tables, "coefficients.csv")
    for name in ("ekf", "ckf", "tukf"):
        normalised = [
            (float(row["estimate"]) - float(row["true"])) / float(row["standard_deviation"])
            for row in table
            if row["filter"] == name
        ]
        assert math.fsum(z * z for z in normalised) / len(normalised) < 4.0
