"""Where the vehicle went: in space, on the map, in depth, and how far the estimated paths are from the true one."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.axes3d import Axes3D
from numpy.typing import NDArray

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Course
from auvid_cli.report.figures.limits import value_range, with_margin
from auvid_cli.report.figures.series import spaced
from auvid_cli.report.figures.style import (
    FILTER_STYLES,
    TRUE_LINE,
    WIDTH,
    legend_above,
    plain_decades,
    say,
    sized_figure,
    tidy,
)
from auvid_cli.report.notation import filter_label
from auvid_cli.report.travelled_paths import travelled, travelled_paths

Array = NDArray[np.float64]

_HEIGHT = 5.8
_POINTS, _POINTS_IN_SPACE = 1000, 500
# From its start a path is drawn, in extents of the first.
_FARTHEST = 2.0
_SHADOW: dict[str, Any] = {"color": "0.75", "linewidth": 0.8}
_ENDS = (("start", "o", "white"), ("end", "s", "0.4"))


class _Track(NamedTuple):
    """A path, m: north, east, down over time, s; and how its line looks."""

    label: str
    time: Array
    position: Array
    line: dict[str, Any]


def path_figure(truth: TruthRecord | None, estimates: list[Course]) -> Figure:
    """Draw the true path, and those that follow from the estimated motion alone, from its start or from zero."""
    tracks = _tracks(truth, estimates)
    figure = sized_figure(WIDTH, _HEIGHT)
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
        say(plan, "no finite position")
        return figure
    profile = figure.add_subplot(grid[1, 1] if has_distance else grid[1:, 1])
    _draw_in_space(views, tracks)
    _draw_plan(plan, tracks)
    _draw_profile(profile, tracks)
    if has_distance:
        _draw_distance(figure.add_subplot(grid[2, 1]), tracks[0], tracks[1:])
    ends = [Line2D([], [], label=label, **_end(marker, face)) for label, marker, face in _ENDS]
    legend_above(figure, [*(Line2D([], [], label=track.label, **track.line) for track in tracks), *ends])
    return figure


def _tracks(truth: TruthRecord | None, estimates: list[Course]) -> list[_Track]:
    tracks: list[_Track] = []
    # Those that ended set the scale where there is no truth.
    for track in travelled_paths(truth, sorted(estimates, key=lambda estimate: not estimate.completed)):
        position = _as_far_as_others(track.position, tracks[0].position) if tracks else track.position
        if track.filter is None:
            tracks.append(_Track("true", track.time, position, TRUE_LINE))
        elif len(position) > 1:
            line = FILTER_STYLES[track.filter].line()
            tracks.append(_Track(filter_label(track.filter), track.time[: len(position)], position, line))
    return tracks


def _as_far_as_others(position: Array, first: Array) -> Array:
    """Cut a path, of a filter that diverged, where it has left the surroundings of the first."""
    room = _FARTHEST * max(float(np.ptp(first, axis=0).max()), 1.0)
    beyond = np.linalg.norm(position - first[0], axis=1) > room
    return position[: int(beyond.argmax())] if beyond.any() else position


def _draw_in_space(axes: Axes3D, tracks: list[_Track]) -> None:
    """Draw the first path and its plan below; others can hardly be told from it here."""
    position = tracks[0].position
    north, east, down = position[spaced(len(position), _POINTS_IN_SPACE)].T
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
    axes.set_zlabel("depth (m)", fontsize=9)
    axes.tick_params(labelsize=8)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(5))
    axes.set_box_aspect((1.0, 1.0, 0.75))
    axes.grid(False)
    words = (
        f"{tracks[0].label}, above its plan; depth not to scale\nestimates: dead reckoning from velocity and attitude"
    )
    axes.text2D(0.03, 0.94, words, transform=axes.transAxes, fontsize=9, color="0.35")


def _draw_plan(axes: Axes, tracks: list[_Track]) -> None:
    for track in _upwards(tracks):
        some = spaced(len(track.position), _POINTS)
        _draw(axes, track.position[some, 1], track.position[some, 0], track)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)", fontsize=9)
    axes.set_ylabel("north (m)", fontsize=9)


def _upwards(tracks: list[_Track]) -> list[_Track]:
    """Return them as they are drawn, wide lines below narrow ones, the true path last."""
    return [*tracks[1:], tracks[0]]


def _draw_profile(axes: Axes, tracks: list[_Track]) -> None:
    for track in _upwards(tracks):
        some = spaced(len(track.position), _POINTS)
        position = track.position[some]
        _draw(axes, travelled(position), position[:, 2], track)
    axes.set_ylim(*_range(tracks[0].position[:, 2])[::-1])
    axes.set_xlabel("distance along the track (m)", fontsize=9)
    axes.set_ylabel("depth (m)", fontsize=9)


def _draw_distance(axes: Axes, true: _Track, others: list[_Track]) -> None:
    """Draw how far dead reckoning is from the true path over time."""
    tidy(axes)
    for position, track in enumerate(others):
        some = spaced(len(track.position), _POINTS)[1:]
        time = track.time[some]
        at = np.stack([np.interp(time, true.time, column) for column in true.position.T], axis=1)
        distance = np.linalg.norm(track.position[some] - at, axis=1)
        axes.plot(time, distance, **track.line, zorder=2.0 + 0.1 * position)
    axes.set_yscale("log")
    plain_decades(axes.yaxis)
    axes.set_xlabel("time (s)", fontsize=9)
    axes.set_ylabel("off by (m)", fontsize=9)


def _draw(axes: Axes, x: Array, y: Array, track: _Track) -> None:
    tidy(axes)
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
