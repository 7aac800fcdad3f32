"""A part of a dataset, as if nothing else had been recorded."""

from dataclasses import replace

import numpy as np

from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.errors import DataError


def part_of(dataset: Dataset, begin: float, end: float) -> Dataset:
    """Cut inputs and all sensors to a span of time, s; an input that holds when it begins is known from there on.

    Raises
    ------
    DataError
        If no sensor says anything in that time, or no input has begun by its end.
    """
    if not dataset.inputs.time[0] < end:
        raise DataError(f"the inputs begin at t = {dataset.inputs.time[0]:g} s, after the end at {end:g} s")
    sensors = {}
    for name, record in dataset.sensors.items():
        own = slice(*np.searchsorted(record.time, [begin, np.nextafter(end, np.inf)]))
        sensors[name] = SensorRecord(record.time[own], record.values[own], record.standard_deviation)
    if not any(record.time.size for record in sensors.values()):
        raise DataError(f"no sensor says anything from t = {begin:g} s to {end:g} s")
    time, values = dataset.inputs.time, dataset.inputs.values
    first = max(int(np.searchsorted(time, begin, side="right")) - 1, 0)
    past = max(int(np.searchsorted(time, end, side="right")), first + 1)
    inputs = InputRecord(np.maximum(time[first:past], begin), values[first:past])
    return replace(dataset, inputs=inputs, sensors=sensors)
