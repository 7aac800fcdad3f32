"""Inspect a dataset before identification: run all checks on clean records, and find contradictions between them."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.experiment import ImportedRun, RunSettings
from auvid_cli.config.sanity import sanity_warnings
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.data.acting_inputs import as_acting, with_actuator_dynamics
from auvid_cli.data.checks import Check, Checks
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.signals import gaps, stuck_times
from auvid_cli.inspection.agreement import rotation_checks
from auvid_cli.inspection.delays import aligned, alignment_checks, input_alignment, sensor_delay_checks
from auvid_cli.inspection.excitation import (
    actuator_checks,
    doubled_thrust_check,
    excitation_checks,
    fitness_checks,
    force_checks,
)
from auvid_cli.inspection.fins import motion_of, rudder_trim, rudder_trim_checks, strength_checks
from auvid_cli.inspection.inspection import Inspection, Mark, data_checks, judged
from auvid_cli.inspection.kinematic_relations import Signals, attitude_rates, measured_forces, signals_of, span_of
from auvid_cli.inspection.lasting_errors import (
    biases_to_look_for,
    excursion_checks,
    lasting_error_checks,
    lasting_errors,
)
from auvid_cli.inspection.likely_causes import causes_check
from auvid_cli.inspection.responses import drift, is_current, through_water
from auvid_cli.inspection.single_sensor import (
    angle_steps,
    bias_instability,
    gimbal_check,
    measurement_checks,
    spikes,
    step_check,
)
from auvid_cli.inspection.timing import clock_jumps, input_end_check, input_timing_checks, timing_checks
from auvid_cli.inspection.velocity import against_force, mean_speed, velocity_checks
from auvid_cli.vehicle.parameters import SENSORS

_Key = tuple[str, str]
_FINS = "delay", "rudder and elevator"
_LASTING = tuple(f"errors that last in {rate}" for rate in "pqr")
Array = NDArray[np.float64]
_INTERVALS, _MEASUREMENTS = 600, 10
_MOST_INPUTS = 100_000


class Screened(NamedTuple):
    """A record that can be compared with other sensors, and what was left out.

    Attributes
    ----------
    record : SensorRecord
        NaN for stuck values and spikes; ends where the clock jumps.
    jumps : ndarray of int
        Samples before the jumps of the clock.
    spikes : ndarray of bool, shape (n, c)
        In the record as it was.
    largest : dict
        Of each component the size of the largest spike, in robust standard deviations, and its time, s.
    marks : list of Mark
    """

    record: SensorRecord
    jumps: NDArray[np.int64]
    spikes: NDArray[np.bool_]
    largest: dict[str, tuple[float, float]]
    marks: list[Mark]


def screened(name: str, record: SensorRecord) -> Screened:
    """Take out what is wrong with a sensor by itself."""
    time, values = record.time, record.values.copy()
    stuck = stuck_times(record)
    for start, end in stuck:
        # The first of them was measured.
        values[slice(*np.searchsorted(time, [start, end], side="right"))] = np.nan
    moving = SensorRecord(time, values, record.standard_deviation)
    mask, largest = spikes(moving, name)
    values[mask] = np.nan
    jumps = clock_jumps(record)
    leaps = np.stack([time[jumps], time[jumps + 1]], axis=1).tolist()
    marks = [Mark(name, "clock", *times) for times in leaps]
    marks += [Mark(name, "gap", *times) for times in gaps(record.measured_times).tolist() if times not in leaps]
    marks += [Mark(name, "stuck", *times) for times in stuck.tolist()]
    marks += [Mark(name, "spike", at, at) for at in time[mask.any(axis=1)].tolist()]
    end = int(jumps[0]) + 1 if jumps.size else time.size
    return Screened(SensorRecord(time[:end], values[:end], record.standard_deviation), jumps, mask, largest, marks)


def contradictions_of_unused(dataset: Dataset) -> list[Check]:
    """Judge the velocities by an accelerometer that is not used; only what fails.

    Parameters
    ----------
    dataset : Dataset
        Its truth is not looked at.
    """
    if "accelerometer" not in dataset.experiment.identification.unused_sensors:
        return []
    sensors = {
        name: screened(name, record).record
        for name, record in dataset.sensors.items()
        if np.isfinite(record.values).any()
    }
    signals = signals_of(dataset.inputs, sensors, span_of(dataset.inputs, sensors))
    checks = (against_force(signals, symbol, force) for symbol, force in measured_forces(signals).items())
    return [check for check in checks if check.passed is False]


class _Turn(NamedTuple):
    """Verdicts on one axis.

    Attributes
    ----------
    agreement : tuple of str
        Those on rate against angle, of which the first that was reached counts.
    answer : (str, str)
        That on the answer to the fin.
    witnesses : tuple of (str, str)
        Those that have the direction from the motion otherwise.
    symbols, positive : str
        What is turned where both contradict, and which way round is right.
    hangs_on_it : tuple of str
        Other verdicts for which the rate or the angle is needed.
    """

    agreement: tuple[str, ...]
    answer: _Key
    witnesses: tuple[_Key, ...]
    symbols: str
    positive: str
    hangs_on_it: tuple[str, ...] = ()


_TURNS = (
    _Turn(("p against phi",), ("roll_moment", "response of p"), (), "phi (and p)", "starboard side down", _LASTING),
    _Turn(
        ("q against theta",),
        ("elevator", "response of q"),
        (("depth", "depth against pitch and u"), ("dvl", "w in a turn")),
        "theta (and q)",
        "nose up",
        ("w in a turn", *_FINS, *_LASTING),
    ),
    _Turn(
        ("r against psi", "r against heading"),
        ("rudder", "response of r"),
        (("dvl", "v in a turn"),),
        "psi (and r)",
        "clockwise from above; headings of ENU count the other way",
        (
            *("v in a turn", "v against accelerometer", "lever arm", "current", "heading offset", "response of u"),
            *("bias instability of r", "trim", *_FINS, *_LASTING),
        ),
    ),
)


def weighted_evidence(checks: Sequence[Check]) -> list[Check]:
    """Return verdicts with nothing called true or false by a rate and an angle that disagree, nor advice to mirror."""
    verdicts = {(check.subject, check.check): check for check in checks}
    for turn in _TURNS:
        agreements = [check for name in turn.agreement for check in checks if check.check == name]
        told = [check for check in agreements if check.passed is not None]
        if told and told[0].passed is False:
            for key, check in verdicts.items():
                if check.check in (turn.answer[1], *turn.hangs_on_it) and check.passed is not None:
                    verdicts[key] = _in_doubt(check, told[0].check)
        elif (answer := verdicts.get(turn.answer)) is not None:
            verdicts |= _blamed(turn, answer, verdicts)
    return list(verdicts.values())


def _in_doubt(check: Check, disagreement: str) -> Check:
    statistic = f"cannot tell while {disagreement} fails: {check.statistic}"
    return check._replace(passed=None, statistic=statistic, advice=f"First mend {disagreement}.")


def _blamed(turn: _Turn, answer: Check, verdicts: dict[_Key, Check]) -> dict[_Key, Check]:
    """Say which sign is turned where a fin, or what witnesses the turn, contradicts the attitude."""
    against = [check for key in turn.witnesses if (check := verdicts.get(key)) is not None and check.passed is False]
    if answer.passed is False and against:
        words = (
            f"{answer.check} and {' and '.join(check.check for check in against)} both contradict {turn.symbols}: turn "
            f"the sign of that ({turn.positive}), which one mistake explains, and not of the others. But first make "
            "sure that it counts the other way: if it does not, all others are turned, and turning it makes the data "
            "those of a mirror image of the vehicle, which nothing tells any more."
        )
        return {(check.subject, check.check): check._replace(advice=words) for check in (answer, *against)}
    words = (
        f" But first make sure of {turn.symbols} ({turn.positive}): if that is turned as well, this makes the data "
        "those of a mirror image of the vehicle, which nothing tells any more."
    )
    failed = [check for check in (answer, *against) if check.passed is False]
    return {(check.subject, check.check): check._replace(advice=check.advice + words) for check in failed}


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
    acting = with_actuator_dynamics(dataset.inputs, actuators, dataset.experiment.identification.integration_step)
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
        judged(
            "vehicle", warning.subject, statistic=warning.value, threshold=warning.expected, passed=None, advice=advice
        )
        for warning in sanity_warnings(vehicle)
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
