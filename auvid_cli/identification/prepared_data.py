"""A dataset as estimators, bounds and free runs go through it: prepared once, and handed on."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.identification import Identification
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.data.acting_inputs import as_acting
from auvid_cli.data.dataset import Dataset, SensorRecord
from auvid_cli.identification.found_delays import FoundDelays
from auvid_cli.identification.segmentation import used_segments
from auvid_cli.identification.timeline import Timelines, first_measured, initial_motion, measuring_sensors
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Array = NDArray[np.float64]


class Segment(NamedTuple):
    """A segment of the data that is used, and where its motion starts.

    Attributes
    ----------
    dataset : Dataset
        With the samples of all sensors within the segment.
    timelines : Timelines
        Of the sensors that are listened to, with the fins where they were.
    measured : dict of float
        Motion and moving states beside it, as the depth, as measured by the start, by symbol, SI.
    """

    dataset: Dataset
    timelines: Timelines
    measured: dict[str, float]

    @property
    def motion(self) -> Array:
        """Return the motion as measured by the start, shape (9,)."""
        return np.array([self.measured[symbol] for symbol in MOTION_SYMBOLS])


@dataclass(frozen=True)
class PreparedData:
    """What is used of a dataset.

    Attributes
    ----------
    dataset : Dataset
    measuring : dict of SensorRecord
        The sensors that estimators listen to, by name, with all of their samples.
    segments : tuple of Segment
        At least one, in time order.
    delays : FoundDelays or None
        Those that were found, where settings ask for some; they state them then.
    """

    dataset: Dataset
    measuring: dict[str, SensorRecord]
    segments: tuple[Segment, ...]
    delays: FoundDelays | None = None

    @property
    def experiment(self) -> RunSettings:
        """Return the settings that the data are prepared for."""
        return self.dataset.experiment

    def with_settings(self, experiment: RunSettings) -> "PreparedData":
        """Return the same data prepared for other settings; from anew only if these cut or move something otherwise."""
        if _what_prepares(experiment) != _what_prepares(self.experiment):
            return prepare(replace(self.dataset, experiment=experiment))
        segments = (s._replace(dataset=replace(s.dataset, experiment=experiment)) for s in self.segments)
        return replace(self, dataset=replace(self.dataset, experiment=experiment), segments=tuple(segments))


def prepare(dataset: Dataset) -> PreparedData:
    """Choose the sensors and the segments that settings ask for, and merge the samples of each in time order.

    Raises
    ------
    DataError
        If no sensor measures motion, inputs are missing that the vehicle's terms are made of, one states no positive
        noise, or nothing of the data is left.
    """
    settings = dataset.experiment.identification
    dataset.inputs.check_for(dataset.experiment.vehicle.coefficient_set)
    timely = replace(dataset, sensors=on_time(dataset.sensors, settings))
    measuring, inputs = measuring_sensors(timely), as_acting(dataset.inputs, dataset.experiment)
    segments = []
    for data in used_segments(timely, measuring):
        records = {name: data.sensors[name] for name in measuring}
        start, motion = initial_motion(data, records)
        measured = dict(zip(MOTION_SYMBOLS, motion.tolist(), strict=True))
        for state in FURTHER_STATES:
            if state.sensor in measuring:
                measured[state.quantity.symbol] = first_measured(measuring[state.sensor], start)
        segments.append(Segment(data, Timelines(inputs, records, start, settings.integration_step), measured))
    return PreparedData(dataset, measuring, tuple(segments))


def on_time(sensors: dict[str, SensorRecord], settings: Identification) -> dict[str, SensorRecord]:
    """Return records with the times at which their samples were taken, as settings have it."""
    return {
        name: replace(record, time=record.time - settings.delays[name]) if name in settings.delays else record
        for name, record in sensors.items()
    }


def _what_prepares(experiment: RunSettings) -> tuple[object, ...]:
    settings = experiment.identification
    moved = settings.inputs, settings.delays, experiment.vehicle.actuators, settings.integration_step
    return settings.attitude_from, settings.use, settings.measurement_noise, *moved
