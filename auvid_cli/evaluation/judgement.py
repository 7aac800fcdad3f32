"""Judge estimates: signs of coefficients, advice, and whether an estimate can be trusted."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from math import inf
from typing import NamedTuple

import numpy as np

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.extra_states import AugmentedStates, BiasName
from auvid_cli.config.sanity import MAX_FIN_STRENGTH, MIN_FIN_STRENGTH
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import LARGEST_FAULT, Cause, FaultKind, FaultTest
from auvid_cli.data.innovations import N_LAGS, NIS_WINDOW, InnovationStatistics
from auvid_cli.evaluation.innovations import (
    LARGEST_MEAN_NIS,
    LARGEST_NIS_IN_WINDOW,
    inconsistency_of,
    is_from_ahrs,
    mean_nis,
    noise_cause,
    sensors_without_ahrs,
    windowed_nis,
)
from auvid_cli.vehicle.coefficients import DRAG_SYMBOLS

# Drag along each axis takes energy. Positive rudder pushes the stern to starboard, a positive stern plane pushes it up.
DRAG = dict.fromkeys(DRAG_SYMBOLS, -1)
FINS = {"Y_uudr": 1, "N_uudr": -1, "Z_uude": -1, "M_uude": -1}
# Moments of fins.
_MOMENTS = ("N_uudr", "M_uude")
# Errors that make the DVL a nonlinear sensor.
_NONLINEAR = [
    name
    for name in BiasName
    if any(block.sensor == "dvl" and not block.additive for block in AugmentedStates().blocks_of(name))
]
_NARROW = 1.0  # factor of a prior that suits most runs
_NARROWER = 0.3  # factor of a prior with these errors
# Limits in standard deviations, chosen on simulations of six manoeuvres with and without faults, see docs/studies.md.
LARGEST_NIS = 4.0  # excess of the sum of squares of a sensor's innovations
LARGEST_AHRS_CORRELATION = 0.2  # autocorrelation of innovations of other sensors, due to an AHRS
LARGEST_PORTMANTEAU = 10.0  # excess of the portmanteau statistic of a sensor's innovations
FARTHEST = 2.25  # difference of a coefficient from the smoother's estimate
FARTHEST_MINIMUM = 2.5  # largest difference of a coefficient in another minimum
FARTHEST_SEGMENT = 4.0  # largest difference of a coefficient in one of several segments
_LIMITS = {FaultKind.ANOTHER_MINIMUM: FARTHEST_MINIMUM, FaultKind.SEGMENT: FARTHEST_SEGMENT}
_MOVES_NONE = "; it moves no coefficient by more than its total standard deviation"
_SIGNIFICANT = 5.0  # distance of a coefficient from 0
_MIN_MEASUREMENTS = 200  # of a component; fewer give no autocorrelation
# Errors of an AHRS are correlated in time and can imitate many faults.
_WITHOUT_AHRS = (
    "first replace the AHRS by recorded accelerometer and magnetometer (identification.attitude_from=inertial) "
    "or a better attitude; if the fault remains, "
)


def wrong_drag_signs(estimate: Estimate, sigmas: float) -> list[str]:
    """Return drag coefficients of the wrong sign, by more than `sigmas` standard deviations."""
    return _contradicting(estimate, DRAG, sigmas)


def reversed_fins(estimate: Estimate, sigmas: float) -> list[str]:
    """Return fin coefficients with the opposite sign of the shipped vehicles."""
    return _contradicting(estimate, FINS, sigmas)


def unlike_the_vehicle_file(estimate: Estimate, sigmas: float) -> list[str]:
    """Return the coefficients of fins whose sign is opposite to that in the vehicle file."""
    stated = estimate.experiment.vehicle.coefficients.by_symbol()
    return _contradicting(estimate, {symbol: stated[symbol] for symbol in FINS if symbol in stated}, sigmas)


def out_of_proportion(estimate: Estimate, sigmas: float) -> dict[str, float]:
    """Return fin moments that differ significantly from the vehicle file, as multiples of its values.

    The standard deviations are those by the data: the limits already leave room for errors of known quantities.
    """
    stated = estimate.experiment.vehicle.coefficients.by_symbol()
    values, deviations = estimate.final_coefficients(), estimate.data_deviations()
    found = {}
    for symbol in _MOMENTS:
        if symbol in deviations and stated.get(symbol):
            times, unsure = abs(values[symbol] / stated[symbol]), sigmas * deviations[symbol] / abs(stated[symbol])
            if times - unsure > MAX_FIN_STRENGTH or times + unsure < MIN_FIN_STRENGTH:
                found[symbol] = times
    return found


def _contradicting(estimate: Estimate, signs: Mapping[str, float], sigmas: float) -> list[str]:
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    return [
        symbol
        for symbol, sign in signs.items()
        if symbol in deviations and values[symbol] * sign < 0.0 and abs(values[symbol]) > sigmas * deviations[symbol]
    ]


def advice_on_nonlinearity(estimate: Estimate) -> str:
    """Return advice for a Kalman filter with states that make a sensor nonlinear; else empty."""
    settings = estimate.experiment.identification
    nonlinear = [name.value for name in settings.estimate.biases if name in _NONLINEAR]
    if not nonlinear or estimate.is_free_run_fit or estimate.filter == FilterName.SMOOTHER:
        return ""
    narrow = f"needs a narrow prior (--set identification.prior.factor={_NARROWER:g})"
    return (
        f"if {' and '.join(nonlinear)} is estimated, a Kalman filter "
        f"{narrow if settings.prior.factor > _NARROWER else 'may diverge even from a narrow prior'}; "
        "output_error needs none (--filter output_error)"
    )


def remedy_of_linearisation(estimate: Estimate) -> str:
    """Return advice for an EKF whose innovations are too large only at the start; else empty."""
    is_ekf = estimate.filter == FilterName.EKF
    if not is_ekf or not mean_nis(estimate) <= LARGEST_MEAN_NIS:
        return ""
    windows = [windowed_nis(innovations.sums()) for innovations in estimate.innovations.values()]
    begin = min((float(window[0, 0]) for window in windows if len(window)), default=0.0)
    late = [nis for window in windows for start, nis in window if start > begin + 0.5 * NIS_WINDOW]
    if any(nis > LARGEST_NIS_IN_WINDOW for nis in late):
        return ""
    return (
        "an EKF linearises about its estimate, which is wrong in the first seconds; its standard deviations stay too "
        "small, with either ekf.transition: use the CKF, the TUKF or the smoother, or a narrower prior "
        "(identification.prior.factor)"
    )


def advice_on_divergence(estimate: Estimate) -> str:
    """Return advice for a filter that diverged."""
    settings = estimate.experiment.identification
    if remedy := advice_on_nonlinearity(estimate):
        return remedy
    if estimate.unconverged:
        return _remedy_of_unconverged(estimate)
    if estimate.is_free_run_fit:
        by_prior = ", or use the prior (--set identification.output_error.use_prior=true)"
        return (
            "the data do not determine the model, or it is unstable in open loop: use another filter"
            f"{'' if settings.output_error.use_prior else by_prior}"
        )
    if settings.prior.from_estimate is not None:
        return "the earlier estimate (identification.prior.from_estimate) may not fit these data: run without it"
    if settings.prior.factor > _NARROW:
        return f"narrow the prior (--set identification.prior.factor={_NARROW:g}), or use another filter"
    return (
        "the prior is already narrow: increase the process noise (identification.process_noise), or use another filter"
    )


def _remedy_of_unconverged(estimate: Estimate) -> str:
    """Return advice for a fit that did not converge: more steps, unless its residuals are large."""
    settings, large = estimate.experiment.identification, "its residuals are larger than the noise"
    if estimate.is_free_run_fit:
        more = f"identification.output_error.max_evaluations={2 * settings.output_error.max_evaluations}"
        held = "" if settings.output_error.use_prior else " or use the prior (output_error.use_prior)"
        elsewhere = (
            f"{large}: allow more steps (--set {more}); if they stay large, fit shorter segments (--use), or use the "
            "smoother"
        )
    else:
        more = f"identification.smoother.max_passes={2 * settings.smoother.max_passes}"
        held = " or narrow the prior (identification.prior.factor)"
        elsewhere = (
            f"{large}, and more steps (--set {more}) seldom help: check signs, units and delays (auvid inspect), and "
            "estimate the process noise (--set identification.noise=estimate, or auvid tune)"
        )
    if not mean_nis(estimate) <= LARGEST_MEAN_NIS:
        return elsewhere
    return (
        f"its residuals are as large as the noise: allow more steps (--set {more}); these data do not determine "
        f"coefficients that still change then: fix them (identification.coefficients){held}"
    )


class Grade(StrEnum):
    """Grade of an estimate, best first."""

    SOUND = "sound"
    UNJUDGED = "unjudged"
    DOUBTFUL = "doubtful"
    INCONSISTENT = "inconsistent"
    DIVERGED = "diverged"


class Judgement(NamedTuple):
    """Whether an estimate may be used.

    Attributes
    ----------
    reason : str
        Reason of the grade; empty if sound.
    remedy : str
        Advice.
    doubted : tuple of str or None
        Coefficients that the doubt concerns; None for all of them.
    """

    grade: Grade
    reason: str = ""
    remedy: str = ""
    doubted: tuple[str, ...] | None = None

    def trusts(self, symbol: str) -> bool:
        """Whether a coefficient may be used."""
        in_part = self.grade is Grade.DOUBTFUL and self.doubted is not None and symbol not in self.doubted
        return self.grade is Grade.SOUND or in_part

    def row(self) -> tuple[str, str, str, str]:
        """Return the values as cells of a table: doubted coefficients separated by spaces, or "all"."""
        doubted = "all" if self.doubted is None else " ".join(self.doubted)
        return str(self.grade), self.reason, self.remedy, doubted

    @property
    def is_against(self) -> bool:
        """Whether the estimate is worse than sound; an unjudged one is not."""
        return self.grade not in (Grade.SOUND, Grade.UNJUDGED)

    @property
    def advice(self) -> str:
        """Return reason and remedy, if any."""
        return "; ".join(part for part in (self.reason, self.remedy) if part)

    def __str__(self) -> str:
        """Return grade, reason and remedy as one sentence without its full stop."""
        return f"{self.grade}: {self.advice}" if self.advice else str(self.grade)


def status_of(estimate: Estimate, judgement: Judgement | None = None) -> str:
    """Return the status of an estimate: as the filter ended, or "inconsistent" and the reason.

    By its own innovations without a `judgement`, which may explain them by those of the smoother.
    """
    if judgement is None:
        reason = inconsistency_of(estimate)
    else:
        reason = judgement.reason if judgement.grade is Grade.INCONSISTENT else ""
    return f"inconsistent: {reason}" if reason else estimate.status


def judge(estimates: Sequence[Estimate]) -> dict[str, Judgement]:
    """Judge estimates of the same data, by filter.

    Parameters
    ----------
    estimates : sequence of Estimate
        One of them of the smoother, if the others are to be judged.
    """
    reference = reference_among(estimates)
    doubt = None if reference is None or not reference.completed else _doubt_of_data(reference)
    return {estimate.filter: _judge(estimate, reference, doubt) for estimate in estimates}


def reference_among(estimates: Sequence[Estimate]) -> Estimate | None:
    """Return the smoother's estimate, by which the others are judged; None if there is none."""
    return next((estimate for estimate in estimates if estimate.filter == JUDGE), None)


def with_considered_errors(estimates: Sequence[Estimate]) -> list[Estimate]:
    """Return estimates of the same data; those without considered errors get those of the smoother."""
    reference = reference_among(estimates)
    if reference is None or reference.considered is None:
        return [*estimates]
    return [
        estimate
        if estimate.considered is not None or estimate.state != reference.state
        else replace(estimate, considered=reference.considered)
        for estimate in estimates
    ]


def judge_one(estimate: Estimate, reference: Estimate | None) -> Judgement:
    """Judge an estimate by that of the smoother of the same data, if there is one."""
    return judge([estimate] if reference is None else [estimate, reference])[estimate.filter]


def _judge(estimate: Estimate, reference: Estimate | None, doubt: Judgement | None) -> Judgement:
    if not estimate.completed:
        return Judgement(Grade.DIVERGED, estimate.failure, advice_on_divergence(estimate))
    inconsistency = inconsistency_of(estimate)
    if inconsistency and not (reference is not None and _is_explained(estimate, reference)):
        known = [
            advice_on_nonlinearity(estimate) or remedy_of_linearisation(estimate),
            "" if doubt is None else doubt.advice,
        ]
        otherwise = "do not use the estimate; check stated noise, biases, outliers and signs (auvid check)"
        remedy = "; ".join(filter(None, known)) or otherwise
        return Judgement(Grade.INCONSISTENT, inconsistency, remedy)
    if reference is None:
        remedy = "run the smoother as well (--filter smoother, without identification.gate)"
        return Judgement(Grade.UNJUDGED, "not judged, because there is no smoother estimate", remedy)
    if not reference.completed:
        return Judgement(Grade.UNJUDGED, f"the smoother, which judges the others, {reference.status}")
    return (
        doubt
        or _doubt_of_distance(estimate, reference)
        or _doubt_of_vehicle(estimate)
        or Judgement(Grade.SOUND, doubted=())
    )


def _is_explained(estimate: Estimate, reference: Estimate) -> bool:
    """Whether errors within the tolerances explain the smoother's innovations, and these are at most as large."""
    if not reference.explained or not reference.completed or inconsistency_of(reference):
        return False
    for sensor, innovations in estimate.innovations.items():
        own, expected = innovations.sums(), reference.innovations[sensor].sums()
        if own.mean_nis > LARGEST_MEAN_NIS * max(expected.mean_nis, 1.0):
            return False
        allowed = {start: LARGEST_NIS_IN_WINDOW * max(nis, 1.0) for start, nis in windowed_nis(expected).tolist()}
        if any(nis > allowed.get(start, LARGEST_NIS_IN_WINDOW) for start, nis in windowed_nis(own).tolist()):
            return False
    return True


def _doubt_of_data(reference: Estimate) -> Judgement | None:
    """Return the judgement by the most likely cause of a smoother's innovations; None if they are as expected."""
    causes = [*_faults(reference), *_noises(reference)]
    worst = max(causes, key=lambda cause: cause.gain, default=None)
    if worst is None:
        return None
    doubted = _doubted(reference, causes)
    named = f"; coefficients in doubt: {', '.join(doubted)}" if doubted else _MOVES_NONE
    which = "" if doubted is None else named
    return Judgement(Grade.DOUBTFUL, f"{worst.name}{which}", worst.remedy, doubted)


def _doubted(reference: Estimate, causes: Sequence[Cause]) -> tuple[str, ...] | None:
    """Return the coefficients that the needed faults move; None for all if these faults do not explain the data."""
    needed = [test for test in reference.faults if test.rank]
    others = [test for test in reference.faults if test.fault.is_alternative and _is_significant(test)]
    if others or not needed or len(causes) > 1:
        return None
    return tuple(dict.fromkeys(symbol for test in needed for symbol in test.moved))


def _noises(reference: Estimate) -> Iterator[Cause]:
    # Errors of an AHRS make the innovations of all sensors autocorrelated, for which the standard deviations allow.
    largest_correlation = LARGEST_AHRS_CORRELATION if is_from_ahrs(reference) else 0.0
    for sensor in sensors_without_ahrs(reference):
        of_sensor = reference.statistics(sensor)
        statistics, beyond = whiteness(of_sensor), ""
        if statistics.nis > LARGEST_NIS:
            beyond = f"are larger than expected (NIS exceeds 1 by {statistics.nis:.1f} sigma)"
        elif statistics.portmanteau > LARGEST_PORTMANTEAU and statistics.correlation > largest_correlation:
            beyond = f"are correlated in time ({statistics.portmanteau:.0f} sigma)"
        if not beyond:
            continue
        cause = noise_cause(sensor, of_sensor)
        # If more noise is stated than there is, standard deviations are too large: that is harmless.
        if statistics.nis >= 0.0 or cause.lasts:
            remedy = f"they look like {cause.name}: {cause.remedy}"
            yield Cause(cause.gain, f"innovations of {sensor} {beyond}", remedy)


def _faults(reference: Estimate) -> Iterator[Cause]:
    """Yield the most significant fault, if there is one."""
    beyond = sorted(filter(_is_significant, reference.faults), key=lambda test: (test.rank or inf, -test.excess))
    if not beyond:
        return
    worst = beyond[0]
    reason, remedy = str(worst), worst.fault.remedy
    if not worst.fault.is_alternative:
        # A model that differs between segments can look like a fault.
        disagreeing = next((f", and {test}" for test in beyond if test.fault.is_alternative), "")
        reason = f"{_ahrs_or(reference)}{reason}{disagreeing}"
        can_replace = is_from_ahrs(reference) and reference.experiment.has_inertial
        remedy = f"{_WITHOUT_AHRS if can_replace else ''}{remedy}"
    yield Cause(0.5 * worst.z**2, reason, remedy)


def _is_significant(test: FaultTest) -> bool:
    return test.excess > _LIMITS.get(test.fault.kind, LARGEST_FAULT)


def _ahrs_or(reference: Estimate) -> str:
    doubted = "errors of the AHRS that are correlated in time, or like " if is_from_ahrs(reference) else ""
    return f"the data look like {doubted}a fault: "


def _doubt_of_distance(estimate: Estimate, reference: Estimate) -> Judgement | None:
    distances = distances_to(estimate, reference)
    farthest = max(distances, key=lambda symbol: distances[symbol], default=None)
    if farthest is None or distances[farthest] <= FARTHEST:
        return None
    reason = f"{farthest} is {distances[farthest]:.1f} standard deviations from the smoother's estimate"
    return Judgement(Grade.DOUBTFUL, reason, "use the smoother's estimate")


def _doubt_of_vehicle(estimate: Estimate) -> Judgement | None:
    """Return a doubt about signs and sizes, which innovations do not show."""
    if pushing := wrong_drag_signs(estimate, _SIGNIFICANT):
        reason = f"drag coefficients have the wrong sign ({', '.join(pushing)})"
        return Judgement(Grade.DOUBTFUL, reason, "a sign in the data is wrong, or the model lacks a term")
    if turned := unlike_the_vehicle_file(estimate, _SIGNIFICANT):
        reason = f"{', '.join(turned)} have the opposite sign of the vehicle file"
        remedy = "change the sign of that fin in the map (sign: -1), or in the vehicle file if the log is right"
        return Judgement(Grade.DOUBTFUL, reason, remedy)
    if far := out_of_proportion(estimate, _SIGNIFICANT):
        found = ", ".join(f"{symbol} is {times:.2g} times" for symbol, times in far.items())
        reason = f"{found} the value of the vehicle file"
        remedy = "check unit and scale of that fin in the map; if they are right, correct the vehicle file"
        return Judgement(Grade.DOUBTFUL, reason, remedy)
    return None


def distances_to(estimate: Estimate, reference: Estimate) -> Mapping[str, float]:
    """Return the distances of two estimates in the larger of their standard deviations, by symbol."""
    distances = {}
    for i in estimate.coefficient_rows:
        symbol = estimate.state[i]
        if symbol in reference.state:
            j = reference.state.index(symbol)
            deviation = max(estimate.standard_deviation[-1, i], reference.standard_deviation[-1, j])
            distances[symbol] = float(abs(estimate.mean[-1, i] - reference.mean[-1, j]) / deviation)
    return distances


class Whiteness(NamedTuple):
    """Innovations of a sensor against white noise of their stated variance, in standard deviations of that.

    Attributes
    ----------
    nis : float
        Excess of the sum of squares; its variance accounts for the autocorrelation.
    portmanteau : float
        Statistic of Ljung and Box (Biometrika 65(2), 1978) of the component with the largest one.
    correlation : float
        Largest autocorrelation of a component.
    """

    nis: float
    portmanteau: float
    correlation: float


def whiteness(of_sensor: InnovationStatistics) -> Whiteness:
    """Compare innovations with white noise; where there are few, NIS alone."""
    sums, (correlation, samples) = of_sensor
    squares, components = float(sums.squares.sum()), float(sums.components.sum())
    if not components:
        return Whiteness(0.0, 0.0, 0.0)
    enough = samples >= _MIN_MEASUREMENTS
    squared, n = correlation[enough] ** 2, samples[enough]
    # The autocorrelation of the squares of a Gaussian sequence is its autocorrelation squared.
    memory = float(squared.sum(axis=1).max(initial=0.0))
    nis = (squares - components) / np.sqrt(2.0 * components * (1.0 + 2.0 * memory))
    sums = n * (n + 2.0) * (squared / (n[:, None] - np.arange(1, N_LAGS + 1))).sum(axis=1)
    portmanteau = float(((sums - N_LAGS) / np.sqrt(2.0 * N_LAGS)).max(initial=0.0))
    return Whiteness(float(nis), portmanteau, float(np.sqrt(squared.max(initial=0.0))))
