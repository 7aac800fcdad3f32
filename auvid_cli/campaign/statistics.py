"""What many runs say of a filter: spread of its errors, honesty of its covariance, how often it fails."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binomtest, chi2

from auvid_cli.campaign.status import diverged, ended, failed

# 90 % of the runs lie between these quantiles.
LOW, HIGH = 0.05, 0.95
CONFIDENCE = 0.95


def by_filter(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Summarise the runs in a row for each combination of settings and filter.

    Parameters
    ----------
    rows : DataFrame
        As `auvid_cli.campaign.measures.Measure`, with a column for each axis.
    columns : sequence of str
        Axes that tell combinations apart.

    Returns
    -------
    DataFrame
        The axes, the filter, and: how many runs; shares that failed, that diverged and that are inconsistent; median
        and 90 % interval of the mean steady-state error, percent; over all coefficients the share within two standard
        deviations, of batch estimates the corrected ones, the median of these in terms of the bound, and the root mean
        square of the errors in terms of it; NEES per component with the interval in which it lies by chance, 95 %; the
        same for the NIS of each sensor; median processor time of the filter, s. Runs that failed or diverged count only
        in their share.
    """
    return _for_each(rows, [*columns, "filter"], _of_filter)


def by_coefficient(rows: pd.DataFrame, columns: Sequence[str]) -> pd.DataFrame:
    """Summarise the runs in a row for each combination of settings, filter and coefficient.

    Parameters
    ----------
    rows, columns
        As of `by_filter`.

    Returns
    -------
    DataFrame
        The axes, filter, coefficient, its unit, and: how many runs came to the end; median and 90 % interval of
        steady-state error, percent, and RMSE, SI; share within two standard deviations with its 95 % interval;
        standard deviation and root mean square error in terms of the bound.
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
    sound = rows[rows["kind"] == "run"]
    coefficients = rows[rows["kind"] == "coefficient"]
    summary = {
        "runs": len(runs),
        "failed": float(failed(runs).mean()),
        "diverged": float(diverged(runs).mean()),
        "inconsistent": float(runs["status"].str.startswith("inconsistent").mean()),
        "sound": float((runs["grade"] == "sound").mean()),
        **_spread("steady_state_error_percent", sound["steady_state_error_percent"]),
        "within_two_sigma": _share(_within_two_sigma(coefficients)),
        **_against_bound(coefficients),
        **_per_component("nees", sound),
    }
    sensors = rows[rows["kind"] == "sensor"]
    for sensor, of_sensor in sensors.groupby("name", sort=False):
        summary |= _per_component(f"nis_{sensor}", of_sensor)
    return summary | {"processor_time": _median(sound["processor_time"])}


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
    """Return the mean of normalised squares, and where chance leaves the mean of so many."""
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
