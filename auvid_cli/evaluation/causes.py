"""What may be behind innovations that are no noise: the likeliest first, by what each would gain in log-likelihood."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from auvid_cli.data.estimate import N_LAGS, Estimate, Innovations
from auvid_cli.data.faults import Cause

Array = NDArray[np.float64]

LARGEST_FAULT = 3.5
"""Standard deviations of its size by which a fault may look present; chosen as in `auvid_cli.evaluation.judgement`."""
# Log-likelihood; as much as a fault that would make the estimate doubtful.
_WORTH_NAMING = 0.5 * LARGEST_FAULT**2
_MOST_NAMED = 3
_TUNE = "`auvid tune` finds how much"
_TUNE_SENSORS = "`auvid tune --sensors` finds how much"


def likely_causes(estimate: Estimate) -> list[Cause]:
    """List what the innovations of an estimate look like, the likeliest first.

    Parameters
    ----------
    estimate : Estimate
        Best the smoother's, which has been tested for faults. A fault that scores z gains z^2 / 2. It leaves errors
        that last: where the likeliest explains most of these, they are named with what they gain beyond it.
    """
    faults = [
        Cause(0.5 * test.z**2, str(test), test.fault.remedy)
        for test in estimate.faults
        if not test.fault.is_alternative
    ]
    told = list(told_as_noise(estimate))
    noises = [noise_cause(*of_sensor) for of_sensor in told]
    if any(noise.gain > _WORTH_NAMING and noise.lasts for noise in noises):
        # What lasts asks for more process noise, whatever the innovations of another sensor look like.
        noises = [noise_cause(*of_sensor, or_less_process_noise=False) for of_sensor in told]
    likeliest = max((fault.gain for fault in faults), default=0.0)
    noises = [
        noise._replace(gain=noise.gain - likeliest)
        if noise.lasts and likeliest < noise.gain < 2.0 * likeliest
        else noise
        for noise in noises
    ]
    likely = [cause for cause in [*faults, *noises] if cause.gain > _WORTH_NAMING]
    return sorted(likely, key=lambda cause: -cause.gain)


def causes_text(causes: list[Cause]) -> str:
    """Write the likeliest causes down; empty if there are none."""
    return "; or ".join(map(str, causes[:_MOST_NAMED]))


def told_as_noise(estimate: Estimate) -> Iterator[tuple[str, Innovations]]:
    """Yield sensors with innovations that should be noise as it is stated; that of an AHRS is overstated on purpose."""
    for sensor, innovations in estimate.innovations.items():
        if (sensor != "attitude" or not is_from_ahrs(estimate)) and innovations.used().any():
            yield sensor, innovations


def noise_cause(sensor: str, innovations: Innovations, or_less_process_noise: bool = True) -> Cause:
    """Say what noise would explain the innovations of a sensor, and what it would gain.

    That less process noise may explain them is left out unless `or_less_process_noise`.

    An autoregression of their own variance has over white noise of the stated one n / 2 (NIS - 1 - log NIS) by its size
    and, for each component, -n / 2 log(1 - R^2) by its memory, less the number of its coefficients (Akaike, IEEE Trans.
    Autom. Control 19(6), 1974).
    """
    tally, (correlation, samples) = innovations.sums(), innovations.autocorrelation
    nis = tally.mean_nis
    by_size = 0.5 * float(tally.components.sum()) * (nis - 1.0 - np.log(nis)) if nis > 0.0 else 0.0
    explained = np.array([_explained_by_the_past(row) for row in correlation])
    by_memory = float(np.sum(np.maximum(-0.5 * samples * np.log1p(-explained) - N_LAGS, 0.0)))
    if nis < 1.0 and by_memory <= by_size:
        return Cause(by_size, f"noise of {sensor} that is stated too large", _TUNE_SENSORS)
    if nis >= 1.0 and by_memory <= _WORTH_NAMING:
        return Cause(by_size, f"more noise of {sensor} than stated, or more process noise", _TUNE_SENSORS)
    # White noise of another size would explain the size alone.
    gain = by_memory + by_size if nis >= 1.0 else by_memory
    if float(correlation[:, 0] @ samples) < 0.0:
        # What was corrected too far is corrected back.
        or_less = ", or less process noise" if or_less_process_noise else ""
        return Cause(gain, f"more noise of {sensor} than stated{or_less}", _TUNE_SENSORS)
    lasting = f"errors of {sensor} that last, or motion that the model does not explain"
    remedy = (
        f"more process noise ({_TUNE}), a disturbance (`auvid tune --disturbance` finds whether), or its bias "
        "(identification.estimate.biases)"
    )
    return Cause(gain, lasting, remedy, lasts=True)


def _explained_by_the_past(correlation: Array) -> float:
    """Return the share of the variance that an autoregression predicts, by the equations of Yule and Walker."""
    if not correlation.any():
        return 0.0
    weights = solve_toeplitz(np.append(1.0, correlation[:-1]), correlation)
    return float(np.clip(correlation @ weights, 0.0, 0.999))


def is_from_ahrs(estimate: Estimate) -> bool:
    """Say whether an attitude was used that an AHRS computed."""
    return "attitude" in estimate.innovations and estimate.experiment.has_ahrs
