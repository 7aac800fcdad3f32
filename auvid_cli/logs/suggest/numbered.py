"""Signals that have numbers instead of names: fins, quaternions and axes, told apart by the data."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.frames import conjugate, interpolate, product
from auvid_cli.logs.suggest.evidence import TRIPLES, course_direction
from auvid_cli.logs.suggest.found_sensors import FoundSensor, is_over_ground, sensor_tracks
from auvid_cli.logs.suggest.known_formats import KnownMessage, Role, known_message
from auvid_cli.logs.suggest.names import Match, distinct_tables
from auvid_cli.logs.suggest.relations import RelationFit, Track, fit_relations
from auvid_cli.logs.suggest.rows import found_in, tracks_of
from auvid_cli.text import Flow

_FIN = re.compile(
    r"(?i)(.*\.)?(fin|servo|rudder|plane|surface|delta)s?_?\[?(?P<number>[0-9])\]?(_(deg|rad|angle|pwm|us))?"
)
_CHANNEL = re.compile(r"(C|Ch|chan|output|servo)\[?(?P<number>\d+)\]?(_raw)?")
_CHANNELS = re.compile(r"RCOU|SERVO_OUTPUT_RAW|actuator_outputs")  # tables of the pulses of all servos
_MAX_FINS = 4
_TOGETHER = 0.98  # correlation of fins that move together
_STEP = 0.1  # s
_WINDOW = 10  # steps over which a response is taken
_CLEAR = 0.3  # smallest share of the variance of a response that fins must explain
_PLUS = 0.2  # share below which a response counts as none
_QUATERNION = re.compile(r"(?i)(.*\.)?(q|quat|quaternion)_?\[?(?P<number>[0-4])\]?")
_MAX_NORM_ERROR = 0.05  # largest deviation of a quaternion's length from 1
_MIN_AGREEMENT = 0.6  # mean correlation of turn rates
_CLEARLY_MORE = 0.1
# Axes of a quaternion in those of the gyroscope, each with its sign. A mirrored one has the wrong order.
_USUAL_TURNS = (
    ((0, 1), (1, 1), (2, 1)),
    ((0, 1), (1, -1), (2, -1)),
    ((1, 1), (0, 1), (2, -1)),
)
_RATE_WINDOW = 0.5  # s, over which turn rates of a quaternion are taken
_FAST = 3.0  # ratio of mean speeds at which the axis of the larger one points ahead
_MIN_SPEED = 0.3  # m/s
_EXCHANGE_EVIDENCE = 6.0  # log likelihood by which exchanged axes must agree better


class FinChannel(NamedTuple):
    """Numbers of a fin in a log: a column, or the rows of one servo."""

    column: LogColumn
    track: Track
    log: str
    table: str
    rows: dict[str, Flow]  # entry of the map that chooses the rows; empty for all
    message: KnownMessage | None


def fin_channels(logs: Mapping[str, Log]) -> Iterator[list[FinChannel]]:
    """Yield the channels of each table that may be two to four fins, measured ones before set-points."""
    found = [
        channels
        for name, log in logs.items()
        for table, columns in distinct_tables(log.tables()).items()
        for channels in (_of_columns(log, name, table, columns), _of_servos(log, name, table, columns))
        if 2 <= len(channels) <= _MAX_FINS
    ]
    yield from sorted(
        found, key=lambda channels: (first := channels[0].message) is not None and first.role is not Role.MEASURED
    )


def _of_columns(log: Log, name: str, table: str, columns: Sequence[LogColumn]) -> list[FinChannel]:
    """Return the channels of columns such as fin1 to fin4, or of those pulses of all servos that change."""
    message = known_message(table, columns, log.path.stem)
    is_all = (_CHANNELS.fullmatch(table) if table else _CHANNELS.search(log.path.stem)) is not None
    fins = numbered(_CHANNEL if is_all else _FIN, columns)
    if not fins or (message is not None and not is_all):
        return []
    read = log.read(table, [fin.name for fin in fins])
    values = {fin.name: np.asarray(read[fin.name], np.float64) for fin in fins}
    tracks = tracks_of(log, table, values)
    moving = [fin for fin in fins if fin.name in tracks and (not is_all or _moves(tracks[fin.name].values))]
    return [FinChannel(fin, tracks[fin.name], name, table, {}, message) for fin in moving]


def _of_servos(log: Log, name: str, table: str, columns: Sequence[LogColumn]) -> list[FinChannel]:
    """Return the channels of the servos whose positions share a column, each with an id."""
    message = known_message(table, columns, log.path.stem)
    if message is None or "fins" not in message.fields:
        return []
    read = log.read(table, ["id", message.fields["fins"]])
    column = next(column for column in columns if column.name == message.fields["fins"])
    ids, angles = (np.asarray(read[key], np.float64) for key in ("id", column.name))
    channels = []
    for number in np.unique(ids[np.isfinite(ids)]):
        tracks = tracks_of(log, table, {"fin": angles}, ids == number)
        rows: dict[str, Flow] = {"rows": {"column": "id", "values": (int(number),)}}
        if tracks and _moves(tracks["fin"].values):
            channels.append(FinChannel(column, tracks["fin"], name, table, rows, message))
    return channels


def _moves(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 1 and float(np.ptp(known)) > 0.0


def numbered(pattern: re.Pattern[str], columns: Iterable[LogColumn]) -> list[LogColumn]:
    """Return the columns with numbers by a pattern, in the order of their numbers."""
    matches = [
        (match, column) for column in columns if (match := pattern.fullmatch(column.name)) and not column.is_text
    ]
    return [column for _, column in sorted(matches, key=lambda pair: int(pair[0]["number"]))]


def correlation(first: Array, second: Array) -> float:
    """Return the correlation of the rows in which both signals have numbers; 0 if one is constant."""
    both = np.isfinite(first) & np.isfinite(second)
    first, second = first[both], second[both]
    if first.size < 3 or not np.ptp(first) > 0.0 or not np.ptp(second) > 0.0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])


class FinRole(NamedTuple):
    """Place of a fin on the tail and its sign."""

    name: str  # as in the map, such as upper_right
    sign: int
    reason: str


def fin_roles(fins: Sequence[Track], yaw_rate: Track | None, pitch_rate: Track | None) -> list[FinRole]:
    """Return the place of each fin by which rates answer it; empty if the data do not show it.

    A fin of an x tail moves yaw and pitch, one of a cross moves one of them. Which fin of a pair is the upper or the
    right one does not show in yaw and pitch, only in roll.
    """
    if yaw_rate is None or pitch_rate is None:
        return []
    begin, end = max(t.time[0] for t in (*fins, yaw_rate)), min(t.time[-1] for t in (*fins, yaw_rate))
    grid = np.arange(begin, end, _STEP)
    if grid.size < 20 * _WINDOW:
        return []
    angles = [interpolate(fin.time, fin.values[:, None], grid)[:, 0] for fin in fins]
    pairs: list[list[int]] = []
    for k, angle in enumerate(angles):
        pair = next((p for p in pairs if abs(correlation(angles[p[0]], angle)) > _TOGETHER), None)
        if pair is None:
            pairs.append([k])
        else:
            pair.append(k)
    if len(pairs) != 2:
        return []
    heads = [angles[pair[0]] for pair in pairs]
    yaw, pitch = (_effects(grid, rate, heads) for rate in (yaw_rate, pitch_rate))
    if yaw is None or pitch is None:
        return []
    roles: dict[int, FinRole] = {}
    for number, pair in enumerate(pairs):
        rudder, elevator = -yaw[number], -pitch[number]
        names, sign, what = _places(rudder, elevator)
        together = " and ".join(f"no. {k + 1}" for k in pair)
        for name, k in zip(names, pair, strict=False):
            own = 1 if correlation(angles[pair[0]], angles[k]) > 0.0 else -1
            reason = f"{together} move together, {what}" if len(pair) > 1 else what
            roles[k] = FinRole(name, sign * own, reason)
    are_all_different = len({role.name for role in roles.values()}) == len(fins)
    return [roles[k] for k in sorted(roles)] if are_all_different else []


def _places(rudder: float, elevator: float) -> tuple[tuple[str, str], int, str]:
    """Return the places of a pair of fins, the sign of the first, and the response; arguments are relative effects."""
    if abs(elevator) < _PLUS * abs(rudder):
        return ("top", "bottom"), 1 if rudder > 0.0 else -1, "yaw responds"
    if abs(rudder) < _PLUS * abs(elevator):
        return ("right", "left"), 1 if elevator > 0.0 else -1, "pitch responds"
    sign = 1 if rudder > 0.0 else -1
    same = rudder * elevator > 0.0
    return (("lower_right", "upper_left") if same else ("upper_right", "lower_left")), sign, "yaw and pitch respond"


def _effects(grid: Array, rate: Track, heads: Sequence[Array]) -> Array | None:
    """Return the effects of fins on a rate, relative to the largest; None if they explain too little of it."""
    on_grid = interpolate(rate.time, rate.values[:, None], grid)[:, 0]
    change = on_grid[_WINDOW:] - on_grid[:-_WINDOW]
    means = [np.convolve(head, np.full(_WINDOW + 1, 1.0 / (_WINDOW + 1)), "valid") for head in heads]
    # The weight rights the pitch; the integral of a rate drifts with its bias.
    angle = np.cumsum(np.where(np.isfinite(on_grid), on_grid, 0.0))
    before = [values[:-_WINDOW] for values in (on_grid, angle, grid)]
    design = np.column_stack([*means, *before, np.ones(change.size)])
    usable = np.isfinite(design).all(axis=1) & np.isfinite(change)
    if np.count_nonzero(usable) < 20 * _WINDOW:
        return None
    design, change = design[usable], change[usable]
    size = np.maximum(np.abs(design).max(axis=0), np.finfo(np.float64).tiny)
    effects, *_ = np.linalg.lstsq(design / size, change, rcond=None)
    rest = change - (design / size) @ effects
    explained = 1.0 - float(rest @ rest) / max(float(change @ change), np.finfo(np.float64).tiny)
    effects = effects[: len(heads)] / size[: len(heads)]
    largest = float(np.abs(effects).max())
    return effects / largest if explained > _CLEAR and largest > 0.0 else None


class Order(NamedTuple):
    """Order of the components of a quaternion, and the reason."""

    axes: str
    reason: str


def quaternion_order(time: Array, values: Array, rates: Sequence[Track]) -> Order | None:
    """Return the order of four numbers that are a quaternion; None if they are none.

    Parameters
    ----------
    time : ndarray, shape (n,)
    values : ndarray, shape (n, 4)
    rates : sequence of Track
        Turn rates of a gyroscope about three axes; they may be missing.
    """
    usable = np.isfinite(values).all(axis=1)
    time, values = time[usable], values[usable]
    if time.size < 3 or np.abs(np.linalg.norm(values, axis=1) - 1.0).max() > _MAX_NORM_ERROR:
        return None
    by_order = {"wxyz": values, "xyzw": values[:, [3, 0, 1, 2]]}
    if len(rates) == 3:
        cells = max(1, round(_RATE_WINDOW / float(np.median(np.diff(time)))))
        weights = np.full(cells + 1, 1.0 / (cells + 1))
        on_grid = (interpolate(rate.time, rate.values[:, None], time)[:, 0] for rate in rates)
        measured = [np.convolve(rate, weights, "valid") for rate in on_grid]
        agreement = {axes: _agreement(_rates(time, q, cells), measured) for axes, q in by_order.items()}
        axes = max(agreement, key=lambda axes: agreement[axes])
        other = min(agreement.values())
        if agreement[axes] > max(_MIN_AGREEMENT, other + _CLEARLY_MORE):
            words = f"its turn rates agree with the gyroscope: mean correlation {agreement[axes]:.2f}"
            return Order(axes, f"{words}, in the other order {other:.2f}")
    return Order("wxyz", "check: w first or last? No gyroscope shows it")


def _rates(time: Array, quaternion: Array, cells: int) -> Array:
    """Return the turn rates of a quaternion about its body axes over some steps, rad/s, shape (3, n - cells)."""
    steps = product(conjugate(quaternion[:-cells]), quaternion[cells:])
    return 2.0 * (steps * np.sign(steps[:, :1]))[:, 1:].T / (time[cells:] - time[:-cells])


def _agreement(rates: Array, measured: Sequence[Array]) -> float:
    """Return the mean correlation of turn rates in the usual pair of axes in which it is largest."""
    return max(
        float(np.mean([sign * correlation(rates[k], measured[axis]) for k, (axis, sign) in enumerate(axes)]))
        for axes in _USUAL_TURNS
    )


def exchanged_axes(tracks: Mapping[str, Track], may_be_over_ground: bool) -> dict[str, str]:
    """Return the sensors whose x and y axes are exchanged (right, forward), each with the reason."""
    exchanged: dict[str, str] = {}
    if {"u", "v"} <= {*tracks} and not may_be_over_ground:
        ahead, aside = (float(np.abs(np.nanmean(tracks[symbol].values))) for symbol in ("u", "v"))
        if aside > max(_MIN_SPEED, _FAST * ahead):
            exchanged["dvl"] = (
                f"the mean speed along its second axis is {aside:.3g} m/s, along its first {ahead:.2g} m/s"
            )
    for sensor, pair in (("gyroscope", ("p", "q")), ("accelerometer", ("fx", "fy"))):
        own = {symbol: tracks[symbol] for symbol in (*pair, "phi", "theta") if symbol in tracks}
        if {*pair} <= {*own} and {"phi", "theta"} <= {*own}:
            crossed = own | {pair[0]: own[pair[1]], pair[1]: own[pair[0]]}
            as_named, as_crossed = (fit_relations(of) for of in (own, crossed))
            if _weight(as_crossed) > _weight(as_named) + _EXCHANGE_EVIDENCE:
                words = ", ".join(f"{fit.words} ({abs(fit.correlation):.2f})" for fit in as_crossed if fit.weight)
                exchanged["attitude" if _depth_follows_roll(tracks) else sensor] = words
    return exchanged


def _depth_follows_roll(tracks: Mapping[str, Track]) -> bool:
    """Whether the attitude itself has exchanged axes: the depth changes with its roll, not with its pitch."""
    own = {symbol: tracks[symbol] for symbol in ("down", "u", "theta") if symbol in tracks}
    if "down" not in own:
        return False
    crossed = own | {"theta": tracks["phi"]}
    return _weight(fit_relations(crossed)) > _weight(fit_relations(own)) + _EXCHANGE_EVIDENCE


def _weight(fits: Sequence[RelationFit]) -> float:
    return sum(abs(fit.weight) for fit in fits)


def numbered_attitude(logs: Mapping[str, Log], found: Mapping[str, FoundSensor]) -> dict[str, FoundSensor]:
    """Return the attitude of four columns such as q0 to q3, in the order that the gyroscope shows."""
    gyroscope = sensor_tracks(logs, {name: sensor for name, sensor in found.items() if name == "gyroscope"})
    for name, log in logs.items():
        for table, columns in distinct_tables(log.tables()).items():
            four = numbered(_QUATERNION, columns)
            if len(four) != 4 or known_message(table, columns, log.path.stem) is not None:
                continue
            read = log.read(table, [column.name for column in four])
            tracks = tracks_of(log, table, {key: np.asarray(values, np.float64) for key, values in read.items()})
            if not tracks:
                continue
            time, values = tracks[four[0].name].time, np.column_stack([track.values for track in tracks.values()])
            if order := quaternion_order(time, values, list(gyroscope.values())):
                by_axis = dict(sorted(zip(order.axes, four, strict=True)))
                main = found_in(logs, "attitude", name, Match(table, by_axis))
                return {"attitude": FoundSensor(main, [], (f"order {order.axes}: {order.reason}",))}
    return {}


def in_usual_order(found: Mapping[str, FoundSensor], tracks: Mapping[str, Track]) -> dict[str, FoundSensor]:
    """Exchange the first two components of sensors whose x axis points to starboard."""
    is_fixed = "dvl" in found and (_has_fixed_axes(found["dvl"].main.match) or is_over_ground(found["dvl"].main.match))
    reasons = exchanged_axes(tracks, is_fixed or course_direction(tracks) != 0)
    usual = dict(found)
    for name, reason in reasons.items():
        if name == "attitude":
            main = found[name].main._replace(is_right_forward_up=True)
            if set(main.numbers) in ({*TRIPLES[name]}, {*"wxyz"}):
                usual[name] = found[name]._replace(main=main)
            continue
        main, (first, second, _) = found[name].main, TRIPLES[name]
        if {first, second} <= {*main.numbers} and not _has_fixed_axes(main.match):
            swap = {first: second, second: first}
            columns = {key: main.match.columns[swap.get(key, key)] for key in main.match.columns}
            numbers = {key: main.numbers[swap.get(key, key)] for key in main.numbers}
            main = main._replace(match=main.match._replace(columns=columns), numbers=numbers)
            notes = (f"check: x and y are exchanged: {reason}",)
            usual[name] = found[name]._replace(main=main, notes=notes, is_exchanged=True)
    return usual


def _has_fixed_axes(match: Match) -> bool:
    return match.message is not None and bool(match.message.frame)
