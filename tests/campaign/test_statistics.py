"""Statistics of made-up runs whose answers are known."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2

from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.summary import by_coefficient, by_filter

RANDOM = np.random.default_rng(1)
SYMBOLS = ("X_u|u|", "Y_v|v|", "N_r|r|")


def rows_of(filter_name, n_runs, factor, overconfidence=1.0, lost=0):
    """Runs of an ideal estimator with known covariance, of which the filter says less by some factor."""
    rows = []
    for seed in range(n_runs):
        status = "diverged at t = 3 s: why" if seed < lost else "completed"
        errors = RANDOM.standard_normal(len(SYMBOLS))
        run = f"{filter_name}-{factor}-{seed}"
        nees = None if seed < lost else float(np.sum((overconfidence * errors) ** 2))
        rows.append(
            Measure(
                run,
                filter_name,
                seed,
                "run",
                "",
                "",
                status,
                "sound",
                "",
                squares=nees,
                components=len(SYMBOLS),
                steady_state_error_percent=None if seed < lost else float(seed),
                processor_time=2.0,
            )
        )
        rows += [
            Measure(
                run,
                filter_name,
                seed,
                "coefficient",
                symbol,
                "kg/m",
                status,
                "sound",
                "",
                true=-10.0,
                estimate=-10.0 + error,
                standard_deviation=1.0 / overconfidence,
                rmse=3.0,
                steady_state_error_percent=abs(10.0 * error),
                cramer_rao_bound=0.5,
                times_bound=2.0 / overconfidence,
            )
            for symbol, error in zip(SYMBOLS, errors, strict=True)
        ]
        rows.append(
            Measure(run, filter_name, seed, "sensor", "dvl", "", status, "sound", "", squares=330.0, components=300)
        )
    return pd.DataFrame(rows).assign(factor=factor)


def test_consistent_filter_has_consistent_statistics():
    (row,) = by_filter(rows_of("ckf", 400, 1.0), ["factor"]).to_dict("records")
    assert (row["filter"], row["factor"], row["runs"], row["diverged"]) == ("ckf", 1.0, 400, 0.0)
    # Interval for 1200 normal errors.
    assert row["within_two_sigma"] == pytest.approx(0.9545, abs=4 * (0.9545 * 0.0455 / 1200) ** 0.5)
    assert row["nees_low"] < row["nees"] < row["nees_high"]
    assert (row["nees_low"], row["nees_high"]) == pytest.approx(tuple(chi2.interval(0.95, 1200) / np.float64(1200)))
    assert row["times_bound"] == 2.0
    assert row["error_times_bound"] == pytest.approx(2.0, rel=0.1)
    # Errors of the runs are 0, 1, ... 399.
    wanted = (199.5, 0.05 * 399, 0.95 * 399)
    names = [f"steady_state_error_percent{end}" for end in ("", "_low", "_high")]
    assert tuple(row[name] for name in names) == pytest.approx(wanted)
    assert row["nis_dvl"] == pytest.approx(1.1)
    assert row["nis_dvl"] > row["nis_dvl_high"]


def test_overconfident_filter_has_high_nees():
    (row,) = by_filter(rows_of("ckf", 100, 1.0, overconfidence=2.0), []).to_dict("records")
    assert row["nees"] > row["nees_high"]
    assert row["within_two_sigma"] == pytest.approx(0.683, abs=4 * (0.68 * 0.32 / 300) ** 0.5)


def test_diverged_runs_count_only_in_their_share():
    rows = pd.concat([rows_of("ckf", 50, 1.0, lost=10), rows_of("ckf", 50, 3.0)])
    table = by_filter(rows, ["factor"]).set_index("factor")
    assert list(table["diverged"]) == [0.2, 0.0]
    assert table.loc[1.0, "steady_state_error_percent"] == np.median(range(10, 50))
    coefficients = by_coefficient(rows, ["factor"]).set_index(["factor", "coefficient"])
    assert list(coefficients["runs"]) == 3 * [40] + 3 * [50]


def test_only_failed_runs_have_no_statistics():
    (row,) = by_filter(rows_of("ckf", 4, 1.0, lost=4), []).to_dict("records")
    assert row["diverged"] == 1.0
    for name in ("steady_state_error_percent", "within_two_sigma", "nees", "times_bound", "error_times_bound"):
        assert np.isnan(row[name])


def test_share_of_a_coefficient_has_exact_interval():
    rows = rows_of("ckf", 30, 1.0)
    rows.loc[rows["kind"] == "coefficient", "estimate"] = -10.0
    table = by_coefficient(rows, [])
    assert list(table["within_two_sigma"]) == [1.0, 1.0, 1.0]
    # Clopper and Pearson: all of n within: the lower limit is the n-th root of 2.5 %.
    assert table["within_two_sigma_low"].to_numpy() == pytest.approx(0.025 ** (1 / 30))
    assert list(table["within_two_sigma_high"]) == [1.0, 1.0, 1.0]
