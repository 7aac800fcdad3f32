"""How errors of predictions grow with the horizon, and how much of that was to be expected."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvid_cli.report.figures.style import FILTER_STYLES, head, legend_above, name_panel, new_figure, plain_decades, say
from auvid_cli.report.notation import filter_label, symbol_math
from auvid_cli.report.scales import scale_of
from auvid_cli.validation.results import AHEAD, Prediction
from auvid_cli.vehicle.parameters import DEPTH, MOTION, MOTION_AND_DEPTH

_COLUMNS = 3
# What sets the scale, beyond which there is this factor of room.
_SCALING = ("rmse", "noise", "expected_rmse", "constant_velocity_rmse")
_MARGIN = 1.4
# Of the height of a panel, in decades.
_ROOM_FOR_WORDS = 0.15
_EXPECTED = "0.85"
_NOISE = {"color": "0.35", "linewidth": 0.9, "linestyle": (0, (1, 2))}
# Okabe and Ito's, not those of a filter.
_OTHERS = {
    "constant_velocity_rmse": ("unchanged", {"color": "#E69F00", "linestyle": (0, (5, 2)), "marker": "v"}),
    "prior_rmse": ("prior", {"color": "#0072B2", "linestyle": (0, (5, 1.5, 1, 1.5)), "marker": "^"}),
    "vehicle_file_rmse": ("vehicle file", {"color": "black", "linestyle": (0, (9, 2)), "marker": "D"}),
}


def horizon_figure(filter_name: str, predictions: Sequence[Prediction]) -> Figure:
    """Draw a panel for each motion state, and the depth if there is any: RMSE over the horizon, both logarithmic.

    What the prior predicts may be worse by orders of magnitude, and does not set the axes.

    Parameters
    ----------
    filter_name : str
    predictions : sequence of Prediction
        Those ahead are drawn.
    """
    has_depth = any(row.signal == DEPTH.symbol for row in predictions)
    quantities = MOTION_AND_DEPTH if has_depth else MOTION
    rows_of_panels = ceil(len(quantities) / _COLUMNS)
    figure = new_figure(11.0, 2.4 * rows_of_panels + 0.4)
    panels = figure.subplots(rows_of_panels, _COLUMNS, sharex=True)
    for axes in panels.flat[len(quantities) :]:
        axes.remove()
    for axes, quantity in zip(panels.flat, quantities, strict=False):
        rows = [row for row in predictions if row.kind == AHEAD and row.signal == quantity.symbol]
        scale = scale_of(quantity)
        axes.set_ylabel(f"RMSE of {symbol_math(quantity.symbol)} ({scale.unit})", fontsize=9)
        head(axes, "")
        if rows:
            _draw(axes, filter_name, rows, scale.factor)
        else:
            say(axes, "no measurements ahead")
    for axes in panels.flat[len(quantities) - _COLUMNS : len(quantities)]:
        axes.set_xlabel("horizon (s)", fontsize=9)
        axes.tick_params(labelbottom=True)
    legend_above(figure, _handles(filter_name, predictions))
    return figure


def _draw(axes: Axes, filter_name: str, rows: Sequence[Prediction], scale: float) -> None:
    """Draw the lines of one signal; values times `scale`."""
    horizons = [row.horizon_s for row in rows]

    def values(field: str) -> list[float]:
        return [np.nan if getattr(row, field) is None else scale * getattr(row, field) for row in rows]

    for position, (field, (_, style)) in enumerate(_OTHERS.items()):
        axes.plot(horizons, values(field), linewidth=1.2, markersize=4.0, zorder=2.0 + 0.1 * position, **style)
    style = FILTER_STYLES[filter_name]
    axes.plot(horizons, values("rmse"), **style.line() | {"linestyle": "-"}, **style.mark(), zorder=3.0)
    axes.plot(horizons, values("noise"), **_NOISE)
    axes.set_yscale("log")
    axes.set_xscale("log")
    expected, (low, high) = values("expected_rmse"), _limits([values(field) for field in _SCALING])
    axes.fill_between(horizons, np.full(len(rows), low), expected, color=_EXPECTED, linewidth=0.0, zorder=1.0)
    prior = [value for value in values("prior_rmse") if not np.isnan(value)]
    if prior and min(prior) > high:
        # Above all lines.
        high *= (high / low) ** _ROOM_FOR_WORDS
        name_panel(axes, "prior: above the axis")
    axes.set_ylim(low, high)
    axes.set_xticks(horizons, [f"{horizon:g}" for horizon in horizons])
    plain_decades(axes.yaxis)
    axes.minorticks_off()
    axes.grid(color="0.9", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)


def _limits(series: Sequence[list[float]]) -> tuple[float, float]:
    """Return limits of a logarithmic axis around all that is positive."""
    drawn = np.array([value for values in series for value in values if np.isfinite(value) and value > 0.0])
    return (drawn.min() / _MARGIN, drawn.max() * _MARGIN) if drawn.size else (0.1, 1.0)


def _handles(filter_name: str, predictions: Sequence[Prediction]) -> list[Artist]:
    """Return the entries of the legend, of what is there."""
    style = FILTER_STYLES[filter_name]
    handles: list[Artist] = [
        Line2D([], [], label=filter_label(filter_name), **style.line() | {"linestyle": "-"}, **style.mark())
    ]
    for field, (label, line) in _OTHERS.items():
        if any(getattr(row, field) is not None for row in predictions):
            handles.append(Line2D([], [], label=label, linewidth=1.2, markersize=4.0, **line))
    handles.append(Line2D([], [], label="noise of the sensor", **_NOISE))
    handles.append(Patch(color=_EXPECTED, label="explained by the stated uncertainty"))
    return handles
