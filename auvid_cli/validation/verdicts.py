"""Verdicts on predictions."""

from collections.abc import Callable, Mapping, Sequence

from auvid_cli.data.checks import Check
from auvid_cli.validation.initial_states import LARGEST_NIS
from auvid_cli.validation.results import AHEAD, NO_WIDER, Prediction

# Standard deviations of a measurement from which an error is more than noise.
_SIGMAS = 3.0
# Over a short time what is not known of the start makes all models nearly alike.
_LARGEST_RATIO = 1.1
# Times as far as the measurements ever go from their mean.
_LARGEST_EXCURSION = 10.0
# Of the errors within two standard deviations it should be 95 %; starts that follow each other are alike.
_SMALLEST_SHARE, _LARGEST_SHARE = 0.85, 0.995
# Of fewer errors that share is too small by chance now and then, where there are dozens of rows.
_FEWEST = 60
# A band of which the stated noise of the measurement is so much says nothing of the model where it is too wide.
_MOSTLY_NOISE = 0.7
# Of so many independent errors a band that is right leaves out at least one with a probability of 95 %, 1 - 0.95^59.
_ENOUGH = 59.0


def verdicts(
    name: str, rows: Sequence[Prediction], excursion: Mapping[str, float], nis: Mapping[str, float], status: str
) -> list[Check]:
    """Return all verdicts on the predictions of one estimate.

    Parameters
    ----------
    name : str
        Of the filter.
    rows : sequence of Prediction
    excursion : mapping
        Of the free run, see `FreeRunFit`.
    nis : mapping
        Of the filter that finds the starts, by sensor, see `InitialStates`.
    status : str
        Of that filter.
    """
    ahead = [row for row in rows if row.kind == AHEAD]
    stable = Check.of_values(
        name,
        "free run",
        "stable",
        excursion,
        limit=_LARGEST_EXCURSION,
        unit="times",
        meaning="the reach of the measurements",
        advice="Left to itself the model runs away. A vehicle that is unstable in open loop does so too: judge it by "
        "the predictions ahead; else the coefficients are wrong.",
    )
    followed = Check.of(
        name,
        "start",
        "motion followed",
        statistic=status,
        threshold="to the end of the data",
        passed=status == "completed",
        advice="With this model no filter follows these measurements: predictions were made as far as it came.",
    )
    checks = [stable, followed]
    if ahead:
        checks += [
            _better(name, "constant velocity", ahead, lambda row: row.constant_velocity_rmse),
            _better(name, "the prior", ahead, lambda row: row.prior_rmse),
            *_band(name, ahead),
        ]
    checks.append(
        Check.of_values(
            name,
            "one measurement ahead",
            "NIS",
            nis,
            limit=LARGEST_NIS,
            meaning="of a component",
            advice="From one measurement to the next the model errs more than its settings say: its coefficients are "
            "off, it misses something here, or these sensors are worse than stated.",
            fails=False,
        )
    )
    return checks


def _better(name: str, other: str, rows: Sequence[Prediction], rmse_of: Callable[[Prediction], float | None]) -> Check:
    """Judge whether the model errs less than another, wherever that errs by more than noise."""
    ratios = []
    for row in rows:
        theirs = rmse_of(row)
        if theirs is not None and theirs > _SIGMAS * row.noise:
            ratios.append((row, row.rmse / theirs if row.rmse is not None else float("inf")))
    if not ratios:
        return Check.of(
            name,
            "ahead",
            f"better than {other}",
            statistic="-",
            threshold="something to predict",
            passed=None,
            advice="It errs by noise alone or fails.",
        )
    return Check.of_values(
        name,
        "ahead",
        f"better than {other}",
        _worst(ratios),
        limit=_LARGEST_RATIO,
        unit="times",
        meaning="its error, where that is no noise",
        advice="The model is no use there: the coefficients behind that motion are wrong, or the vehicle has changed.",
    )


def _band(name: str, rows: Sequence[Prediction]) -> list[Check]:
    """Judge whether the stated uncertainty is that of the errors: not too small, nor, over all horizons, too large."""
    banded = [row for row in rows if row.share_within_band is not None]
    # What blew up has no band, and a band that is not there holds nothing.
    expected = [row for row in rows if row.draws or row.share_within_band is not None]
    shares = [(row, row.share_within_band or 0.0) for row in expected if row.measurements >= _FEWEST]
    if not shares:
        return []
    too_small = Check.of_values(
        name,
        "ahead",
        "explained by its uncertainty",
        _worst(shares, is_least=True),
        limit=_SMALLEST_SHARE,
        meaning="of the errors within two sigma",
        advice="The errors are larger than coefficients, start, sensors and process noise are uncertain: the structure "
        "of the model does not hold for this manoeuvre, or process noise or covariance is too small (`auvid tune`). "
        "Where the share is 0 the model blew up.",
        is_least=True,
    )
    return [too_small, _not_too_wide(name, banded)]


def _not_too_wide(name: str, rows: Sequence[Prediction]) -> Check:
    """Judge, by signal and over all horizons, whether bands are never left.

    The coefficients' error is the same from every start, and may be less than their deviation: only signals count of
    which, at some horizon, enough errors are independent.
    """
    within: dict[str, float] = {}
    for signal in dict.fromkeys(row.signal for row in rows):
        own = [row for row in rows if row.signal == signal and (row.expected_rmse or 0.0) * _MOSTLY_NOISE > row.noise]
        if not any((row.independent or 0.0) >= _ENOUGH for row in own):
            continue
        if count := sum(row.measurements for row in own):
            within[signal] = sum((row.share_within_band or 0.0) * row.measurements for row in own) / count
    if not within:
        statistic, threshold = "-", f"{_ENOUGH:g} independent errors of more than noise"
        return Check.of(name, "ahead", NO_WIDER, statistic=statistic, threshold=threshold, passed=True, advice="")
    return Check.of_values(
        name,
        "ahead",
        NO_WIDER,
        within,
        limit=_LARGEST_SHARE,
        meaning="of the errors within two sigma",
        advice="The model is better than its bands: its own data were harder to predict, or `auvid tune` finds less "
        "process noise than is stated.",
    )


def _worst(values: Sequence[tuple[Prediction, float]], is_least: bool = False) -> dict[str, float]:
    """Return the largest value of each signal, or the least, with its horizon."""
    worst: dict[str, tuple[Prediction, float]] = {}
    for row, value in sorted(values, key=lambda pair: pair[1], reverse=not is_least):
        worst.setdefault(row.signal, (row, value))
    return {f"{row.signal} at {row.horizon_s:g} s": value for row, value in worst.values()}
