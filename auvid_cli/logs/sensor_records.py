"""Sensors of a map as records on one clock."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.arrays import Array
from auvid_cli.config.log_map import AccelerometerMap, DepthMap, DvlMap, LogMap, MagneticFieldMap, SensorMap
from auvid_cli.config.settings import Spans
from auvid_cli.config.source_positions import KeyPath
from auvid_cli.data.array_checks import MAX_TIME
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.signals import Noise, estimate_noise, gaps, is_smoothed
from auvid_cli.logs import frames, measurements
from auvid_cli.logs.measurements import ImportSummary, MeasuredRows
from auvid_cli.logs.requests import ColumnReader, MapErrors, MapMismatchError, Request
from auvid_cli.vehicle.parameters import SENSORS

_HEADINGS = ("psi", "heading")  # angles that may exceed one turn


class SensorRecords(NamedTuple):
    """Records of sensors, the log's time at t = 0, s, and a summary of each."""

    records: dict[str, SensorRecord]
    origin: float
    summaries: list[ImportSummary]


def read_sensors(
    settings: LogMap, requests: dict[KeyPath, Request], columns: ColumnReader, errors: MapErrors
) -> SensorRecords:
    """Read all sensors in body axes at the vehicle's origin; t = 0 is the first sample of the earliest.

    Raises
    ------
    ConfigError
        With all errors of a step.
    FileError
        If a log is damaged.
    """
    maps = settings.sensors.given()
    rows: dict[str, MeasuredRows] = {}
    raw: dict[str, Array] = {}
    for name, sensor in maps.items():
        with errors.collecting():
            path = "sensors", name
            parts = [request for at, request in requests.items() if at[:2] == path]
            rows[name], raw[name] = _read(path, sensor, parts, columns)
    errors.stop_if_any()
    origin = float(min(kept.time[0] for kept in rows.values()))
    for name in maps:
        if (span := rows[name].time[-1] - origin) > MAX_TIME:
            errors.add(
                ("sensors", name),
                f"the times of the log span {span:.3g} s, more than {MAX_TIME:g} s: check the unit of `time`, and "
                "remove rows from before the clock was set",
            )
    errors.stop_if_any()
    excluded, records = {}, {}
    for name, sensor in maps.items():
        time, values = rows[name].time - origin, raw.pop(name)
        excluded[name] = _within(time, (*settings.exclude, *sensor.exclude))
        values[excluded[name]] = np.nan
        records[name] = SensorRecord(time, values, np.empty(0))
    _check_common_time(records, origin, errors)
    errors.stop_if_any()
    dvl, depth, summaries = settings.sensors.dvl, settings.sensors.depth, []
    levelled, assumed_level = frames.level_where_roll_is_unknown(records), dict[str, str]()
    if isinstance(dvl, DvlMap):
        with errors.collecting():
            assumed_level["dvl"] = frames.turned_by_attitude(dvl, records)
            values = frames.complete_velocity(dvl, records["dvl"], levelled, ("sensors", "dvl"))
            records["dvl"] = replace(records["dvl"], values=values)
    if isinstance(depth, DepthMap) and depth.position is not None:
        with errors.collecting():
            assumed_level["depth"] = "the lever arm"
            values = _depth_of_origin(records["depth"], levelled.get("attitude"), np.array(depth.position))
            records["depth"] = replace(records["depth"], values=values)
    if levelled.get("attitude") is records.get("attitude"):
        assumed_level = {}
    for name, sensor in maps.items():
        with errors.collecting():
            records[name], noise = _finished(name, sensor, records[name], settings.use)
            unrecorded = unintended_gaps(
                records[name].measured_times, settings.use, (*settings.exclude, *sensor.exclude)
            )
            n_excluded, level = int(excluded[name].sum()), assumed_level.get(name, "")
            summaries.append(_summary(name, records[name], noise, rows[name], n_excluded, unrecorded, level))
    errors.stop_if_any()
    return SensorRecords(records, origin, summaries)


def _read(
    path: KeyPath, sensor: SensorMap, requests: Sequence[Request], columns: ColumnReader
) -> tuple[MeasuredRows, Array]:
    parts = [
        measurements.read_request(
            request, sensor.signals(), columns, sensor.valid, sensor.missing, drop_zeros=sensor.zeros == "drop"
        )
        for request in requests
    ]
    if sensor.repeats == "drop":
        parts = [measurements.without_repeats(part) for part in parts]
    rows = measurements.together(parts)
    values = frames.in_vehicle_axes(sensor, rows, path)
    for column, quantity in enumerate(SENSORS[sensor.sensor]):
        if quantity.symbol not in _HEADINGS:
            measurements.check_plausible(path, values[:, column], quantity.unit)
    return rows._replace(values={}), values


def _within(time: Array, spans: Spans) -> NDArray[np.bool_]:
    """Return whether times are in one of the spans, ends included."""
    inside = np.zeros(time.size, np.bool_)
    for begin, end in spans:
        inside[np.searchsorted(time, begin) : np.searchsorted(time, end, side="right")] = True
    return inside


def _check_common_time(records: dict[str, SensorRecord], origin: float, errors: MapErrors) -> None:
    for (name, first), (other, second) in combinations(records.items(), 2):
        if max(first.time[0], second.time[0]) > min(first.time[-1], second.time[-1]):
            own, others = (f"{kept.time[0] + origin:.3f} to {kept.time[-1] + origin:.3f} s" for kept in (first, second))
            spans = f"{name} is from {own}, {other} from {others}"
            advice = "give one of them a time with an `offset`, or another time"
            errors.add(("sensors", other), f"no time in common: {spans}; {advice}")


def _depth_of_origin(depth: SensorRecord, attitude: SensorRecord | None, position: Array) -> Array:
    if attitude is None or not np.isfinite(attitude.values[:, :2]).any(axis=0).all():
        raise MapMismatchError(("sensors", "depth", "position"), "a lever arm needs an `attitude` with pitch")
    tilt = frames.interpolate(attitude.time, attitude.values[:, :2], depth.time, is_angle=True)
    return frames.depth_at_origin(depth.values[:, 0], tilt[:, 0], tilt[:, 1], position)[:, None]


def _finished(name: str, sensor: SensorMap, record: SensorRecord, use: Spans) -> tuple[SensorRecord, tuple[Noise, ...]]:
    """Return the used part of a record with its standard deviation, and the noise of each component if estimated."""
    time, values = record.time, record.values
    match sensor:
        case AccelerometerMap():
            place = {"position": sensor.position}
        case MagneticFieldMap():
            place = {"earth_field": sensor.earth_field}
        case _:
            place = {}
    if use:
        used = _within(time, use)
        time, values = time[used], values[used]
    if not np.isfinite(values).any():
        raise MapMismatchError(
            ("sensors", name), "no valid samples; expected some: check use, exclude, valid and limits"
        )
    if sensor.standard_deviation != "estimate":
        return SensorRecord(time, values, np.array(sensor.standard_deviation, np.float64), **place), ()
    noise = tuple(estimate_noise(column, is_angle=SENSORS[name][0].unit == "rad") for column in values.T)
    return SensorRecord(time, values, _standard_deviation(name, values, noise), **place), noise


def _standard_deviation(name: str, values: Array, noise: tuple[Noise, ...]) -> Array:
    measured = np.isfinite(values).any(axis=0)
    deviation = np.array([component.standard_deviation for component in noise])
    if not (deviation[measured] > 0.0).all():
        message = "noise unknown, because most samples repeat the one before or continue its trend: state the value"
        raise MapMismatchError(("sensors", name, "standard_deviation"), message)
    # Filters need a number for components that were never measured, too.
    return np.where(measured, deviation, np.nanmax(deviation))


def unintended_gaps(time: Array, use: Spans, exclude: Spans) -> Spans:
    """Return begin and end, s, of the gaps within used spans (all if empty) and outside excluded ones."""
    return tuple(
        (begin, end)
        for begin, end in gaps(time).tolist()
        if not any(first <= end and begin <= last for first, last in exclude)
        and (not use or any(first <= begin and end <= last for first, last in use))
    )


def _summary(
    name: str,
    record: SensorRecord,
    noise: tuple[Noise, ...],
    rows: MeasuredRows,
    excluded: int,
    unrecorded: Spans,
    assumed_level: str,
) -> ImportSummary:
    unit = SENSORS[name][0].unit
    unused = rows.time.size - record.time.size
    estimate = ", ".join(f"{deviation:.3g}" for deviation in record.standard_deviation)
    steps = ", ".join(
        f"{quantity.symbol} {own_noise.step:.3g}"
        for quantity, own_noise in zip(SENSORS[name], noise, strict=False)
        if own_noise.step
    )
    smoothed = ", ".join(
        quantity.symbol
        for quantity, own_noise, values in zip(SENSORS[name], noise, record.values.T, strict=False)
        if not own_noise.step and is_smoothed(values, unit == "rad")
    )
    heading = [k for k, quantity in enumerate(SENSORS[name]) if quantity.symbol in _HEADINGS]
    furthest = float(np.nanmax(np.abs(record.values[:, heading]), initial=0.0))
    treatment = (
        (furthest > 2.0 * np.pi, f"the heading reaches {furthest:.4g} rad: several turns, or degrees without a unit?"),
        (assumed_level, f"no measured roll: {assumed_level} transformed with a roll of 0"),
        (excluded, f"{excluded} samples in excluded spans set to missing"),
        (rows.invalid, f"{rows.invalid} rows invalid, or with a value beyond its limits: set to missing"),
        (rows.repeats, f"{rows.repeats} rows that repeat the one before left out"),
        (unused, f"{unused} samples not in the spans of `use` left out"),
        (noise, f"standard deviation estimated from the signal: {estimate} {unit}"),
        (
            noise and name == "attitude",
            "this is the scatter only; errors of an AHRS are autocorrelated and far larger: state their size",
        ),
        (
            smoothed,
            f"{smoothed} {'were' if ',' in smoothed else 'was'} filtered, so errors are autocorrelated and far larger "
            "than the scatter: state their size",
        ),
        (steps, f"noise smaller than the resolution, assumed to be step / sqrt(12): {steps} {unit}"),
    )
    missing = int(np.count_nonzero(np.isnan(record.values).all(axis=1)))
    remarks = [text for applies, text in treatment if applies]
    if unrecorded:
        longest, begin = max((end - begin, begin) for begin, end in unrecorded)
        remarks.append(
            f"{len(unrecorded)} {'gap' if len(unrecorded) == 1 else 'gaps'}, the longest of {longest:.4g} s from t = "
            f"{begin:.4g} s: leave it out with auvid identify --use, or set identification.use.longest_gap"
        )
    interval = measurements.sampling_interval(record.time, record.values)
    return measurements.summary_of(name, record.time, missing, rows, tuple(remarks), interval)
