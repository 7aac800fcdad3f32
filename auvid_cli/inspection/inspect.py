"""The whole inspection of a dataset."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import ImportedRun, RunSettings
from auvid_cli.config.plausibility import doubts
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.acting_inputs import acted, as_acting
from auvid_cli.data.check import Check, Checks
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.inspection.actuator_limits import actuator_checks
from auvid_cli.inspection.agreement import rotation_checks
from auvid_cli.inspection.alignment import aligned, alignment_checks, input_alignment
from auvid_cli.inspection.allan import bias_instability
from auvid_cli.inspection.clean_record import Screened, screened
from auvid_cli.inspection.contradictions import weighted_evidence
from auvid_cli.inspection.current import drift, is_current, through_water
from auvid_cli.inspection.data_checks import data_checks
from auvid_cli.inspection.excitation import excitation_checks, fitness_checks
from auvid_cli.inspection.excursions import excursion_checks
from auvid_cli.inspection.fin_answers import motion_of, strength_checks
from auvid_cli.inspection.forces import doubled_thrust_check, force_checks
from auvid_cli.inspection.grid import Signals, signals_of, span_of
from auvid_cli.inspection.inspection import Inspection, Mark, judged
from auvid_cli.inspection.kinematic_relations import attitude_rates
from auvid_cli.inspection.lasting_errors import biases_to_look_for, lasting_error_checks, lasting_errors
from auvid_cli.inspection.likely_causes import causes_check
from auvid_cli.inspection.rudder_trim import rudder_trim, rudder_trim_checks
from auvid_cli.inspection.sensor_delays import sensor_delay_checks
from auvid_cli.inspection.single_sensor import measurement_checks
from auvid_cli.inspection.steps import angle_steps, gimbal_check, step_check
from auvid_cli.inspection.timing import input_end_check, input_timing_checks, timing_checks
from auvid_cli.inspection.velocity import mean_speed, velocity_checks
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

_INTERVALS, _MEASUREMENTS = 600, 10
_MOST_INPUTS = 100_000


def inspect_dataset(dataset: Dataset) -> Inspection:
    """Judge a dataset as recorded: each sensor by itself, all against each other, and whether they suffice.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.

    Returns
    -------
    Inspection
    """
    sensors = {name: record for name, record in dataset.sensors.items() if np.isfinite(record.values).any()}
    checks = [_silent(name) for name in dataset.sensors if name not in sensors] or [_no_sensor()] * (not sensors)
    checks += [*_import_remarks(dataset.experiment), *_vehicle(dataset.experiment.vehicle)]
    marks, sound = [], {}
    for name, record in sensors.items():
        screening = screened(name, record)
        checks += _sensor_checks(dataset, name, screening)
        marks += screening.marks
        sound[name] = screening.record
    span = span_of(dataset.inputs, sensors)
    actuators = dataset.experiment.vehicle.actuators.actuators()
    acting = acted(dataset.inputs, actuators, dataset.experiment.identification.integration_step)
    signals = signals_of(acting, sound, span)
    stepped = set()
    for name, component, symbol in _angles(sound):
        before, after, size = angle_steps(sound, name, component)
        checks.append(step_check(name, symbol, before, size))
        if size.size:
            stepped.add(symbol)
        for times in zip(before.tolist(), after.tolist(), strict=True):
            marks.append(Mark(name, "step", *times))
            signals.blank(symbol, *times)
    speed = mean_speed(signals)
    length = dataset.experiment.vehicle.size.length
    time_constant = length / speed if speed is not None else None
    found = drift(signals)
    in_water = through_water(signals, found)
    motion = motion_of(in_water, dataset.experiment.vehicle)
    alignment = input_alignment(in_water, motion, time_constant)
    checks += [*_input_end(dataset, sensors), *input_timing_checks(dataset.inputs, time_constant)]
    checks += alignment_checks(alignment)
    checks += actuator_checks(dataset.inputs, actuators)
    checks += doubled_thrust_check(dataset.inputs, dataset.experiment.vehicle.coefficient_set)
    checks += force_checks(signals, dataset.experiment.vehicle)
    rotations = rotation_checks(aligned(in_water, alignment), sound, time_constant)
    accelerometer = dataset.sensors.get("accelerometer")
    ahead = 0.0 if accelerometer is None else accelerometer.position[0]
    velocities = velocity_checks(aligned(signals, alignment), length, time_constant, ahead)
    errors = lasting_errors(signals, sound)
    checks += [*rotations, *velocities, *_stability(signals), *lasting_error_checks(dataset, errors)]
    # Of sensors that contradict each other none is a witness.
    if not any(check.passed is False and check.subject in sound for check in [*rotations, *velocities]):
        checks += strength_checks(aligned(in_water, alignment), motion, time_constant)
    trim = rudder_trim(aligned(in_water, alignment), motion, time_constant)
    checks += rudder_trim_checks(trim)
    contradicted = any(check.passed is False and check.subject in sound for check in rotations)
    checks += sensor_delay_checks(signals, time_constant, contradicted)
    if not contradicted:
        swings, away = excursion_checks(signals, stepped)
        checks += swings
        marks += away
    checks += [*excitation_checks(dataset, signals), *fitness_checks(dataset, time_constant)]
    every = slice(None, None, 1 + dataset.inputs.time.size // _MOST_INPUTS)
    inputs = InputRecord(dataset.inputs.time[every], dataset.inputs.values[every])
    presence = {name: _presence(record, span) for name, record in sensors.items()}
    weighty = weighted_evidence(checks)
    current = found if found is not None and is_current(signals, found) else None
    weighty.append(causes_check(alignment, current, trim, errors, biases_to_look_for(dataset), weighty))
    return Inspection(Checks(weighty), marks, inputs, presence, span)


def _sensor_checks(dataset: Dataset, name: str, screening: Screened) -> list[Check]:
    """Judge a sensor by itself."""
    record = dataset.sensors[name]
    checks = timing_checks(name, record, screening.jumps) if record.time.size > 1 else []
    checks += [
        *data_checks([dataset], "", [name]),
        *measurement_checks(name, record, screening.spikes, screening.largest),
    ]
    tells_pitch = name == "attitude" and np.isfinite(record.values[:, 1]).any()
    return [*checks, gimbal_check(record)] if tells_pitch else checks


def _no_sensor() -> Check:
    return judged(
        "dataset",
        "sensors",
        statistic="none",
        threshold="some",
        passed=False,
        advice="There is nothing to judge, nor to identify from.",
    )


def _silent(name: str) -> Check:
    advice = f"{name} holds no valid value at all: leave it out, or find out why."
    return judged(name, "missing", statistic="100% of values", threshold="some", passed=False, advice=advice)


def _import_remarks(run: RunSettings) -> list[Check]:
    """List what only the log could tell, such as that its other clock is the better one."""
    remarks = run.recording.remarks if isinstance(run, ImportedRun) else {}
    return [
        judged(
            name,
            "import",
            statistic="a remark",
            threshold="none",
            passed=None,
            advice=f"At import: {'; '.join(sentences)}.",
        )
        for name, sentences in remarks.items()
    ]


def _vehicle(vehicle: VehicleSettings) -> list[Check]:
    """List what of the vehicle's numbers can hardly be."""
    advice = "Look at the sign and the unit of that number in the vehicle file, and at what it is compared with."
    return [
        judged("vehicle", doubt.subject, statistic=doubt.value, threshold=doubt.expected, passed=None, advice=advice)
        for doubt in doubts(vehicle)
    ]


def _input_end(dataset: Dataset, sensors: dict[str, SensorRecord]) -> list[Check]:
    """Judge whether the inputs last as long as what estimators listen to, as these take either to be timed."""
    settings = dataset.experiment.identification
    ends = [
        float(record.measured_times.max()) - settings.delays.get(name, 0.0)
        for name, record in sensors.items()
        if name not in settings.unused_sensors
    ]
    return [input_end_check(as_acting(dataset.inputs, dataset.experiment), max(ends))] if ends else []


def _angles(sensors: dict[str, SensorRecord]) -> Iterator[tuple[str, int, str]]:
    """Yield sensor, component and symbol of each angle that is measured."""
    for name, record in sensors.items():
        for component, quantity in enumerate(SENSORS[name]):
            if quantity.unit == "rad" and np.isfinite(record.values[:, component]).sum() > 1:
                yield name, component, quantity.symbol


def _stability(signals: Signals) -> list[Check]:
    """State the bias instability of the rates, from what attitude does not explain: that of both together."""
    checks = []
    for symbol, relation in attitude_rates(signals).items():
        if signals.has(symbol):
            unexplained = signals.values[symbol] - relation.total()
            instability = bias_instability(unexplained[np.isfinite(unexplained)], signals.grid.step)
            if instability is not None:
                checks.append(
                    judged(
                        "gyroscope",
                        f"bias instability of {symbol}",
                        statistic=f"{np.rad2deg(instability.value) * 3600.0:.3g} deg/h at {instability.time:.3g} s",
                        threshold="Allan deviation of what attitude does not explain",
                        passed=True,
                        advice="",
                    )
                )
    return checks


def _presence(record: SensorRecord, span: tuple[float, float]) -> Array:
    """Count, over the usual, the measurements in each interval of the span, 0 to 1; each has room for a few."""
    time = record.measured_times
    usual = float(np.median(np.diff(record.time))) if record.time.size > 1 else np.inf
    expected = (span[1] - span[0]) / usual
    intervals = int(np.clip(expected / _MEASUREMENTS, 1, _INTERVALS))
    count, _ = np.histogram(time, intervals, span)
    return np.minimum((count + 1) * intervals / max(expected, 1.0), 1.0) * (count > 0)
