"""Columns that behave like a component that no column is named after."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.found_sensors import FoundSensor, sensor_tracks
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.names import Match
from auvid_cli.logs.suggest.relations import Relation, Signals, Track, fit_relation, on_grid
from auvid_cli.logs.suggest.rows import found_in, tracks_of

# A rate is not among them, because the deflection of a fin may look like the rate that follows it.
_SENSORS = {"attitude": ("phi", "theta", "psi"), "depth": ("down",)}
_RATES = {"phi": "p", "theta": "q", "psi": "r"}
_MIN_CORRELATION = 0.95
_MAX_GAIN_ERROR = 0.1  # of the logarithm
# Sizes of numbers in usual units: rad and deg; m and ft, because a pressure in mbar is nearly a depth in cm.
_GAINS = {False: (1.0, float(np.degrees(1.0))), True: (1.0, 1.0 / 0.3048)}
_MAX_COLUMNS = 40  # columns of a table that are tried; more are those of images and the like
_CANDIDATE = "candidate"


class _Behaviour(NamedTuple):
    """A column that behaves like a component."""

    correlation: float
    sensor: str
    component: str
    log: str
    table: str
    column: LogColumn
    words: str


def with_behaviour(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with missing components from columns that behave like them."""
    present = {component for sensor in sensors.values() for part in sensor.parts for component in part.match.columns}
    has_quaternion = "attitude" in sensors and sensors["attitude"].main.is_quaternion
    missing = [
        (sensor, component)
        for sensor, components in _SENSORS.items()
        for component in components
        if component not in present and not (has_quaternion and sensor == "attitude")
    ]
    tracks = sensor_tracks(logs, sensors)
    missing = [(sensor, component) for sensor, component in missing if _reference(component, tracks)]
    if not missing:
        return dict(sensors)
    found = sorted(_behaviours(logs, sensors, missing, tracks), key=lambda one: one.correlation, reverse=True)
    extended = dict(sensors)
    taken = set[object]()
    for one in found:
        place = one.log, one.table, one.column.name
        if place not in taken and one.component not in taken:
            taken |= {place, one.component}
            extended[one.sensor] = _extended(logs, extended.get(one.sensor), one)
    return extended


def _reference(component: str, tracks: Mapping[str, Track]) -> str:
    """Return the measured symbol with which a component is compared; empty without one."""
    other = _RATES.get(component, "theta")
    # Without a speed, nothing tells the size of a depth.
    return other if other in tracks and (component != "down" or "u" in tracks) else ""


def _behaviours(
    logs: Mapping[str, Log],
    sensors: Mapping[str, FoundSensor],
    missing: list[tuple[str, str]],
    tracks: Mapping[str, Track],
) -> Iterator[_Behaviour]:
    used = {
        (part.log, part.match.table, column.name)
        for sensor in sensors.values()
        for part in sensor.parts
        for column in part.match.columns.values()
    }
    for name, log in logs.items():
        for table, columns in names.distinct_tables(log.tables()).items():
            is_measured = not (names.is_set_point(table, "") or names.is_filter_output(table))
            if known_message(table, columns, log.path.stem) is not None or not is_measured:
                continue
            tried = [
                column for column in columns if (name, table, column.name) not in used and names.may_measure(column)
            ]
            if not tried or len(tried) > _MAX_COLUMNS:
                continue
            read = log.read(table, [column.name for column in tried])
            signals = tracks_of(log, table, {key: np.asarray(values, np.float64) for key, values in read.items()})
            for column in tried:
                track = signals.get(column.name)
                if track is None or not np.nanstd(
                    track.values[np.isfinite(track.values)] if track.values.size else 0.0
                ):
                    continue
                for sensor, component in missing:
                    if fit := _agreement(component, track, tracks):
                        yield _Behaviour(fit[0], sensor, component, name, table, column, fit[1])


def _agreement(component: str, track: Track, tracks: Mapping[str, Track]) -> tuple[float, str] | None:
    """Return the correlation of a column with what a component would be, and the words for it; None if it is small."""
    other = _reference(component, tracks)
    involved = {other: tracks[other]} | ({"u": tracks["u"]} if component == "down" else {})
    signals = on_grid({_CANDIDATE: track} | involved)
    if signals is None:
        return None
    relation = _relation(component, other, signals)
    fit = fit_relation(relation, signals.step)
    if fit is None or abs(fit.correlation) < _MIN_CORRELATION:
        return None
    gain = fit.gain if component == "down" else 1.0 / fit.gain
    if not any(abs(np.log(gain / unit)) < _MAX_GAIN_ERROR for unit in _GAINS[component == "down"]):
        return None
    return abs(fit.correlation), f"{relation.words} (correlation {abs(fit.correlation):.2f})"


def _relation(component: str, other: str, s: Signals) -> Relation:
    if component in _RATES:
        return Relation((_CANDIDATE,), f"{other} is its rate", s.mean(other), s.rate(_CANDIDATE))
    diving = -s.mean("u") * np.sin(s.mean("theta"))
    return Relation((_CANDIDATE,), "it changes with u sin(theta)", s.rate(_CANDIDATE), diving)


def _extended(logs: Mapping[str, Log], sensor: FoundSensor | None, one: _Behaviour) -> FoundSensor:
    """Return a sensor with a further component, or a new sensor of this component."""
    note = f"check: {one.component} by its behaviour, not by its name: {one.words}"
    match = Match(one.table, {one.component: one.column})
    if sensor is None:
        return FoundSensor(found_in(logs, one.sensor, one.log, match), [], (note,))
    main, apart = sensor.main, sensor.apart
    if (main.log, main.match.table) == (one.log, one.table):
        columns = {**main.match.columns, one.component: one.column}
        main = found_in(logs, one.sensor, one.log, main.match._replace(columns=columns))
    else:
        apart = [*apart, found_in(logs, one.sensor, one.log, match)]
    return sensor._replace(main=main, apart=apart, notes=(*sensor.notes, note))
