"""A part of a dataset, as if nothing else had been recorded."""

from dataclasses import replace

import numpy as np

from auvid_cli.data.dataset import Dataset, InputRecord
from auvid_cli.errors import DataError


def within(dataset: Dataset, begin: float, end: float) -> Dataset:
    """Cut inputs and all sensors to a span of time, s; an input that holds as it begins, or ends, is known there.

    Raises
    ------
    DataError
        If it ends before it begins, no sensor says anything in that time, or no input has begun by its end.
    """
    if not begin < end:
        raise DataError(f"a part begins before it ends, and not at t = {begin:g} s for an end at {end:g} s")
    if not dataset.inputs.time[0] < end:
        raise DataError(f"the inputs begin at t = {dataset.inputs.time[0]:g} s, after the end at {end:g} s")
    window = dataset.sensors_between(begin, end)
    if not any(record.time.size for record in window.sensors.values()):
        raise DataError(f"no sensor says anything from t = {begin:g} s to {end:g} s")
    inputs = dataset.inputs.between(begin, end)
    if inputs.time[-1] < end <= dataset.inputs.time[-1]:
        inputs = InputRecord(np.append(inputs.time, end), np.vstack([inputs.values, inputs.values[-1:]]))
    return replace(window, inputs=inputs)
