"""Columns that contradict their name, and columns that can replace a missing one."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.signals import estimate_noise
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.suggest import names
from auvid_cli.logs.suggest.found_sensors import FoundSensor, sensor_tracks, unwrapped, used_columns
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.names import SENSOR_OF, Match
from auvid_cli.logs.suggest.numbered import correlation
from auvid_cli.logs.suggest.relations import Relation, Signals, Track, fit_relation, on_grid
from auvid_cli.logs.suggest.rows import found_in, tracks_of

RATES = {"phi": "p", "theta": "q", "psi": "r"}
_WINDOW = 1.0  # s, over which changes are taken
_AGREES = 0.8  # smallest correlation of signals that agree
_DISAGREES = {"rate": 0.6, "depth": 0.3}  # largest correlation of a contradiction; heave changes the depth too
_CLEAR = 4.0  # smallest spread of a change, divided by that of its noise
_STEADY = 0.3  # smallest correlation of a signal with itself after `_WINDOW`
_MIN_SECONDS = 60.0  # s, of a log that can contradict a name
_MAX_LAG = 30.0  # s; signals that agree at such a lag have wrong times, not wrong names
ANGLE_UNITS = (1.0, float(np.radians(1.0)))  # angles may be in rad or degrees
# A rate is not among them, because the deflection of a fin may look like the rate that follows it.
_WANTED = ("phi", "theta", "psi", "down")
_ANGLES = {rate: angle for angle, rate in RATES.items()}
_ASKS = 0.3  # largest correlation at which a contradiction without a better column is a question
_MIN_CORRELATION = 0.95
_MAX_GAIN_ERROR = 0.1  # of the logarithm
# Sizes of numbers in usual units: rad and deg; m and ft, because a pressure in mbar is nearly a depth in cm.
_GAINS = {False: (1.0, float(np.degrees(1.0))), True: (1.0, 1.0 / 0.3048)}
_CANDIDATE = "candidate"


def contradictions(tracks: Mapping[str, Track]) -> dict[str, tuple[str, float]]:
    """Return the symbols that move clearly, contradict another signal and agree with none.

    Parameters
    ----------
    tracks : mapping of str to Track
        Signals by symbol; angles may be in rad or degrees.

    Returns
    -------
    dict
        The other symbol and the largest correlation with it at any lag, by symbol. Both signals of a pair may be in
        it: the data do not show then which one has the wrong name.
    """
    smooth = {symbol: Track(track.time, unwrapped(track.values)) for symbol, track in tracks.items()}
    signals = on_grid(smooth, are_unwrapped=True)
    if signals is None or signals.step * next(iter(signals.values.values())).size < _MIN_SECONDS:
        return {}
    found: dict[str, tuple[str, float]] = {}
    supported = set[str]()
    for first, other, pairs in _pairs(signals):
        size = max(_largest_correlation(signals.step, *pair) for pair in pairs)
        if size > _AGREES:
            supported |= {first, other}
        elif size < _DISAGREES["depth" if first == "down" else "rate"] and _is_clear(signals, smooth, first, *pairs[0]):
            found |= {first: (other, size), other: (first, size)}
    return {symbol: why for symbol, why in found.items() if symbol not in supported}


def _change(signals: Signals, symbol: str) -> Array:
    return signals.change(signals.values[symbol], _WINDOW)


def _pairs(signals: Signals) -> Iterator[tuple[str, str, list[tuple[Array, Array]]]]:
    """Yield two symbols, and the signals that should agree for one of the units of angles."""
    rates = [rate for rate in RATES.values() if signals.has(rate)]
    angles = [angle for angle in RATES if signals.has(angle)]
    changes = {angle: _change(signals, angle) for angle in angles}
    means = {rate: signals.mean(rate) for rate in rates}
    crossed = [
        (angle, rate)
        for angle in angles
        for rate in rates
        if RATES[angle] != rate and _largest_correlation(signals.step, changes[angle], means[rate]) > _AGREES
    ]
    # Two angles that follow each other's rate are those of exchanged axes, which other relations find.
    exchanged = {
        symbol
        for angle, rate in crossed
        for symbol in (angle, rate)
        if any((other, RATES[angle]) in crossed for other in angles if RATES[other] == rate)
    }
    for angle in angles:
        rate = RATES[angle]
        if rate in rates and not {angle, rate} & exchanged:
            yield angle, rate, [(changes[angle], means[rate])]
    if signals.has("down", "u") and "theta" in angles and "theta" not in exchanged:
        depth_change, u, theta = _change(signals, "down"), signals.mean("u"), signals.mean("theta")
        climbs = [speed * np.sin(factor * theta) for factor in ANGLE_UNITS for speed in (u, 1.0)]
        # Axes of a DVL to starboard: its second component is the speed; axes of an attitude: its roll is the pitch.
        if "phi" in angles:
            climbs += [np.sin(factor * signals.mean("phi")) for factor in ANGLE_UNITS]
        yield "down", "theta", [(depth_change, climb) for climb in climbs]


def _is_clear(signals: Signals, tracks: Mapping[str, Track], symbol: str, change: Array, other: Array) -> bool:
    """Whether a signal and its counterpart change clearly more than their noise."""
    noise = estimate_noise(tracks[symbol].values).standard_deviation
    spread = float(np.nanstd(change))
    # The counterpart must exceed its noise, too. Then it agrees with itself a little later.
    known = other[np.isfinite(other)]
    lag = max(1, round(_WINDOW / signals.step))
    is_steady = known.size > 2 * lag and correlation(known[:-lag], known[lag:]) > _STEADY
    return spread > (_CLEAR * np.sqrt(2.0) * noise if np.isfinite(noise) else 0.0) and is_steady


def _largest_correlation(step: float, first: Array, other: Array) -> float:
    """Return the largest absolute correlation at any lag; 1 if one signal is constant or unknown."""
    both = np.isfinite(first) & np.isfinite(other)
    if np.count_nonzero(both) * step < _MIN_SECONDS:
        return 1.0
    a, b = (np.where(both, values - np.mean(values[both]), 0.0) for values in (first, other))
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if not size > 0.0:
        return 1.0
    n = 2 * a.size
    of_lags = np.fft.irfft(np.fft.rfft(a, n) * np.conj(np.fft.rfft(b, n)), n) / size
    near = round(1.0 / step)
    far = min(a.size // 4, round(_MAX_LAG / step))
    sizes = np.abs(np.concatenate([of_lags[: far + 1], of_lags[n - far :]]))
    close = np.abs(np.concatenate([of_lags[: near + 1], of_lags[n - near :]]))
    return float(sizes.max()) if sizes.max() > _AGREES else float(close.max())


class _Behaviour(NamedTuple):
    """A column that behaves like a component."""

    correlation: float
    component: str
    log: str
    table: str
    column: LogColumn
    words: str

    @property
    def sensor(self) -> str:
        """Return the sensor of the component."""
        return SENSOR_OF[self.component]


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
    wanted = [symbol for symbol in doubted if _reference(symbol, tracks)]
    best: dict[str, _Behaviour] = {}
    for one in _behaviours(logs, sensors, wanted, tracks):
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
            changed[one.sensor] = _extended(logs, _without(logs, sensor, symbol), one._replace(words=words))
    return changed


def _is_named(sensors: Mapping[str, FoundSensor], symbol: str) -> bool:
    """Whether a component is mapped by the name of its column alone."""
    sensor = sensors.get(SENSOR_OF.get(symbol, ""))
    parts = [part for part in sensor.parts if symbol in part.match.columns] if sensor is not None else []
    return bool(parts) and parts[0].match.message is None


def _column_of(sensor: FoundSensor, symbol: str) -> LogColumn:
    return next(part.match.columns[symbol] for part in sensor.parts if symbol in part.match.columns)


def _without(logs: Mapping[str, Log], sensor: FoundSensor, symbol: str) -> FoundSensor | None:
    """Return a sensor without a component; None if it has no other."""
    parts = []
    for part in sensor.parts:
        columns = {component: column for component, column in part.match.columns.items() if component != symbol}
        if columns:
            parts.append(found_in(logs, part.sensor, part.log, part.match._replace(columns=columns)))
    return sensor._replace(main=parts[0], apart=parts[1:]) if parts else None


def _with_questions(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with a question for each component that still contradicts the motion."""
    asking = dict(sensors)
    for symbol, (other, size) in contradictions(sensor_tracks(logs, sensors)).items():
        if size < _ASKS and _is_named(sensors, symbol):
            sensor = asking[SENSOR_OF[symbol]]
            old = _column_of(sensor, symbol)
            text = (
                f"a column; {old.name} does not agree with {other} (correlation {size:.2f}), and the data do not show "
                f"which one is wrong"
            )
            asking[SENSOR_OF[symbol]] = sensor._replace(questions=(*sensor.questions, (symbol, text)))
    return asking


def _with_missing(logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the sensors, with missing components from columns that behave like them."""
    present = {component for sensor in sensors.values() for part in sensor.parts for component in part.match.columns}
    has_quaternion = "attitude" in sensors and sensors["attitude"].main.is_quaternion
    tracks = sensor_tracks(logs, sensors)
    missing = [
        component
        for component in _WANTED
        if component not in present and not (has_quaternion and component in RATES) and _reference(component, tracks)
    ]
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
    logs: Mapping[str, Log], sensors: Mapping[str, FoundSensor], missing: list[str], tracks: Mapping[str, Track]
) -> Iterator[_Behaviour]:
    if not missing:
        return
    used = used_columns(sensors)
    for name, log in logs.items():
        for table, columns in names.distinct_tables(log.tables()).items():
            is_measured = not (names.is_set_point(table, "") or names.is_filter_output(table))
            if known_message(table, columns, log.path.stem) is not None or not is_measured:
                continue
            tried = [
                column for column in columns if (name, table, column.name) not in used and names.may_measure(column)
            ]
            if not tried or len(tried) > names.MAX_COLUMNS:
                continue
            read = log.read(table, [column.name for column in tried])
            signals = tracks_of(log, table, {key: np.asarray(values, np.float64) for key, values in read.items()})
            for column in tried:
                track = signals.get(column.name)
                if track is None or not np.std(track.values[np.isfinite(track.values)]):
                    continue
                for component in missing:
                    if fit := _agreement(component, track, tracks):
                        yield _Behaviour(fit[0], component, name, table, column, fit[1])


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
