"""Columns that behave like a component that no column is named after, or only one that contradicts the motion."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.contradictions import ANGLE_UNITS, RATES, contradictions
from auvid_cli.logs.suggest.filtered import unwrapped
from auvid_cli.logs.suggest.found_sensors import FoundSensor, sensor_tracks, used_columns
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.names import Match
from auvid_cli.logs.suggest.relations import Relation, Signals, Track, fit_relation, on_grid
from auvid_cli.logs.suggest.rows import found_in, tracks_of

# A rate is not among them, because the deflection of a fin may look like the rate that follows it.
_SENSORS = {"attitude": ("phi", "theta", "psi"), "depth": ("down",)}
_ANGLES = {rate: angle for angle, rate in RATES.items()}
_SENSOR_OF = {"phi": "attitude", "theta": "attitude", "psi": "attitude", "down": "depth"}
_SENSOR_OF |= dict.fromkeys("pqr", "gyroscope")
_ASKS = 0.3  # largest correlation at which a contradiction without a better column is a question
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
    """Return the sensors, with components that are missing or contradicted from columns that behave like them.

    A contradicted component without such a column, or of a pair of which either may be wrong, becomes a question.
    """
    # Twice, because a depth is found by the pitch, which may itself be missing at first.
    found = _with_missing(logs, _with_missing(logs, _without_contradicted(logs, sensors)))
    return _with_questions(logs, found)


def _without_contradicted(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with other columns for components that contradict the motion, where one fits."""
    tracks = sensor_tracks(logs, sensors)
    doubted = {symbol: why for symbol, why in contradictions(tracks).items() if _is_named(sensors, symbol)}
    wanted = [(_SENSOR_OF[symbol], symbol) for symbol in doubted if _reference(symbol, tracks)]
    best: dict[str, _Behaviour] = {}
    for one in _behaviours(logs, sensors, wanted, tracks) if wanted else ():
        if one.component not in best or one.correlation > best[one.component].correlation:
            best[one.component] = one
    changed = dict(sensors)
    for symbol, one in best.items():
        other, size = doubted[symbol]
        # If both have a better column, nothing shows which of both is wrong.
        if other not in best:
            sensor = changed[one.sensor]
            old = _column_of(sensor, symbol)
            words = f"{one.words}; {old.name} does not agree with {other} (correlation {size:.2f})"
            changed |= _without(logs, one.sensor, sensor, symbol)
            left = changed[one.sensor] if changed[one.sensor].main.match.columns else None
            changed[one.sensor] = _extended(logs, left, one._replace(words=words))
    return changed


def _is_named(sensors: Mapping[str, FoundSensor], symbol: str) -> bool:
    """Whether a component is mapped by the name of its column alone."""
    sensor = sensors.get(_SENSOR_OF.get(symbol, ""))
    parts = [part for part in sensor.parts if symbol in part.match.columns] if sensor is not None else []
    return bool(parts) and parts[0].match.message is None


def _column_of(sensor: FoundSensor, symbol: str) -> LogColumn:
    return next(part.match.columns[symbol] for part in sensor.parts if symbol in part.match.columns)


def _without(logs: Mapping[str, Log], name: str, sensor: FoundSensor, symbol: str) -> dict[str, FoundSensor]:
    """Return a sensor without a component, by its name."""
    parts = []
    for part in sensor.parts:
        columns = {component: column for component, column in part.match.columns.items() if component != symbol}
        if columns:
            parts.append(found_in(logs, name, part.log, part.match._replace(columns=columns)))
    if not parts:
        empty = sensor.main._replace(match=sensor.main.match._replace(columns={}))
        return {name: sensor._replace(main=empty, apart=[])}
    return {name: sensor._replace(main=parts[0], apart=parts[1:])}


def _with_questions(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with a question for each component that still contradicts the motion."""
    asking = dict(sensors)
    for symbol, (other, size) in contradictions(sensor_tracks(logs, sensors)).items():
        if size < _ASKS and _is_named(sensors, symbol):
            sensor = asking[_SENSOR_OF[symbol]]
            old = _column_of(sensor, symbol)
            text = (
                f"a column; {old.name} does not agree with {other} (correlation {size:.2f}), and nothing shows which "
                f"of both is wrong"
            )
            asking[_SENSOR_OF[symbol]] = sensor._replace(questions=(*sensor.questions, (symbol, text)))
    return asking


def _with_missing(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
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
    other = (RATES | _ANGLES).get(component, "theta")
    # Without a speed, nothing tells the size of a depth.
    return other if other in tracks and (component != "down" or "u" in tracks) else ""


def _behaviours(
    logs: Mapping[str, Log],
    sensors: Mapping[str, FoundSensor],
    missing: list[tuple[str, str]],
    tracks: Mapping[str, Track],
) -> Iterator[_Behaviour]:
    used = used_columns(sensors)
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
    if component in RATES:
        track = track._replace(values=unwrapped(track.values))
    signals = on_grid({_CANDIDATE: track} | involved)
    if signals is None:
        return None
    # The unit of the pitch may be unknown yet.
    factors = ANGLE_UNITS if component == "down" else (1.0,)
    relations = [_relation(component, other, signals, factor) for factor in factors]
    for fit in (fit_relation(one, signals.step) for one in relations):
        if fit is None or abs(fit.correlation) < _MIN_CORRELATION:
            continue
        gain = 1.0 / fit.gain if component in RATES else fit.gain
        if any(abs(np.log(gain / unit)) < _MAX_GAIN_ERROR for unit in _GAINS[component == "down"]):
            return abs(fit.correlation), f"{fit.words} (correlation {abs(fit.correlation):.2f})"
    return None


def _relation(component: str, other: str, s: Signals, factor: float) -> Relation:
    if component in RATES:
        return Relation((_CANDIDATE,), f"{other} is its rate", s.mean(other), s.rate(_CANDIDATE))
    if component in _ANGLES:
        return Relation((_CANDIDATE,), f"it is the rate of {other}", s.mean(_CANDIDATE), s.rate(other))
    diving = -s.mean("u") * np.sin(factor * s.mean("theta"))
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
