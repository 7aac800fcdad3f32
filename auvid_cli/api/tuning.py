"""Noise from the data."""

from collections.abc import Callable

from auvid_cli.api.argument_types import typed
from auvid_cli.data.dataset import Dataset
from auvid_cli.data.tuning import Tuning
from auvid_cli.identification.delays import settle_delays
from auvid_cli.identification.noise_tuning import choose_disturbance, tune_noise
from auvid_cli.identification.prepared_data import prepare


@typed
def tune(
    dataset: Dataset, sensors: bool = False, on_pass: Callable[[], None] | None = None, disturbance: bool = False
) -> Tuning:
    """Find the process noise, and that of the sensors if asked, that makes a dataset most likely.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.
    sensors : bool, default False
        Whether the standard deviations of the sensors are found along; else they count as stated.
    on_pass : callable, optional
        Called before each pass through the data, there or back, of which there are some dozens; what it raises ends
        the search.
    disturbance : bool, default False
        Whether data are tuned without a disturbance and with one, of which it is found how large it is and how long it
        lasts, and which is kept if it is worth the numbers that it takes. Else there is one if settings ask for it, and
        it lasts as long as they say.

    Returns
    -------
    Tuning
        ``noises`` with 95 % intervals, the ``gain`` in log-likelihood, the ``choice`` of a disturbance if there was
        one, and the ``experiment`` with the tuned noise, to put into a dataset with `dataclasses.replace`;
        ``to_pandas()`` makes a table.

    Raises
    ------
    ConfigError
        If a coefficient that is to be held has no value.
    DataError
        If no sensor can be used, or no trajectory follows the data with the noise that is stated.

    Examples
    --------
    >>> tuning = auvid.tune(dataset)
    >>> [noise.setting.rpartition(".")[2] for noise in tuning.noises]
    ['velocity', 'rate', 'attitude']
    """
    find = choose_disturbance if disturbance else tune_noise
    return find(settle_delays(prepare(dataset)), sensors, on_pass or (lambda: None))
