"""Figures of the path, of the motion and of its errors."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D

from auvid_cli.arrays import Array, wrap
from auvid_cli.data.dataset import SensorRecord, TruthRecord
from auvid_cli.data.estimate import EstimateHistory
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.report.figures import style
from auvid_cli.report.plot_data import (
    around,
    finite,
    scale_of,
    spaced,
    thin,
    travelled,
    travelled_paths,
    unwrapped,
    value_range,
    with_margin,
)
from auvid_cli.report.table import filter_label, symbol_math
from auvid_cli.vehicle.parameters import DEPTH, MOTION, MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity, state_of

_HEIGHT = 5.8
_PATH_POINTS = 1000
_SPACE_POINTS = 500
_MAX_DISTANCE = 2.0  # largest distance of a path from its start, in extents of the first path
_SHADOW: dict[str, Any] = {"color": "0.75", "linewidth": 0.8}
_ENDS = (("start", "o", "white"), ("end", "s", "0.4"))
_ZOOM = 30.0  # s, end of the run that is drawn enlarged
_MOTION_POINTS = 1200
_ERROR_POINTS = 250
_HALF_HEIGHT = 2.0  # half height of a panel, in usual bands or usual errors
_USUAL_PERCENTILE = 90.0  # percentile of the errors that is a usual error


class _Track(NamedTuple):
    """A path, m: north, east, down over time, s; and how its line looks."""

    label: str
    time: Array
    position: Array
    line: dict[str, Any]


def path_figure(truth: TruthRecord | None, estimates: list[EstimateHistory]) -> Figure:
    """Draw the true path, and dead reckoning from the estimated motion."""
    tracks = _tracks(truth, estimates)
    figure = style.sized_figure(style.WIDTH, _HEIGHT)
    has_distance = truth is not None and len(tracks) > 1
    grid = figure.add_gridspec(
        3,
        2,
        **{"left": 0.02, "right": 0.98, "bottom": 0.085, "top": 0.93, "wspace": 0.14, "hspace": 0.55},
        width_ratios=[1.15, 1.0],
        height_ratios=[2.2, 1.0, 1.0],
    )
    views, plan = figure.add_subplot(grid[:, 0], projection="3d"), figure.add_subplot(grid[0, 1])
    assert isinstance(views, Axes3D)
    if not tracks:
        style.show_message(plan, "no finite position")
        return figure
    profile = figure.add_subplot(grid[1, 1] if has_distance else grid[1:, 1])
    _draw_in_space(views, tracks, _depth_name(truth, estimates), _how_estimated(estimates))
    _draw_plan(plan, tracks)
    _draw_profile(profile, tracks, _depth_name(truth, estimates))
    if has_distance:
        _draw_distance(figure.add_subplot(grid[2, 1]), tracks[0], tracks[1:])
    ends = [Line2D([], [], label=label, **_end(marker, face)) for label, marker, face in _ENDS]
    style.legend_above(figure, [*(Line2D([], [], label=track.label, **track.line) for track in tracks), *ends])
    return figure


def _tracks(truth: TruthRecord | None, estimates: list[EstimateHistory]) -> list[_Track]:
    tracks: list[_Track] = []
    # Without truth, a completed estimate comes first and sets the scale.
    for track in travelled_paths(truth, sorted(estimates, key=lambda estimate: not estimate.completed)):
        position = _as_far_as_others(track.position, tracks[0].position) if tracks else track.position
        if track.filter is None:
            tracks.append(_Track("true", track.time, position, style.TRUE_LINE))
        elif len(position) > 1:
            line = style.FILTER_STYLES[track.filter].line()
            tracks.append(_Track(filter_label(track.filter), track.time[: len(position)], position, line))
    return tracks


def _as_far_as_others(position: Array, first: Array) -> Array:
    """Cut the path of a diverged filter where it leaves the surroundings of the first path."""
    room = _MAX_DISTANCE * max(float(np.ptp(first, axis=0).max()), 1.0)
    beyond = np.linalg.norm(position - first[0], axis=1) > room
    return position[: int(beyond.argmax())] if beyond.any() else position


def _depth_name(truth: TruthRecord | None, estimates: list[EstimateHistory]) -> str:
    """Return the label of the depth; without truth and depth sensor it is integrated from the start and drifts."""
    return "depth (m)" if truth is not None or _has_depth(estimates) else "depth below the start (m)"


def _has_depth(estimates: list[EstimateHistory]) -> bool:
    """Whether all estimates have the depth as a state; otherwise it comes from dead reckoning."""
    return all(DEPTH.symbol in estimate.state for estimate in estimates)


def _how_estimated(estimates: list[EstimateHistory]) -> str:
    """Return a note on the origin of the estimated paths."""
    if _has_depth(estimates):
        return "estimates: depth as estimated; north and east by dead reckoning, which drifts"
    return "estimates: dead reckoning from velocity and attitude; it drifts"


def _draw_in_space(axes: Axes3D, tracks: list[_Track], depth_name: str, origin: str) -> None:
    """Draw only the first path and its plan below, because the others would hide it."""
    position = tracks[0].position
    north, east, down = position[spaced(len(position), _SPACE_POINTS)].T
    # East, north and up, in this order, make a right-handed view with depth growing downwards.
    wide = _square(east, north)
    depth = _range(down)
    axes.plot(east, north, np.full(down.size, depth[1]), **_SHADOW)
    axes.plot(east, north, down, color="black", linewidth=1.1)
    for (_, marker, face), at in zip(_ENDS, (0, -1), strict=True):
        axes.plot(east[[at]], north[[at]], down[[at]], **_end(marker, face))
    axes.set(xlim=wide[0], ylim=wide[1], zlim=depth[::-1])
    axes.set_xlabel("east (m)", fontsize=9)
    axes.set_ylabel("north (m)", fontsize=9)
    axes.set_zlabel(depth_name, fontsize=9)
    axes.tick_params(labelsize=8)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(5))
    axes.set_box_aspect((1.0, 1.0, 0.75))
    axes.grid(False)
    words = f"{tracks[0].label}, above its plan; depth not to scale\n{origin}"
    axes.text2D(0.03, 0.94, words, transform=axes.transAxes, fontsize=9, color="0.35")


def _draw_plan(axes: Axes, tracks: list[_Track]) -> None:
    for track in _upwards(tracks):
        some = spaced(len(track.position), _PATH_POINTS)
        _draw(axes, track.position[some, 1], track.position[some, 0], track)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)", fontsize=9)
    axes.set_ylabel("north (m)", fontsize=9)


def _upwards(tracks: list[_Track]) -> list[_Track]:
    """Return the tracks in drawing order: wide lines first, the true path last."""
    return [*tracks[1:], tracks[0]]


def _draw_profile(axes: Axes, tracks: list[_Track], depth_name: str) -> None:
    for track in _upwards(tracks):
        some = spaced(len(track.position), _PATH_POINTS)
        position = track.position[some]
        _draw(axes, travelled(position), position[:, 2], track)
    axes.set_ylim(*_range(tracks[0].position[:, 2])[::-1])
    axes.set_xlabel("distance along the track (m)", fontsize=9)
    axes.set_ylabel(depth_name, fontsize=9)


def _draw_distance(axes: Axes, true: _Track, others: list[_Track]) -> None:
    """Draw the distance of dead reckoning from the true path over time."""
    style.tidy(axes)
    for position, track in enumerate(others):
        some = spaced(len(track.position), _PATH_POINTS)[1:]
        time = track.time[some]
        at = np.stack([np.interp(time, true.time, column) for column in true.position.T], axis=1)
        distance = np.linalg.norm(track.position[some] - at, axis=1)
        axes.plot(time, distance, **track.line, zorder=2.0 + 0.1 * position)
    axes.set_yscale("log")
    style.plain_log_ticks(axes.yaxis)
    axes.set_xlabel("time (s)", fontsize=9)
    axes.set_ylabel("position error (m)", fontsize=9)


def _draw(axes: Axes, x: Array, y: Array, track: _Track) -> None:
    style.tidy(axes)
    axes.plot(x, y, **track.line)
    for (_, marker, face), at in zip(_ENDS, (0, -1), strict=True):
        axes.plot(x[[at]], y[[at]], **_end(marker, face), zorder=4.0)


def _end(marker: str, face: str) -> dict[str, Any]:
    return {"marker": marker, "markerfacecolor": face, "markeredgecolor": "black", "linestyle": "", "markersize": 6}


def _range(values: Array) -> tuple[float, float]:
    return with_margin(*(value_range(values) or (0.0, 0.0)))


def _square(east: Array, north: Array) -> list[tuple[float, float]]:
    """Return limits of equal length around both."""
    ranges = [_range(east), _range(north)]
    half = max(high - low for low, high in ranges) / 2.0
    return [((low + high) / 2.0 - half, (low + high) / 2.0 + half) for low, high in ranges]


class Curve(NamedTuple):
    """A drawable signal over time, s, in the unit of `scale_of`."""

    time: Array
    values: Array


def motion_figure(quantities: Sequence[Quantity], sensors: dict[str, SensorRecord], runs: dict[str, FreeRun]) -> Figure:
    """Draw a row for each motion state or the depth: the whole run, and its end enlarged.

    Parameters
    ----------
    quantities : sequence of Quantity
        Motion states, and the depth if the runs have it.
    runs : dict of FreeRun
        By filter.
    """
    figure = style.new_figure(11.0, 1.75 * len(quantities) + 0.8)
    panels = figure.subplots(len(quantities), 2, sharex="col", squeeze=False, width_ratios=[2.2, 1.0])
    signals = [(_measured(q, sensors), _predicted(q, runs)) for q in quantities]
    begin, end = _span([curve for measured, predicted in signals for curve in [measured, *predicted.values()]])
    zoom = end - min(_ZOOM, 0.5 * (end - begin))
    for (whole, part), quantity, (measured, predicted) in zip(panels, quantities, signals, strict=True):
        whole.set_ylabel(f"{symbol_math(quantity.symbol)} ({scale_of(quantity).unit})", fontsize=9)
        _draw_motion_panel(whole, measured, predicted, (begin, end), 0.4)
        _draw_motion_panel(part, measured, predicted, (zoom, end), 1.0)
        if measured is None:
            whole.text(0.01, 0.97, "not measured", transform=whole.transAxes, va="top", fontsize=8, color="0.35")
    style.head(panels[0, 0], "whole run")
    style.head(panels[0, 1], f"last {end - zoom:.3g} s")
    for axes in panels[-1]:
        axes.set_xlabel("time (s)", fontsize=9)
    predictions = style.filter_handles(runs)
    for handle in predictions:
        handle.set_label(f"{handle.get_label()}, free run")
    style.legend_above(figure, [Line2D([], [], label="measured", **style.MEASURED), *predictions])
    return figure


def _draw_motion_panel(
    axes: Axes, measured: Curve | None, predicted: dict[str, Curve], span: tuple[float, float], width: float
) -> None:
    """Draw a span of time, s, with lines of `width` times their usual width."""
    style.tidy(axes)
    every, sound = [], []
    for position, (name, curve) in enumerate(predicted.items()):
        time, values = _part(curve, span[0])
        every.append(values)
        if np.isfinite(values).all():
            sound.append(values)
        line = _narrowed(style.FILTER_STYLES[name].line(), width)
        axes.plot(*thin(time, values, _MOTION_POINTS), **line, zorder=2.0 + 0.1 * position)
    # The measurements set the scale or, without any, the runs that stayed finite.
    reference = value_range(*sound)
    if measured is not None:
        time, values = _part(measured, span[0])
        known = np.isfinite(values)
        axes.plot(*thin(time[known], values[known], _MOTION_POINTS), **_narrowed(style.MEASURED, width), zorder=1.9)
        reference = value_range(values) or reference
    others = value_range(*every)
    if reference is None and others is None:
        style.show_message(axes, "nothing finite to draw")
    axes.set_ylim(*around(reference, others))
    axes.set_xlim(*span)


def _narrowed(line: dict[str, Any], width: float) -> dict[str, Any]:
    return line | {"linewidth": width * line["linewidth"]}


def _measured(quantity: Quantity, sensors: dict[str, SensorRecord]) -> Curve | None:
    for name, record in sensors.items():
        symbols = [state_of(component) for component in SENSORS[name]]
        if quantity.symbol in symbols and record.time.size:
            values = record.values[:, symbols.index(quantity.symbol)]
            if np.isfinite(values).any():
                return Curve(record.time, _drawable(quantity, values))
    return None


def _predicted(quantity: Quantity, runs: dict[str, FreeRun]) -> dict[str, Curve]:
    column = MOTION_AND_DEPTH_SYMBOLS.index(quantity.symbol)
    return {
        name: Curve(run.time, _drawable(quantity, run.motion[:, column])) for name, run in runs.items() if run.time.size
    }


def _drawable(quantity: Quantity, values: Array) -> Array:
    return scale_of(quantity).factor * (unwrapped(values) if quantity.unit == "rad" else finite(values))


def _span(curves: list[Curve | None]) -> tuple[float, float]:
    """Return begin and end of all time, s."""
    begin, end = value_range(*(line.time for line in curves if line is not None)) or (0.0, 1.0)
    return begin, end if end > begin else begin + 1.0


def _part(curve: Curve, since: float) -> Curve:
    begin = int(np.searchsorted(curve.time, since))
    return Curve(curve.time[begin:], curve.values[begin:])


def motion_error_figure(truth: TruthRecord, estimates: list[EstimateHistory]) -> Figure:
    """Draw a panel for each motion state: estimates minus truth, within bands of two standard deviations."""
    handles = [
        *style.filter_handles((estimate.filter for estimate in estimates), marked=True),
        Patch(color="0.5", alpha=style.BAND_SHADE, linewidth=0, label="±2 standard deviations"),
    ]
    span = value_range(*(estimate.time for estimate in estimates)) or (0.0, 1.0)
    figure, panels = style.new_panels(len(MOTION), 3, 1.7, handles, style.Room(), span)
    for column, (axes, quantity) in enumerate(zip(panels, MOTION, strict=True)):
        _draw_error_panel(axes, quantity, truth.time, truth.motion[:, column], estimates)
    style.name_values(figure, "estimate - truth")
    return figure


def _draw_error_panel(
    axes: Axes, quantity: Quantity, time: Array, true: Array, estimates: list[EstimateHistory]
) -> None:
    scale = scale_of(quantity)
    style.name_panel(axes, f"{symbol_math(quantity.symbol)} ({scale.unit})")
    is_angle = scale.unit == "°"
    sound, others = [], []
    for position, estimate in enumerate(estimates):
        if quantity.symbol not in estimate.state or not estimate.time.size:
            continue
        some = spaced(estimate.time.size, _ERROR_POINTS)
        column, at = estimate.state.index(quantity.symbol), estimate.time[some]
        error = finite(estimate.mean[some, column]) - np.interp(at, time, np.unwrap(true) if is_angle else true)
        error = scale.factor * (wrap(error) if is_angle else error)
        band = 2.0 * scale.factor * finite(estimate.standard_deviation[some, column])
        look = style.FILTER_STYLES[estimate.filter]
        style.draw_band(axes, at, -band, band, look.color, len(estimates))
        axes.plot(at, error, **look.marked_line(position, at.size), zorder=2.0 + 0.1 * position)
        (sound if estimate.completed else others).append((error, band))
    if not sound + others:
        style.show_message(axes, "no estimate")
        return
    height = _height(sound or others)
    axes.set_ylim(-height, height)


def _height(drawn: list[tuple[Array, Array]]) -> float:
    """Return half the height of a panel: all errors, but at most twice the usual error of the second half."""
    usual = 0.0
    for error, band in drawn:
        for values, share in ((band, 50.0), (np.abs(error), _USUAL_PERCENTILE)):
            late = values[values.size // 2 :]
            late = late[np.isfinite(late)]
            usual = max(usual, float(np.percentile(late, share)) if late.size else 0.0)
    _, largest = value_range(*(np.abs(error) for error, _ in drawn)) or (0.0, 0.0)
    return max(1.2 * usual, min(1.1 * largest, _HALF_HEIGHT * usual)) or 1.1 * largest or 1.0
