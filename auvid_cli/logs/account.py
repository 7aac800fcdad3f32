"""What was done to a sensor or an input on its way from the log, to be said."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.logs.clock import Order


class Account(NamedTuple):
    """What became of one sensor or input.

    Attributes
    ----------
    name : str
    samples : int
    rate : float
        Hz, by the median interval.
    span : tuple of float
        s, first and last.
    missing : int
        Samples without any component.
    duplicates : int
        Rows at the time of an earlier one, left out.
    remarks : tuple of str
    """

    name: str
    samples: int
    rate: float
    span: tuple[float, float]
    missing: int
    duplicates: int
    remarks: tuple[str, ...]


def account_of(
    name: str, time: NDArray[np.float64], missing: int, order: Order, rollovers: int, remarks: tuple[str, ...]
) -> Account:
    """Account of a sensor or input that kept samples at `time`, s."""
    said = (
        (order.backward, f"time went back in {order.backward} rows, by up to {order.furthest_back:.3g} s: sorted"),
        (order.without_time, f"{order.without_time} rows without a time left out"),
        (rollovers, f"the hour or the day of the clock ended, {rollovers} in all: taken to go on"),
    )
    own = tuple(text for count, text in said if count)
    rate = 1.0 / float(np.median(np.diff(time))) if time.size > 1 else 0.0
    span = float(time[0]), float(time[-1])
    return Account(name, time.size, rate, span, missing, order.duplicates, (*own, *remarks))
