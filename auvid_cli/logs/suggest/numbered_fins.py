"""Fins that have numbers instead of names: channels of a log, and the places on the tail that the data show."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.frames import interpolate
from auvid_cli.logs.suggest.known_formats import KnownMessage, Role, known_message
from auvid_cli.logs.suggest.names import distinct_tables
from auvid_cli.logs.suggest.relations import Track
from auvid_cli.logs.suggest.rows import tracks_of
from auvid_cli.logs.suggest.yaml_lines import Flow

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
    yield from sorted(found, key=lambda channels: channels[0].message is not None and _is_command(channels[0].message))


def _is_command(message: KnownMessage) -> bool:
    return message.role is not Role.MEASURED


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
    return [roles[k] for k in sorted(roles)] if len(roles) == len(fins) and _are_all_different(roles) else []


def _are_all_different(roles: Mapping[int, FinRole]) -> bool:
    return len({role.name for role in roles.values()}) == len(roles)


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
