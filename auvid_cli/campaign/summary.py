"""Statistics of a campaign by filter, and comparison of filters."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binom, binomtest, chi2, false_discovery_control, wilcoxon

from auvid_cli.arrays import Array
from auvid_cli.campaign.measures import diverged, ended, failed, inconsistent

# Quantiles of a 90 % interval.
LOW = 0.05
HIGH = 0.95
CONFIDENCE = 0.95
MEASURES = ("steady_state_error_percent", "rmse_percent")
# Differences below this share of the measure do not matter.
MIN_DIFFERENCE = 0.01
# Allowed share of false differences among the significant ones.
FALSE_DISCOVERIES = 0.05


def by_filter(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return a row for each combination of settings and filter.

    Parameters
    ----------
    rows : DataFrame
        With the fields of `auvid_cli.campaign.measures.Measure` and a column for each axis.
    columns : sequence of str
        Axes of the combinations.

    Returns
    -------
    DataFrame
        Axes, filter, number of runs, and shares of failed, diverged and inconsistent runs. All other columns are of
        runs that ended: median and 90 % interval of the mean steady-state error, percent; share of coefficients within
        two standard deviations (corrected ones of batch estimates); median standard deviation and RMS error as
        multiples of the Cramer-Rao bound; NEES per component, and NIS of each sensor, with the 95 % interval of a
        consistent filter; median processor time of the filter, s.
    """
    return _for_each(rows, [*columns, "filter"], _of_filter)


def by_coefficient(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return a row for each combination of settings, filter and coefficient; see `by_filter` for the arguments.

    Returns
    -------
    DataFrame
        Axes, filter, coefficient, unit, and number of runs that ended; median and 90 % interval of steady-state
        error, percent, and RMSE, SI; share within two standard deviations with its 95 % interval; standard deviation
        and RMS error as multiples of the Cramer-Rao bound.
    """
    coefficients = rows[(rows["kind"] == "coefficient") & ended(rows)].rename(columns={"name": "coefficient"})
    return _for_each(coefficients, [*columns, "filter", "coefficient"], _of_coefficient)


def _for_each(
    rows: pd.DataFrame, keys: list[str], summary: Callable[[pd.DataFrame], Mapping[str, float | str]]
) -> pd.DataFrame:
    groups = rows.groupby(keys, sort=False, dropna=False)
    return pd.DataFrame([dict(zip(keys, key, strict=True)) | dict(summary(group)) for key, group in groups])


def _of_filter(rows: pd.DataFrame) -> dict[str, float]:
    rows, runs = rows[ended(rows)], rows[rows["kind"] == "run"]
    ended_runs = rows[rows["kind"] == "run"]
    coefficients = rows[rows["kind"] == "coefficient"]
    summary = {
        "runs": len(runs),
        "failed": float(failed(runs).mean()),
        "diverged": float(diverged(runs).mean()),
        "inconsistent": float(inconsistent(runs).mean()),
        "sound": float((runs["grade"] == "sound").mean()),
        **_spread("steady_state_error_percent", ended_runs["steady_state_error_percent"]),
        "within_two_sigma": _share(_within_two_sigma(coefficients)),
        **_against_bound(coefficients),
        **_per_component("nees", ended_runs),
    }
    for sensor, sensor_rows in rows[rows["kind"] == "sensor"].groupby("name", sort=False):
        summary |= _per_component(f"nis_{sensor}", sensor_rows)
    return summary | {"processor_time": _median(ended_runs["processor_time"])}


def _of_coefficient(rows: pd.DataFrame) -> dict[str, float | str]:
    within = _within_two_sigma(rows)
    interval = binomtest(int(within.sum()), len(within)).proportion_ci(CONFIDENCE, method="exact")
    return {
        "unit": rows["unit"].iloc[0],
        "runs": len(rows),
        **_spread("steady_state_error_percent", rows["steady_state_error_percent"]),
        **_spread("rmse", rows["rmse"]),
        "within_two_sigma": _share(within),
        "within_two_sigma_low": float(interval.low),
        "within_two_sigma_high": float(interval.high),
        **_against_bound(rows),
    }


def _spread(name: str, values: pd.Series) -> dict[str, float]:
    finite = values.dropna()
    low, median, high = finite.quantile([LOW, 0.5, HIGH]) if len(finite) else (np.nan,) * 3
    return {name: median, f"{name}_low": low, f"{name}_high": high}


def _within_two_sigma(coefficients: pd.DataFrame) -> NDArray[np.bool_]:
    estimate, true, nominal, corrected = (
        coefficients[name].to_numpy(dtype=np.float64)
        for name in ("estimate", "true", "standard_deviation", "corrected_standard_deviation")
    )
    return np.abs(estimate - true) <= 2.0 * np.where(np.isnan(corrected), nominal, corrected)


def _against_bound(coefficients: pd.DataFrame) -> dict[str, float]:
    finite = coefficients[np.isfinite(coefficients["cramer_rao_bound"].astype(float))]
    error = (finite["estimate"] - finite["true"]) / finite["cramer_rao_bound"]
    return {
        "times_bound": _median(finite["times_bound"]),
        "error_times_bound": float(np.sqrt(np.mean(error**2))) if len(error) else np.nan,
    }


def _per_component(name: str, rows: pd.DataFrame) -> dict[str, float]:
    """Return the mean of normalised squares, and its 95 % interval for a consistent filter."""
    finite = rows[np.isfinite(rows["squares"].astype(np.float64))]
    components = float(finite["components"].sum())
    if components == 0.0:
        return {name: np.nan, f"{name}_low": np.nan, f"{name}_high": np.nan}
    low, high = (
        float(chi2.ppf(p, components)) / components for p in (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))
    )
    return {name: float(finite["squares"].sum()) / components, f"{name}_low": low, f"{name}_high": high}


def _share(values: NDArray[np.bool_]) -> float:
    return float(values.mean()) if values.size else np.nan


def _median(values: pd.Series) -> float:
    finite = values.dropna()
    return float(finite.median()) if len(finite) else np.nan


def compare_filters(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Return a row for each combination of settings, pair of filters and measure; see `by_filter` for the arguments.

    Returns
    -------
    DataFrame
        Axes; the two filters; the measure, which is the mean over the coefficients of the steady-state error, or of
        the RMSE over the whole run, in percent of the true value; number of seeds that both filters finished; medians
        of both; median of the differences, first minus second, with its 95 % interval by order statistics; Wilcoxon's
        p-value, also adjusted for the number of comparisons (Benjamini and Hochberg); numbers of seeds on which only
        the first or the second diverged, with the p-value of McNemar's exact test, also adjusted; conclusion.
    """
    runs = _runs(rows, columns)
    names = list(dict.fromkeys(runs["filter"]))
    comparisons = []
    for key, cell in runs.groupby(list(columns), sort=False, dropna=False) if columns else [((), runs)]:
        settings = dict(zip(columns, key if isinstance(key, tuple) else (key,), strict=True))
        by_name = dict(iter(cell.groupby("filter")))
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
    """Return a row for each run with both measures."""
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
    values_first, values_second = (
        finished[f"{measure}_{side}"].to_numpy(dtype=np.float64) for side in ("first", "second")
    )
    difference = values_first - values_second
    low, high = median_interval(difference)
    n_diverged = only_first + only_second
    return {
        "seeds": len(difference),
        "median_first": float(np.median(values_first)) if values_first.size else np.nan,
        "median_second": float(np.median(values_second)) if values_second.size else np.nan,
        "difference": float(np.median(difference)) if difference.size else np.nan,
        "difference_low": low,
        "difference_high": high,
        "p_value": float(tuple(wilcoxon(difference))[1]) if np.count_nonzero(difference) else np.nan,
        "only_first_diverged": only_first,
        "only_second_diverged": only_second,
        "p_diverged": float(binomtest(only_first, n_diverged).pvalue) if n_diverged else np.nan,
    }


def median_interval(values: Array) -> tuple[float, float]:
    """Return a confidence interval of the median by order statistics; infinite if there are too few values.

    The number of values below the median is binomial for any distribution.
    """
    # P(k-th smallest value > median) = P(fewer than k values < median).
    k = int(binom.ppf((1.0 - CONFIDENCE) / 2.0, values.size, 0.5)) if values.size else 0
    if k == 0:
        return -np.inf, np.inf
    ordered = np.sort(values)
    return float(ordered[k - 1]), float(ordered[-k])


def _conclusion(row: dict) -> str:
    low, high = row["difference_low"], row["difference_high"]
    margin = MIN_DIFFERENCE * min(row["median_first"], row["median_second"])
    if row["p_diverged_adjusted"] < FALSE_DISCOVERIES:
        more = "first" if row["only_first_diverged"] > row["only_second_diverged"] else "second"
        return f"{row[more]} diverges more often"
    if -margin <= low and high <= margin:
        return "tie"
    if row["p_value_adjusted"] < FALSE_DISCOVERIES and (low > 0.0 or high < 0.0) and abs(row["difference"]) > margin:
        return f"{row['second' if low > 0.0 else 'first']} is better"
    return "no difference found"


class CampaignSummary(NamedTuple):
    """Statistics of a campaign."""

    columns: list[str]  # axes, without those that are drawn for each seed
    # A row for each run: axes, filter, seed, status, judgement, mean steady-state error; of `auvid fit`, what it added
    runs: pd.DataFrame
    filters: pd.DataFrame  # see `by_filter`
    coefficients: pd.DataFrame  # see `by_coefficient`
    comparisons: pd.DataFrame  # see `compare_filters`


def summarize(rows: pd.DataFrame, columns: Sequence[str], drawn: Sequence[str] = ()) -> CampaignSummary:
    """Return the statistics of a campaign; see `by_filter` for the arguments; `drawn` are the other axes."""
    kept = [*columns, *drawn, "filter", "seed", "status", "grade", "steady_state_error_percent"]
    if rows["additions"].notna().any():
        kept += ["additions", "largest_error_sigmas", "reason", "processor_time"]
    runs = rows.loc[rows["kind"] == "run", kept]
    return CampaignSummary(
        list(columns), runs, by_filter(rows, columns), by_coefficient(rows, columns), compare_filters(rows, columns)
    )


def in_planned_order(rows: pd.DataFrame, runs: Iterable[str]) -> pd.DataFrame:
    """Return rows in the planned order of their runs, instead of the order in which these ended."""
    place = {run: k for k, run in enumerate(runs)}
    return rows.sort_values("run", kind="stable", key=lambda runs: runs.map(place))
