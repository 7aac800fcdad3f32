"""Filters against each other on the same data: who is better, and where nobody can tell."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binom, binomtest, false_discovery_control, wilcoxon

from auvid_cli.campaign.statistics import CONFIDENCE
from auvid_cli.campaign.status import diverged, ended

Array = NDArray[np.float64]

MEASURES = ("steady_state_error_percent", "rmse_percent")
# A difference of less than this share of the measure itself does not matter, however sure it is.
LEAST_SHARE = 0.01
# A difference that is larger only by chance is taken for a real one in so many of all that are named.
FALSE_DISCOVERIES = 0.05


def compare_filters(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Compare filters in a row for each combination of settings, pair of filters and measure.

    Parameters
    ----------
    rows, columns
        As of `auvid_cli.campaign.statistics.by_filter`.

    Returns
    -------
    DataFrame
        The axes; the two filters; the measure: mean over the coefficients of the steady-state error, or of the RMSE
        over the whole run, in percent of the true value; how many seeds both filters finished; the medians of both;
        median of the differences, first minus second, with its 95 % interval by order statistics; Wilcoxon's p-value,
        as it is and adjusted for the number of comparisons (Benjamini and Hochberg); seeds on which only the one or
        only the other diverged, with the p-value of McNemar's exact test, as it is and adjusted; what follows.
    """
    runs = _runs(rows, columns)
    names = list(dict.fromkeys(runs["filter"]))
    comparisons = []
    for key, cell in runs.groupby(list(columns), sort=False, dropna=False) if columns else [((), runs)]:
        settings = dict(zip(columns, key if isinstance(key, tuple) else (key,), strict=True))
        by_name = {name: of_filter for name, of_filter in cell.groupby("filter")}
        for first, second in combinations([name for name in names if name in by_name], 2):
            for measure in MEASURES:
                pair = {"first": first, "second": second, "measure": measure}
                comparisons.append(settings | pair | _difference(by_name[first], by_name[second], measure))
    table = pd.DataFrame(comparisons)
    if not len(table):
        return table
    for p in ("p_value", "p_diverged"):
        tested = table[p].notna()
        table[f"{p}_adjusted"] = np.nan
        if tested.any():
            table.loc[tested, f"{p}_adjusted"] = false_discovery_control(table.loc[tested, p])
    table["conclusion"] = [_conclusion(row) for row in table.to_dict("records")]
    return table


def _runs(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return a row for each run, with its two measures."""
    runs = rows[rows["kind"] == "run"]
    coefficients = rows[(rows["kind"] == "coefficient") & (rows["true"] != 0.0)]
    percent = 100.0 * coefficients["rmse"] / coefficients["true"].abs()
    rmse = percent.groupby(coefficients["run"]).mean()
    kept = runs[["run", "seed", "filter", *columns, "steady_state_error_percent"]]
    return kept.assign(rmse_percent=runs["run"].map(rmse), diverged=diverged(runs), ended=ended(runs))


def _difference(first: pd.DataFrame, second: pd.DataFrame, measure: str) -> dict[str, float]:
    both = first.merge(second, on="seed", suffixes=("_first", "_second"))
    only_first = int((both["diverged_first"] & both["ended_second"]).sum())
    only_second = int((both["ended_first"] & both["diverged_second"]).sum())
    finished = both[both["ended_first"] & both["ended_second"]]
    of_first, of_second = (finished[f"{measure}_{side}"].to_numpy(dtype=np.float64) for side in ("first", "second"))
    difference = of_first - of_second
    low, high = median_interval(difference)
    lost = only_first + only_second
    return {
        "seeds": len(difference),
        "median_first": float(np.median(of_first)) if of_first.size else np.nan,
        "median_second": float(np.median(of_second)) if of_second.size else np.nan,
        "difference": float(np.median(difference)) if difference.size else np.nan,
        "difference_low": low,
        "difference_high": high,
        "p_value": float(tuple(wilcoxon(difference))[1]) if np.count_nonzero(difference) else np.nan,
        "only_first_diverged": only_first,
        "only_second_diverged": only_second,
        "p_diverged": float(binomtest(only_first, lost).pvalue) if lost else np.nan,
    }


def median_interval(values: Array) -> tuple[float, float]:
    """Return an interval of the median by order statistics; infinite where the values are too few.

    The number of values below the median is binomial, whatever the distribution.
    """
    # The k-th smallest is above the median with the probability that fewer than k are below it.
    k = int(binom.ppf((1.0 - CONFIDENCE) / 2.0, values.size, 0.5)) if values.size else 0
    if k == 0:
        return -np.inf, np.inf
    ordered = np.sort(values)
    return float(ordered[k - 1]), float(ordered[-k])


def _conclusion(row: dict) -> str:
    low, high = row["difference_low"], row["difference_high"]
    room = LEAST_SHARE * min(row["median_first"], row["median_second"])
    if row["p_diverged_adjusted"] < FALSE_DISCOVERIES:
        more = "first" if row["only_first_diverged"] > row["only_second_diverged"] else "second"
        return f"{row[more]} diverges more often"
    if -room <= low and high <= room:
        return "tie"
    if row["p_value_adjusted"] < FALSE_DISCOVERIES and (low > 0.0 or high < 0.0) and abs(row["difference"]) > room:
        return f"{row['second' if low > 0.0 else 'first']} is better"
    return "no difference found"
