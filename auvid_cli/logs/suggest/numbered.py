"""Quaternions and axes that names do not tell apart: tried on the data."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.logs.formats.log import Log, LogColumn
from auvid_cli.logs.frames import conjugate, interpolate, product
from auvid_cli.logs.suggest.evidence import TRIPLES, course_direction
from auvid_cli.logs.suggest.found_sensors import FoundSensor, is_over_ground, sensor_tracks
from auvid_cli.logs.suggest.known_formats import known_message
from auvid_cli.logs.suggest.names import Match, distinct_tables
from auvid_cli.logs.suggest.numbered_fins import correlation, numbered
from auvid_cli.logs.suggest.relations import RelationFit, Track, fit_relations
from auvid_cli.logs.suggest.rows import found_in, tracks_of

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


def _numbered_quaternion(columns: Iterable[LogColumn]) -> list[LogColumn]:
    """Return four columns such as q0 to q3; empty without them."""
    found = numbered(_QUATERNION, columns)
    return found if len(found) == 4 else []


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
            four = _numbered_quaternion(columns)
            if not four or known_message(table, columns, log.path.stem) is not None:
                continue
            read = log.read(table, [column.name for column in four])
            tracks = tracks_of(
                log, table, {str(k): np.asarray(values, np.float64) for k, values in enumerate(read.values())}
            )
            if len(tracks) == 4 and (
                order := quaternion_order(
                    tracks["0"].time,
                    np.column_stack([track.values for track in tracks.values()]),
                    list(gyroscope.values()),
                )
            ):
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
            usual[name] = found[name]._replace(
                main=main, notes=(f"check: x and y are exchanged: {reason}",), is_exchanged=True
            )
    return usual


def _has_fixed_axes(match: Match) -> bool:
    return match.message is not None and bool(match.message.frame)
