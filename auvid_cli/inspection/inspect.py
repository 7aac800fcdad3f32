"""Inspect a dataset before identification: single sensors, contradictions between them, and excitation."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import ImportedRun, RunSettings
from auvid_cli.config.sanity import sanity_warnings
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.acting_inputs import as_acting, with_actuator_dynamics
from auvid_cli.data.checks import Check, Checks
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.faults import Cause, FaultKind
from auvid_cli.inspection import excitation, rotation, single_sensor
from auvid_cli.inspection.delays import Alignment, aligned, alignment_checks, input_alignment, sensor_delay_checks
from auvid_cli.inspection.fins import RudderTrim, motion_of, rudder_trim, rudder_trim_checks, strength_checks
from auvid_cli.inspection.inspection import UNDETERMINED, Inspection, Mark, data_checks, judged
from auvid_cli.inspection.kinematic_relations import Signals, measured_forces, signals_of, span_of
from auvid_cli.inspection.responses import Current, estimate_current, is_significant, through_water
from auvid_cli.inspection.rotation import RateError
from auvid_cli.inspection.single_sensor import Screening
from auvid_cli.inspection.timing import input_end_check, input_timing_checks, timing_checks
from auvid_cli.inspection.velocity import against_force, mean_speed, velocity_checks
from auvid_cli.vehicle.parameters import SENSORS

_MAX_INPUTS = 100_000  # samples of the inputs in a timeline
_MAX_BINS = 600  # largest number of bins in a timeline
_MEASUREMENTS_PER_BIN = 10
_PART = 1000.0  # s, of the data that `contradictions_of_unused` checks at once


def inspect_dataset(dataset: Dataset) -> Inspection:
    """Check a dataset as recorded, without its truth: sensors, contradictions between them, excitation."""
    experiment, vehicle = dataset.experiment, dataset.experiment.vehicle
    actuators, length = vehicle.actuators.actuators(), vehicle.size.length
    sensors = _with_values(dataset.sensors)
    screened = {name: single_sensor.screen(name, record) for name, record in sensors.items()}
    clean = {name: screening.record for name, screening in screened.items()}
    marks = [mark for screening in screened.values() for mark in screening.marks]
    span = span_of(dataset.inputs, sensors)
    acting = with_actuator_dynamics(dataset.inputs, actuators, experiment.identification.integration_step)
    signals = signals_of(acting, clean, span)

    # Each sensor by itself
    checks = [*_missing_sensors(dataset, sensors), *_import_remarks(experiment), *_vehicle(vehicle)]
    for name, screening in screened.items():
        checks += _sensor_checks(dataset, name, screening)
    steps, step_marks, stepped = _steps(signals, clean)
    checks += steps
    marks += step_marks

    # Conditions of the run
    speed = mean_speed(signals)
    time_constant = length / speed if speed is not None else None
    current = estimate_current(signals)
    in_water = through_water(signals, current)
    motion = motion_of(in_water, vehicle)
    alignment = input_alignment(in_water, motion, time_constant)
    in_water, over_ground = aligned(in_water, alignment), aligned(signals, alignment)

    # Inputs
    checks += [*_input_end(dataset, sensors), *input_timing_checks(dataset.inputs, time_constant)]
    checks += alignment_checks(alignment)
    checks += excitation.actuator_checks(dataset.inputs, actuators)
    checks += excitation.doubled_thrust_check(dataset.inputs, vehicle.coefficient_set)
    checks += excitation.missing_thrust_check(in_water, vehicle.coefficient_set)
    checks += excitation.force_checks(signals, vehicle)

    # Sensors against each other
    rotations = rotation.rotation_checks(in_water, clean, time_constant)
    accelerometer = dataset.sensors.get("accelerometer")
    ahead = 0.0 if accelerometer is None else accelerometer.position[0]
    velocities = velocity_checks(over_ground, length, time_constant, ahead)
    errors = rotation.rate_errors(signals, clean)
    checks += [*rotations, *velocities, *rotation.stability_checks(signals)]
    checks += rotation.rate_error_checks(dataset, errors)

    # Fins, unless sensors contradict each other
    if not _has_failed_sensor([*rotations, *velocities], clean):
        checks += strength_checks(in_water, motion, time_constant)
    trim = rudder_trim(in_water, motion, time_constant)
    checks += rudder_trim_checks(trim)

    # Delays and excursions, unless rates and angles contradict each other
    contradicted = _has_failed_sensor(rotations, clean)
    checks += sensor_delay_checks(signals, time_constant, contradicted)
    if not contradicted:
        excursions, excursion_marks = rotation.excursion_checks(signals, stepped)
        checks += excursions
        marks += excursion_marks

    # Excitation, and causes of all that was found
    checks += [*excitation.excitation_checks(dataset, signals), *excitation.fitness_checks(dataset, time_constant)]
    checks = weighted_evidence(checks)
    significant = current if current is not None and is_significant(signals, current) else None
    checks.append(causes_check(alignment, significant, trim, errors, rotation.gyroscope_biases(dataset), checks))

    every = slice(None, None, 1 + dataset.inputs.time.size // _MAX_INPUTS)
    inputs = InputRecord(dataset.inputs.time[every], dataset.inputs.values[every])
    presence = {name: _presence(record, span) for name, record in sensors.items()}
    return Inspection(Checks(checks), marks, inputs, presence, span)


def contradictions_of_unused(dataset: Dataset) -> list[Check]:
    """Return failed checks of the velocities by an accelerometer that is not used; the truth is ignored.

    Each velocity is checked in the first part of the data that has enough motion.
    """
    if "accelerometer" not in dataset.experiment.identification.unused_sensors:
        return []
    measuring = _with_values(dataset.sensors)
    begin, end = span_of(dataset.inputs, measuring)
    checks = dict[str, Check]()
    for start in np.arange(begin, end, _PART).tolist():
        span = start, min(start + _PART, end)
        sensors = _with_values({name: record.between(*span) for name, record in measuring.items()})
        screened = {name: single_sensor.screen(name, record).record for name, record in sensors.items()}
        signals = signals_of(dataset.inputs.between(*span), screened, span)
        for symbol, force in measured_forces(signals).items():
            if symbol not in checks and (check := against_force(signals, symbol, force)).passed is not None:
                checks[symbol] = check
        if checks.keys() >= set("uvw"):
            break
    return [check for check in checks.values() if check.passed is False]


def _with_values(sensors: dict[str, SensorRecord]) -> dict[str, SensorRecord]:
    return {name: record for name, record in sensors.items() if record.present.any()}


def _has_failed_sensor(checks: Sequence[Check], sensors: dict[str, SensorRecord]) -> bool:
    return any(check.passed is False and check.subject in sensors for check in checks)


def _missing_sensors(dataset: Dataset, sensors: dict[str, SensorRecord]) -> list[Check]:
    """Return failed checks of sensors without values, or of a dataset without sensors."""
    checks = [
        judged(
            name,
            "missing",
            statistic="100% of values",
            threshold="some valid values",
            passed=False,
            advice=f"{name} has no valid value: remove it from the map, or find the reason.",
        )
        for name in dataset.sensors
        if name not in sensors
    ]
    if checks or sensors:
        return checks
    advice = "Nothing was measured: add sensors to the map."
    return [judged("dataset", "sensors", statistic="none", threshold="at least 1", passed=False, advice=advice)]


def _import_remarks(run: RunSettings) -> list[Check]:
    remarks = run.recording.remarks if isinstance(run, ImportedRun) else {}
    return [
        judged(
            name,
            "import",
            statistic=f"{len(sentences)} {'remark' if len(sentences) == 1 else 'remarks'}",
            threshold="none",
            passed=None,
            advice=f"At import: {'; '.join(sentences)}.",
        )
        for name, sentences in remarks.items()
    ]


def _vehicle(vehicle: VehicleSettings) -> list[Check]:
    advice = "Check the sign and the unit of this value in the vehicle file, and the value that it is compared with."
    return [
        judged(
            "vehicle", warning.subject, statistic=warning.value, threshold=warning.expected, passed=None, advice=advice
        )
        for warning in sanity_warnings(vehicle)
    ]


def _sensor_checks(dataset: Dataset, name: str, screening: Screening) -> list[Check]:
    record = dataset.sensors[name]
    checks = timing_checks(name, record, screening.jumps) if record.time.size > 1 else []
    checks += [*data_checks([dataset], "", [name]), *single_sensor.measurement_checks(name, record, screening)]
    checks += [check for check in (single_sensor.range_check(name, record),) if check is not None]
    has_pitch = name == "attitude" and np.isfinite(record.values[:, 1]).any()
    return [*checks, single_sensor.gimbal_check(record)] if has_pitch else checks


def _steps(signals: Signals, sensors: dict[str, SensorRecord]) -> tuple[list[Check], list[Mark], set[str]]:
    """Check all angles for steps and remove these from the signals; return checks, marks and angles with steps."""
    checks, marks, stepped = [], [], set()
    angles = (
        (name, component, quantity.symbol)
        for name, record in sensors.items()
        for component, quantity in enumerate(SENSORS[name])
        if quantity.unit == "rad" and np.isfinite(record.values[:, component]).sum() > 1
    )
    for name, component, symbol in angles:
        before, after, size = single_sensor.angle_steps(sensors, name, component)
        checks.append(single_sensor.step_check(name, symbol, before, size))
        if size.size:
            stepped.add(symbol)
        for times in zip(before.tolist(), after.tolist(), strict=True):
            marks.append(Mark(name, "step", *times))
            signals.blank(symbol, *times)
    return checks, marks, stepped


def _input_end(dataset: Dataset, sensors: dict[str, SensorRecord]) -> list[Check]:
    """Check that the inputs last as long as the used sensors, both with their stated delays."""
    settings = dataset.experiment.identification
    ends = [
        float(record.measured_times.max()) - settings.delays.get(name, 0.0)
        for name, record in sensors.items()
        if name not in settings.unused_sensors
    ]
    return [input_end_check(as_acting(dataset.inputs, dataset.experiment), max(ends))] if ends else []


def _presence(record: SensorRecord, span: tuple[float, float]) -> Array:
    """Return the share of the usual measurements in each bin of the span, 0 to 1."""
    time = record.measured_times
    usual = float(np.median(np.diff(record.time))) if record.time.size > 1 else np.inf
    expected = (span[1] - span[0]) / usual
    bins = int(np.clip(expected / _MEASUREMENTS_PER_BIN, 1, _MAX_BINS))
    count, _ = np.histogram(time, bins, span)
    return np.minimum((count + 1) * bins / max(expected, 1.0), 1.0) * (count > 0)


class _AxisEvidence(NamedTuple):
    """Checks that show the sign of a rate and an angle."""

    agreement: tuple[str, ...]  # checks of the rate against an angle; the first that was determined counts
    response: tuple[str, str]  # subject and check of the response to the input
    others: tuple[tuple[str, str], ...]  # subject and check of other evidence on the direction of rotation
    symbols: str  # signals with the wrong sign if response and other evidence contradict them
    positive: str  # correct positive direction of these signals
    dependent: tuple[str, ...] = ()  # other checks that need the rate or the angle


_RATE_ERRORS = tuple(f"autocorrelated errors in {rate}" for rate in "pqr")
_AXIS_EVIDENCE = (
    _AxisEvidence(
        ("p against phi",), ("roll_moment", "response of p"), (), "phi (and p)", "starboard side down", _RATE_ERRORS
    ),
    _AxisEvidence(
        ("q against theta",),
        ("elevator", "response of q"),
        (("depth", "depth against pitch and u"), ("dvl", "w in a turn")),
        "theta (and q)",
        "nose up",
        ("w in a turn", "delay", "rudder and elevator", *_RATE_ERRORS),
    ),
    _AxisEvidence(
        ("r against psi", "r against heading"),
        ("rudder", "response of r"),
        (("dvl", "v in a turn"),),
        "psi (and r)",
        "clockwise from above; headings in ENU count the other way",
        (
            *("v in a turn", "v against accelerometer", "lever arm", "current", "heading offset", "response of u"),
            *("bias instability of r", "trim", "delay", "rudder and elevator", *_RATE_ERRORS),
        ),
    ),
)


def weighted_evidence(checks: Sequence[Check]) -> list[Check]:
    """Return the checks, undetermined if they need a contradicted rate or angle; advice warns of a mirror image."""
    by_name = {(check.subject, check.check): check for check in checks}
    for axis in _AXIS_EVIDENCE:
        agreements = [check for name in axis.agreement for check in checks if check.check == name]
        agreement = next((check for check in agreements if check.passed is not None), None)
        if agreement is not None and agreement.passed is False:
            for key, check in by_name.items():
                if check.check in (axis.response[1], *axis.dependent) and check.passed is not None:
                    statistic = f"{UNDETERMINED} while {agreement.check} fails: {check.statistic}"
                    advice = f"Correct {agreement.check} first."
                    by_name[key] = check._replace(passed=None, statistic=statistic, advice=advice)
        elif axis.response in by_name:
            by_name |= _sign_advice(axis, by_name)
    return list(by_name.values())


def _sign_advice(axis: _AxisEvidence, checks: dict[tuple[str, str], Check]) -> dict[tuple[str, str], Check]:
    """Return failed checks of an axis with advice on the sign that explains all of them."""
    response = checks[axis.response]
    others = [check for key in axis.others if (check := checks.get(key)) is not None and check.passed is False]
    failed = [check for check in (response, *others) if check.passed is False]
    if response.passed is False and others:
        advice = (
            f"{response.check} and {' and '.join(check.check for check in others)} both contradict {axis.symbols}. "
            f"Change the sign of {axis.symbols} ({axis.positive}): this one mistake explains both; do not change the "
            "other signs. First make sure, from the manual of the sensor, that it counts the other way. If it does "
            "not, all other signs are wrong, and changing this one gives the data of a mirror image of the vehicle, "
            "which no check can detect."
        )
        return {(check.subject, check.check): check._replace(advice=advice) for check in failed}
    advice = (
        f" First make sure of {axis.symbols} ({axis.positive}): if its sign is wrong too, this change gives the data "
        "of a mirror image of the vehicle, which no check can detect."
    )
    return {(check.subject, check.check): check._replace(advice=check.advice + advice) for check in failed}


def causes_check(
    alignment: Alignment,
    current: Current | None,
    trim: RudderTrim | None,
    errors: Sequence[RateError],
    biases: str,
    checks: Sequence[Check],
) -> Check:
    """Return the check with the likely causes of contradictions, in the order of their evidence.

    Parameters
    ----------
    alignment : Alignment
    current : Current or None
        Only a significant one.
    trim : RudderTrim or None
    errors : sequence of RateError
    biases : str
        Bias blocks that estimate these errors.
    checks : sequence of Check
        All other checks, weighted. A cause whose own check passed or is undetermined is left out.
    """
    shown = {check.check for check in checks if check.passed is not True and UNDETERMINED not in check.statistic}
    causes = []
    if "delay" in shown and alignment.is_delayed and alignment.delay is not None:
        remedy = f"state the delay of the inputs (`identification.delays={{inputs: {-alignment.delay:.2g} s}}`)"
        causes.append(Cause(alignment.gain, "delayed inputs", remedy))
    if "current" in shown and current is not None:
        remedy = f"estimate the current (`{FaultKind.CURRENT.setting}`)"
        causes.append(Cause(0.5 * (current.speed / current.error) ** 2, "a current", remedy))
    if "trim" in shown and trim is not None and trim.is_significant:
        remedy = f"estimate the trim of the rudder (`{FaultKind.FIN_TRIM.setting}`)"
        causes.append(Cause(0.5 * (trim.angle / trim.error) ** 2, "a rudder trim", remedy))
    significant = [error for error in errors if error.is_significant]
    if any(f"autocorrelated errors in {error.rate}" in shown for error in significant):
        remedy = (
            f"estimate the bias of the gyroscope (`identification.estimate.biases: [{biases}]`) or set more process "
            "noise (`auvid tune`)"
        )
        gain = sum(error.gain for error in significant)
        causes.append(Cause(gain, "autocorrelated errors of the gyroscope", remedy))
    causes.sort(key=lambda cause: -cause.gain)
    return judged(
        "identification",
        "likely causes",
        statistic="; ".join(cause.name_with_gain for cause in causes) or "none",
        threshold="no fault that explains the data",
        passed=None if causes else True,
        advice=f"Before you identify, the most likely first: {'; then '.join(cause.remedy for cause in causes)}. The "
        "other errors count as process noise: if in doubt, state more of it.",
    )
