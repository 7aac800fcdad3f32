"""Errors of predictions: checks, and their growth with the horizon in excess of the stated uncertainty."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.checks import Check
from auvid_cli.validation.motion_prediction import SignalSize
from auvid_cli.validation.predictions import HORIZONS, MAX_FINITE, Sample
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
    independent_errors,
)
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS

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
    """Check that the stated uncertainty is not too small at any horizon. Over all horizons it must not be too large."""
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
        advice="The predictions are better than stated: the data of the estimate were harder to predict, or process "
        "noise is set too large (run `auvid tune`).",
    )


def _worst(values: Sequence[tuple[Prediction, float]], is_least: bool = False) -> dict[str, float]:
    """Return the largest (or smallest) value of each signal, by signal and horizon."""
    worst: dict[str, tuple[Prediction, float]] = {}
    for row, value in sorted(values, key=lambda pair: pair[1], reverse=not is_least):
        worst.setdefault(row.signal, (row, value))
    return {f"{row.signal} at {row.horizon_s:g} s": value for row, value in worst.values()}


_MIN_ERRORS = 20  # of a mean square: its standard error is then about a third
_MIN_SIGMAS_ANY = 3.5  # excess of the mean square of any of ten signals that is significant, standard deviations
_MIN_SIGMAS_OTHER = 2.0  # the same of each signal, if any is significant
_TURNS = ("v", "w", "q", "r")
# By signal: motion that its errors are proportional to. An angle depends on its rate, depth on pitch and heave; turns
# in either plane slow a vehicle down and roll it.
_GROWS_WITH = {
    "u": ("u", *_TURNS),
    "p": ("p", *_TURNS),
    "phi": ("p", *_TURNS),
    "theta": ("q",),
    "psi": ("r",),
    "down": ("w", "q"),
}
# A turn to either side slows a vehicle down equally: errors of this signal are proportional to the square of turns.
_SQUARED_SIGNAL = "u"


class ErrorGrowth(NamedTuple):
    """Variance of errors in excess of the stated one, and the motion of the vehicle meanwhile.

    Effects that the model lacks are proportional to the motion (missing drag, nonlinear lift), in surge to its square.
    """

    variance: dict[tuple[str, float], float]  # excess by signal and horizon, s; SI
    # The part due to a constant error (a weight or a trim that the model lacks), independent of the motion
    steady: dict[tuple[str, float], float]
    by_process_noise: dict[tuple[str, float], float]  # variance due to process noise, independent of the motion
    moved: dict[str, float]  # variance of each signal without noise, SI

    def in_motion(self, sizes: Mapping[str, SignalSize]) -> dict[tuple[str, float], float]:
        """Return the variance in excess of process noise for other data, SI, scaled by their motion."""
        moved = _moved(sizes)
        ratio = {symbol: moved[symbol] / self.moved[symbol] for symbol in moved if symbol in self.moved}

        def grown(symbol: str, other: str) -> float:
            return ratio[other] ** 2 if symbol == _SQUARED_SIGNAL != other else ratio[other]

        scale = {
            symbol: max((grown(symbol, k) for k in _GROWS_WITH.get(symbol, (symbol,)) if k in ratio), default=1.0)
            for symbol in sizes
        }
        grown_by_motion = {
            (symbol, h): scale[symbol] * v + max(1.0 - scale[symbol], 0.0) * self.steady[symbol, h]
            for (symbol, h), v in self.variance.items()
            if symbol in scale
        }
        return {place: max(v - self.by_process_noise[place], 0.0) for place, v in grown_by_motion.items()}


def error_growth(samples: Sequence[Sample], noisy: Sequence[Sample], sizes: Mapping[str, SignalSize]) -> ErrorGrowth:
    """Return the significant excess of mean squared errors over the stated variance; it never falls with the horizon.

    Horizons with too few starts have the excess of the longest other one.

    Parameters
    ----------
    samples, noisy : sequence of Sample
        Predictions of the estimate's own data from many starts, with variances without and with process noise.
    sizes : mapping of SignalSize
        Sizes of the signals of these data.
    """
    of_signals = {
        symbol: [
            (plain, other)
            for plain, other in zip(samples, noisy, strict=True)
            if MOTION_AND_DEPTH_SYMBOLS[plain.target.column] == symbol
        ]
        for symbol in sizes
    }
    errors = {symbol: _Errors.by_horizon([plain for plain, _ in own]) for symbol, own in of_signals.items()}
    sigmas = {symbol: _excess_sigmas([*by_horizon.values()]) for symbol, by_horizon in errors.items()}
    # One of ten signals exceeds two standard deviations by chance.
    is_significant = max(sigmas.values(), default=0.0) > _MIN_SIGMAS_ANY
    variance, steady, by_process_noise = {}, {}, {}
    for symbol, by_horizon in errors.items():
        grows = is_significant and sigmas[symbol] > _MIN_SIGMAS_OTHER
        largest, constant, noise = 0.0, 0.0, 0.0
        for horizon in HORIZONS:
            if horizon in by_horizon:
                added = [
                    other.variance - plain.variance
                    for plain, other in of_signals[symbol]
                    if plain.target.horizon == horizon
                ]
                found = by_horizon[horizon]
                if grows and found.excess > largest:
                    largest, constant = found.excess, min(found.squared_mean, found.excess)
                noise = max(noise, float(np.mean(added)))
            variance[symbol, horizon], steady[symbol, horizon] = largest, constant
            by_process_noise[symbol, horizon] = noise
    return ErrorGrowth(variance, steady, by_process_noise, _moved(sizes))


class _Errors(NamedTuple):
    """Errors of one signal at one horizon, SI, by start, and their stated variance."""

    error: Array
    stated: Array

    @classmethod
    def by_horizon(cls, samples: Sequence[Sample]) -> "dict[float, _Errors]":
        """Return the errors at each horizon with enough starts and without a diverged model."""
        found = {}
        for horizon in HORIZONS:
            own = [sample for sample in samples if sample.target.horizon == horizon]
            error = np.array([sample.target.measurement - sample.named[0] for sample in own])
            stated = np.array([sample.variance for sample in own])
            if len(own) >= _MIN_ERRORS and (np.abs(error) < MAX_FINITE).all() and np.isfinite(stated).all():
                found[horizon] = cls(error, stated)
        return found

    @property
    def excess(self) -> float:
        """Return the excess of the mean square over the stated variance."""
        return float(np.mean(self.error**2 - self.stated))

    @property
    def squared_mean(self) -> float:
        """Return the square of the mean, without the part due to chance."""
        independent = independent_errors(self.error - self.error.mean())
        return max(float(self.error.mean() ** 2 - self.error.var() / independent), 0.0)


def _excess_sigmas(horizons: Sequence[_Errors]) -> float:
    """Return the excess of a signal's squared errors over all horizons, in standard deviations of chance."""
    normalised = [errors.error / np.sqrt(errors.stated) for errors in horizons]
    if not normalised:
        return 0.0
    independent = sum(independent_errors(errors) for errors in normalised)
    return (float(np.mean(np.concatenate(normalised) ** 2)) - 1.0) / np.sqrt(2.0 / independent)


def _moved(sizes: Mapping[str, SignalSize]) -> dict[str, float]:
    """Return the variance of each signal without noise; at least that of the noise."""
    return {symbol: max(s.variance - s.deviation**2, s.deviation**2) for symbol, s in sizes.items()}
