"""Candidates for an addition to a model, ranked by the score tests and innovations of its estimate."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from auvid_cli.config.extra_states import BiasName, ProcessNoise
from auvid_cli.config.identification import INPUTS_DELAY
from auvid_cli.config.settings import three
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.faults import FaultTest
from auvid_cli.evaluation.innovations import noise_cause, sensors_without_ahrs
from auvid_cli.fitting.additions import Addition, addition_for
from auvid_cli.identification.states import CoefficientPrior, coefficient_priors

# Gain in log-likelihood from which an addition is worth it: that of a fault of 3.5 standard deviations, from which an
# estimate is doubtful.
WORTH = 6.0
# Number of candidates of each kind that are tried in a look.
_N_TRIALS = 3
# Factor on the stated process noise from which a disturbance and the noise of a sensor are tried.
_LARGE_NOISE = 3.0
_SENSOR_OF = {"velocity": "dvl", "rate": "gyroscope"}
# Smallest change of the noise of a sensor that is tried, as a logarithm.
_MIN_NOISE_CHANGE = 0.1
# Gain in log-likelihood from which a coefficient that the vehicle file states as 0 is left at 0 with others.
_MIN_ZERO_GAIN = 1.0


class Candidate(NamedTuple):
    """A candidate for an addition, and the gain in log-likelihood that the tests predict."""

    addition: Addition
    expected: float


def candidates(
    estimate: Estimate, present: Collection[Addition], least: ProcessNoise, duration: float
) -> list[Candidate]:
    """Return the candidates for an addition, the best first.

    Parameters
    ----------
    estimate : Estimate
        Of the smoother with the present model.
    present : collection of Addition
        Additions of this model.
    least : ProcessNoise
        Process noise that the user states; more of it means that the model lacks something.
    duration : float
        Of the data, s.
    """
    keys = {addition.key for addition in present if not addition.is_time}
    gains: dict[tuple[str, str], Candidate] = {}
    for candidate in [*_of_faults(estimate, present, duration), *_of_noise(estimate), *_of_prior(estimate)]:
        key = candidate.addition.key
        if key not in keys:
            before = gains.get(key)
            gains[key] = candidate if before is None else max(before, candidate, key=lambda each: each.expected)
    found = [candidate for candidate in gains.values() if candidate.expected > WORTH]
    estimated = estimate.experiment.identification.estimate.biases
    large = [motion for motion, excess in _noise_excesses(estimate, least).items() if excess > _LARGE_NOISE]
    if BiasName.DISTURBANCE not in estimated and large:
        found.append(Candidate(Addition(BiasName.DISTURBANCE.value), WORTH))
    for motion in large:
        # Process noise can hide that a sensor is louder than stated: its innovations are then as large as expected.
        addition = Addition("noise", _SENSOR_OF[motion])
        if addition.name in estimate.innovations and addition.key not in keys | gains.keys():
            found.append(Candidate(addition, WORTH))
    return sorted(found, key=lambda candidate: -candidate.expected)


def by_kind(found: Sequence[Candidate]) -> tuple[list[Candidate], list[Candidate]]:
    """Return the best candidates that are a cause, and those that only describe errors: a disturbance and noise."""
    disturbance = [candidate for candidate in found if candidate.addition.family == BiasName.DISTURBANCE]
    noise = [candidate for candidate in found if candidate.addition.family == "noise"]
    causes = [candidate for candidate in found if candidate not in (*disturbance, *noise)]
    # No test predicts the gain of a disturbance, so it is tried whatever the noise promises.
    return causes[:_N_TRIALS], [*disturbance, *noise][:_N_TRIALS]


def noise_excess(estimate: Estimate, least: ProcessNoise) -> float:
    """Return the largest ratio of the process noise of velocity and rate to the stated one."""
    return max(_noise_excesses(estimate, least).values())


def _noise_excesses(estimate: Estimate, least: ProcessNoise) -> dict[str, float]:
    """Return the largest ratio of the process noise to the stated one, of velocity and of rate."""
    noise = estimate.experiment.identification.process_noise
    pairs = {motion: (three(getattr(noise, motion)), three(getattr(least, motion))) for motion in _SENSOR_OF}
    return {motion: max(a / b for a, b in zip(*pair, strict=True)) for motion, pair in pairs.items()}


def corrected_times(estimate: Estimate, present: Collection[Addition]) -> Iterator[tuple[Addition, FaultTest]]:
    """Yield each delay, or the lag of the fins if the model has it, corrected by the score test of the delay."""
    stated = estimate.experiment.identification.delays
    lag = next((addition for addition in present if addition.family == "lag"), None)
    for test in estimate.faults:
        addition = addition_for(test, 0.0)
        if addition is None or addition.family != BiasName.DELAY:
            continue
        before = stated.get(addition.name, 0.0)
        if addition.name == INPUTS_DELAY and lag is not None:
            addition, before = lag, lag.size
        yield addition._replace(size=before + test.size, deviation=test.standard_deviation), test


def _of_faults(estimate: Estimate, present: Collection[Addition], duration: float) -> Iterator[Candidate]:
    for addition, test in corrected_times(estimate, present):
        expected = 0.5 * test.z**2
        if addition.size > 0.0 or addition.family != "lag":
            yield Candidate(addition, expected)
        other = addition.instead
        if other is not None and other.size > 0.0:
            # Fins that lag look like late inputs. If the model has one of them, the other one may be right.
            is_rival = any(each.key == addition.key for each in present)
            yield Candidate(other, max(expected, 2.0 * WORTH) if is_rival else expected)
    for test in estimate.faults:
        addition = addition_for(test, duration)
        if addition is not None and not addition.is_time:
            yield Candidate(addition, 0.5 * test.z**2)


def _of_noise(estimate: Estimate) -> Iterator[Candidate]:
    for sensor in sensors_without_ahrs(estimate):
        statistics = estimate.statistics(sensor)
        nis = statistics.sums.mean_nis
        if nis > 0.0 and abs(log(nis)) > _MIN_NOISE_CHANGE:
            yield Candidate(Addition("noise", sensor), noise_cause(sensor, statistics).gain)


def _of_prior(estimate: Estimate) -> Iterator[Candidate]:
    """Yield the most likely factor on all standard deviations of the prior, if it is above 1."""
    settings = estimate.experiment
    if settings.identification.prior.from_estimate is not None:
        return
    priors = coefficient_priors(settings.vehicle, settings.identification.prior)
    moments = []
    values, deviations = estimate.final_coefficients(), estimate.final_deviations()
    for symbol in priors.keys() & deviations.keys():
        mean, width = priors[symbol]
        moments.append(((values[symbol] - mean) ** 2 + deviations[symbol] ** 2) / width**2)
    if not moments:
        return
    # Mean square of the distances from the prior mean: 1 is expected.
    square = sum(moments) / len(moments)
    if square > 1.0:
        yield Candidate(Addition("prior", "", sqrt(square)), 0.5 * len(moments) * (square - 1.0 - log(square)))


def needless_coefficients(estimate: Estimate) -> tuple[str, ...]:
    """Return the coefficients that the vehicle file states as 0 and these data do not need.

    Each of them, left at 0 together with those before it, raises the evidence by a factor of e or more. This factor is
    the ratio of the densities at 0 after and before the data (Savage and Dickey; J. M. Dickey, Ann. Math. Stat. 42(1),
    1971). A coefficient whose standard deviation is stated is known to differ from 0, so it is not among them.
    """
    settings = estimate.experiment
    if settings.identification.prior.mean != "vehicle":
        return ()
    stated, known = settings.vehicle.stated_coefficients(), settings.vehicle.stated_deviations()
    priors = coefficient_priors(settings.vehicle, settings.identification.prior)
    rest = [symbol for symbol in estimate.final_deviations() if stated.get(symbol) == 0.0 and symbol not in known]
    found: list[str] = []
    gain = 0.0
    while rest:
        gains = {symbol: _gain_of_zeros(estimate, [*found, symbol], priors) for symbol in rest}
        best = max(gains, key=lambda symbol: gains[symbol])
        if gains[best] - gain < _MIN_ZERO_GAIN:
            break
        gain = gains[best]
        found.append(best)
        rest.remove(best)
    return tuple(found)


def _gain_of_zeros(estimate: Estimate, symbols: Sequence[str], priors: Mapping[str, CoefficientPrior]) -> float:
    """Return the gain in evidence of coefficients at 0, with zero prior means: a ratio of two normal densities."""
    rows = [estimate.state.index(symbol) for symbol in symbols]
    mean, covariance = estimate.mean[-1, rows], estimate.covariance[np.ix_(rows, rows)]
    widths = np.array([priors[symbol].standard_deviation for symbol in symbols])
    _, log_volume = np.linalg.slogdet(covariance / np.outer(widths, widths))
    return -0.5 * float(mean @ np.linalg.solve(covariance, mean) + log_volume)
