"""Where the vehicle went: in space, on the map, and in depth."""

from typing import Any

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
from auvid_cli.report.figures.style import legend_above, new_figure, say, tidy
from auvid_cli.report.notation import filter_label
from auvid_cli.vehicle.dead_reckoning import dead_reckoned
from auvid_cli.vehicle.parameters import N_MOTION

Array = NDArray[np.float64]

_PATH: dict[str, Any] = {"color": "#0072B2", "linewidth": 1.4}
_SHADOW: dict[str, Any] = {"color": "#56B4E9", "linewidth": 0.8, "alpha": 0.8}
_ENDS = (("start", "o", "white"), ("end", "s", "#0072B2"))


def path_figure(truth: TruthRecord | None, estimates: list[Course]) -> Figure:
    """Draw the true path or, without truth, the dead reckoning of the first estimate."""
    label, position = _path(truth, estimates)
    figure = new_figure(11.0, 5.6)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.25, 1.0], height_ratios=[1.6, 1.0])
    views = figure.add_subplot(grid[:, 0], projection="3d")
    plan, profile = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    assert isinstance(views, Axes3D)
    if not position.size:
        say(plan, "no finite position")
        return figure
    north, east, down = position[spaced(len(position), 2000)].T
    _draw_in_space(views, north, east, down)
    _draw_plan(plan, north, east)
    _draw_profile(profile, north, east, down)
    line, *ends = plan.lines
    line.set_label(label)
    legend_above(figure, [line, Line2D([], [], label="its projections", **_SHADOW), *ends])
    return figure


def _path(truth: TruthRecord | None, estimates: list[Course]) -> tuple[str, Array]:
    if truth is not None:
        finite = np.isfinite(truth.position).all(axis=1)
        return "true path", truth.position[finite]
    first = estimates[0]
    position = dead_reckoned(first.time, first.mean[:, -N_MOTION:])
    return f"dead reckoning of {filter_label(first.filter)}'s estimate, from its start", position


def _draw_in_space(axes: Axes3D, north: Array, east: Array, down: Array) -> None:
    # East, north and up, in this order, make a right-handed view with depth growing downwards.
    wide = _square(east, north)
    depth = _range(down)
    axes.plot(east, north, np.full(down.size, depth[1]), **_SHADOW)
    axes.plot(np.full(east.size, wide[0][0]), north, down, **_SHADOW)
    axes.plot(east, np.full(north.size, wide[1][1]), down, **_SHADOW)
    axes.plot(east, north, down, **_PATH)
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
    axes.text2D(0.0, 0.0, "depth not to scale", transform=axes.transAxes, fontsize=9, color="0.35")


def _draw_plan(axes: Axes, north: Array, east: Array) -> None:
    _draw(axes, east, north)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east (m)", fontsize=9)
    axes.set_ylabel("north (m)", fontsize=9)


def _draw_profile(axes: Axes, north: Array, east: Array, down: Array) -> None:
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(north), np.diff(east)))])
    _draw(axes, travelled, down)
    axes.set_ylim(*_range(down)[::-1])
    axes.set_xlabel("distance along the track (m)", fontsize=9)
    axes.set_ylabel("depth (m)", fontsize=9)


def _draw(axes: Axes, x: Array, y: Array) -> None:
    axes.plot(x, y, **_PATH)
    for (label, marker, face), at in zip(_ENDS, (0, -1), strict=True):
        axes.plot(x[[at]], y[[at]], label=label, **_end(marker, face))
    tidy(axes)


def _end(marker: str, face: str) -> dict[str, Any]:
    return {"marker": marker, "markerfacecolor": face, "markeredgecolor": "black", "linestyle": "", "markersize": 6}


def _range(values: Array) -> tuple[float, float]:
    return with_margin(*(value_range(values) or (0.0, 0.0)))


def _square(east: Array, north: Array) -> list[tuple[float, float]]:
    """Return limits of equal length around both."""
    ranges = [_range(east), _range(north)]
    half = max(high - low for low, high in ranges) / 2.0
    return [((low + high) / 2.0 - half, (low + high) / 2.0 + half) for low, high in ranges]
