"""Checks of the predictions of an estimate."""

from collections.abc import Mapping, Sequence

from auvid_cli.data.checks import Check
from auvid_cli.validation.results import (
    AHEAD,
    COMPLETED,
    MAX_ERROR_RATIO,
    MAX_NIS,
    STABLE,
    UNCERTAINTY_NOT_TOO_LARGE,
    UNCERTAINTY_NOT_TOO_SMALL,
    Prediction,
    error_ratios,
)

_MAX_EXCURSION_RATIO = 10.0  # ratio to the largest distance of the measurements from their mean
# Smallest share of the errors within two standard deviations: below 0.95, because successive starts are correlated.
_MIN_BAND_SHARE = 0.85
_MAX_BAND_SHARE = 0.995
_MIN_MEASUREMENTS = 60  # for a share within the band; with fewer, one of dozens of rows is too small by chance
_MAX_NOISE_SHARE = 0.7  # share of noise in a band; more hides whether the model's uncertainty is too large
# With this number of independent errors a correct band misses at least one with a probability of 95 %, 1 - 0.95^59.
_MIN_INDEPENDENT = 59.0


def prediction_checks(
    name: str, rows: Sequence[Prediction], excursion: Mapping[str, float], nis: Mapping[str, float], status: str
) -> list[Check]:
    """Return all checks of the predictions of one estimate.

    Parameters
    ----------
    name : str
        Filter of the estimate.
    rows : sequence of Prediction
    excursion : mapping of float
        By signal, of the free run, see `FreeRunFit`.
    nis : mapping of float
        By sensor, of the filter that finds the initial states, see `InitialStates`.
    status : str
        Status of that filter.
    """
    ahead = [row for row in rows if row.kind == AHEAD]
    stable = Check.of_values(
        name,
        "free run",
        STABLE,
        excursion,
        limit=_MAX_EXCURSION_RATIO,
        unit="times",
        meaning="the range of the measurements",
        advice="The free run leaves the range of the measurements. If the vehicle is unstable in open loop, use the "
        "predictions ahead instead; otherwise the coefficients are wrong: run `auvid check` on the estimate.",
    )
    completed = Check.of(
        name,
        "start",
        COMPLETED,
        statistic=status,
        threshold="to the end of the data",
        passed=status == "completed",
        advice="No filter follows these measurements with this model. Predictions start only before that time: run "
        "`auvid inspect` on the data, and check that the vehicle is the same.",
    )
    checks = [stable, completed]
    if ahead:
        checks += [
            _better(name, "constant velocity", ahead, "constant_velocity_rmse"),
            _better(name, "the prior", ahead, "prior_rmse"),
            *_band_checks(name, ahead),
        ]
    checks.append(
        Check.of_values(
            name,
            "one measurement ahead",
            "NIS",
            nis,
            limit=MAX_NIS,
            meaning="per component",
            advice="From one measurement to the next the errors are larger than the settings predict: coefficients are "
            "wrong, the model lacks an effect of this run, or these sensors are worse than stated. Run `auvid tune` on "
            "this run.",
            fails=False,
        )
    )
    return checks


def _better(name: str, other: str, rows: Sequence[Prediction], field: str) -> Check:
    """Check that the model has smaller errors in each signal, on average over horizons with errors beyond noise."""
    ratios = error_ratios(rows, field)
    if not ratios:
        return Check.of(
            name,
            "ahead",
            f"better than {other}",
            statistic="-",
            threshold="errors larger than noise",
            passed=None,
            advice=f"Not checked: the errors of {other} are noise, or it diverged. Validate on a run with more motion.",
        )
    return Check.of_values(
        name,
        "ahead",
        f"better than {other}",
        ratios,
        limit=MAX_ERROR_RATIO,
        unit="times",
        meaning="its error, over horizons where that is more than noise",
        advice="Do not use the model for these signals: the coefficients of that motion are wrong, or the vehicle has "
        "changed.",
    )


def _band_checks(name: str, rows: Sequence[Prediction]) -> list[Check]:
    """Check the stated uncertainty against the errors: not too small, nor, over all horizons, too large."""
    banded = [row for row in rows if row.share_within_band is not None]
    # A model that diverged has no band, so no error is within it.
    expected = [row for row in rows if row.draws or row.share_within_band is not None]
    shares = [
        (row, 100.0 * (row.share_within_band or 0.0)) for row in expected if row.measurements >= _MIN_MEASUREMENTS
    ]
    if not shares:
        return []
    too_small = Check.of_values(
        name,
        "ahead",
        UNCERTAINTY_NOT_TOO_SMALL,
        _worst(shares, is_least=True),
        limit=100.0 * _MIN_BAND_SHARE,
        unit="%",
        meaning="of the errors within two sigma",
        advice="Errors are larger than the uncertainty of coefficients, start, sensors and process noise. The "
        "structure of the model is wrong for this manoeuvre, or process noise or covariance is too small (run `auvid "
        "tune`). 0 % means that the model diverged.",
        is_least=True,
    )
    return [too_small, _too_large(name, banded)]


def _too_large(name: str, rows: Sequence[Prediction]) -> Check:
    """Check, by signal and over all horizons, that some errors leave their band.

    Errors of the coefficients are the same at every start and may be small. So a signal counts only if at some horizon
    enough errors are independent.
    """
    within: dict[str, float] = {}
    for signal in dict.fromkeys(row.signal for row in rows):
        own = [
            row for row in rows if row.signal == signal and (row.expected_rmse or 0.0) * _MAX_NOISE_SHARE > row.noise
        ]
        if not any((row.independent or 0.0) >= _MIN_INDEPENDENT for row in own):
            continue
        if count := sum(row.measurements for row in own):
            hits = sum((row.share_within_band or 0.0) * row.measurements for row in own)
            within[signal] = 100.0 * hits / count
    if not within:
        statistic, threshold = "-", f"{_MIN_INDEPENDENT:g} independent errors larger than noise"
        return Check.of(
            name, "ahead", UNCERTAINTY_NOT_TOO_LARGE, statistic=statistic, threshold=threshold, passed=True, advice=""
        )
    return Check.of_values(
        name,
        "ahead",
        UNCERTAINTY_NOT_TOO_LARGE,
        within,
        limit=100.0 * _MAX_BAND_SHARE,
        unit="%",
        meaning="of the errors within two sigma",
        advice="The model is better than its uncertainty: its own data were harder to predict, or process noise is set "
        "too large (run `auvid tune`).",
    )


def _worst(values: Sequence[tuple[Prediction, float]], is_least: bool = False) -> dict[str, float]:
    """Return the largest (or smallest) value of each signal, by signal and horizon."""
    worst: dict[str, tuple[Prediction, float]] = {}
    for row, value in sorted(values, key=lambda pair: pair[1], reverse=not is_least):
        worst.setdefault(row.signal, (row, value))
    return {f"{row.signal} at {row.horizon_s:g} s": value for row, value in worst.values()}
