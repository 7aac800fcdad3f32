"""Comparison of filters names only significant differences."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom

from auvid_cli.campaign.measures import Measure
from auvid_cli.campaign.summary import compare_filters, median_interval

N = 50


def rows_of(filter_name, errors, lost=()):
    rows = []
    for seed, error in enumerate(errors):
        status = "diverged at t = 1 s: why" if seed in lost else "completed"
        known = None if seed in lost else float(error)
        name = f"{filter_name}-{seed}"
        rows.append(
            Measure(name, filter_name, seed, "run", "", "", status, "sound", "", steady_state_error_percent=known)
        )
        rows.append(
            Measure(
                name,
                filter_name,
                seed,
                "coefficient",
                "X_u|u|",
                "",
                status,
                "sound",
                "",
                true=-2.0,
                rmse=known and 0.02 * known,
            )
        )
    return rows


def conclusions(*filters):
    table = compare_filters(pd.DataFrame([row for rows in filters for row in rows]), [])
    return {(row["measure"], row["first"], row["second"]): row for row in table.to_dict("records")}


def test_better_filter_is_named():
    random = np.random.default_rng(2)
    # The seeds differ far more than the filters: only pairs can tell.
    difficulty = np.exp(random.standard_normal(N))
    by_pair = conclusions(rows_of("ckf", difficulty), rows_of("ekf", difficulty * 1.1))
    row = by_pair["steady_state_error_percent", "ckf", "ekf"]
    assert row["conclusion"] == "ckf is better"
    assert row["seeds"] == N
    assert row["difference"] == pytest.approx(np.median(-0.1 * difficulty))
    assert row["difference_high"] < 0.0
    # 0.02 |error| of a true value of 2 is one percent of it.
    assert by_pair["rmse_percent", "ckf", "ekf"]["median_first"] == pytest.approx(np.median(difficulty))
    assert (
        conclusions(rows_of("ekf", difficulty * 1.1), rows_of("ckf", difficulty))[
            "steady_state_error_percent", "ekf", "ckf"
        ]["conclusion"]
        == "ckf is better"
    )


def test_equal_filters_tie():
    errors = 1.0 + np.random.default_rng(3).random(N)
    assert (
        conclusions(rows_of("ckf", errors), rows_of("tukf", errors))["steady_state_error_percent", "ckf", "tukf"][
            "conclusion"
        ]
        == "tie"
    )
    # A difference that is sure, and does not matter.
    row = conclusions(rows_of("ckf", errors), rows_of("tukf", errors * 1.001))[
        "steady_state_error_percent", "ckf", "tukf"
    ]
    assert row["p_value_adjusted"] < 1e-6
    assert row["conclusion"] == "tie"


@pytest.mark.slow
def test_chance_difference_is_not_significant():
    random = np.random.default_rng(4)
    named = [
        row["conclusion"]
        for _ in range(40)
        for row in conclusions(rows_of("a", random.random(N)), rows_of("b", random.random(N))).values()
    ]
    assert sum("better" in conclusion for conclusion in named) <= 0.05 * len(named) * 2
    assert "no difference found" in named


def test_too_few_seeds_find_no_difference():
    row = conclusions(rows_of("a", [1.0, 2.0, 3.0]), rows_of("b", [5.0, 6.0, 7.0]))[
        "steady_state_error_percent", "a", "b"
    ]
    assert row["conclusion"] == "no difference found"
    assert (row["difference_low"], row["difference_high"]) == (-np.inf, np.inf)


def test_filter_that_diverges_more_often_is_not_better():
    errors = np.linspace(1.0, 2.0, N)
    row = conclusions(rows_of("ckf", errors), rows_of("ekf", 0.5 * errors, lost=range(10)))[
        "steady_state_error_percent", "ckf", "ekf"
    ]
    assert (row["only_first_diverged"], row["only_second_diverged"], row["seeds"]) == (0, 10, N - 10)
    # McNemar: ten heads of ten.
    assert row["p_diverged"] == pytest.approx(2 * 0.5**10)
    assert row["conclusion"] == "ekf diverges more often"


def test_pairs_are_compared_within_one_combination():
    rows = pd.concat(
        [
            pd.DataFrame([*rows_of("a", np.ones(N)), *rows_of("b", 2.0 * np.ones(N))]).assign(factor=1.0),
            pd.DataFrame([*rows_of("b", np.ones(N)), *rows_of("a", 2.0 * np.ones(N))]).assign(factor=3.0),
        ]
    )
    table = compare_filters(rows, ["factor"])
    own = table[table["measure"] == "steady_state_error_percent"]
    assert list(own[["factor", "first", "second", "conclusion"]].itertuples(index=False, name=None)) == [
        (1.0, "a", "b", "a is better"),
        (3.0, "a", "b", "b is better"),
    ]


def test_single_filter_has_no_comparisons():
    assert len(compare_filters(pd.DataFrame(rows_of("a", [1.0, 2.0])), [])) == 0


@pytest.mark.slow
@given(st.integers(1, 60))
def test_median_interval_covers_95_percent(n):
    low, high = median_interval(np.arange(n, dtype=np.float64))
    # The true median lies between two order statistics unless too many values fall to one side of it.
    k = int(low) + 1 if np.isfinite(low) else 0
    assert np.isfinite(low) == np.isfinite(high)
    miss = 2.0 * binom.cdf(k - 1, n, 0.5) if k else 0.0
    assert miss <= 0.05
    assert 2.0 * binom.cdf(k, n, 0.5) > 0.05
    if k:
        assert high == n - k
