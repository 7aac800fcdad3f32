"""What was measured against what the identified model predicts from the inputs alone."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.report.figures.limits import around, value_range
from auvid_cli.report.figures.series import finite, thin, unwrapped
from auvid_cli.report.figures.style import (
    FILTER_STYLES,
    MEASURED,
    filter_handles,
    head,
    legend_above,
    new_figure,
    say,
    tidy,
)
from auvid_cli.report.notation import symbol_math
from auvid_cli.report.scales import scale_of
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity

Array = NDArray[np.float64]

# s, of the end of the run that is drawn once more, larger.
_ZOOM = 30.0
_POINTS = 1200


class Curve(NamedTuple):
    """A drawable signal over time, s, in the unit of `scale_of`."""

    time: Array
    values: Array


def motion_figure(quantities: Sequence[Quantity], sensors: dict[str, SensorRecord], runs: dict[str, FreeRun]) -> Figure:
    """Draw a row for each motion state, or the depth: the whole run, and its end beside it.

    Parameters
    ----------
    quantities : sequence of Quantity
        Motion states, and the depth if the runs have it.
    sensors : dict of SensorRecord
    runs : dict of FreeRun
        By filter.
    """
    figure = new_figure(11.0, 1.75 * len(quantities) + 0.8)
    panels = figure.subplots(len(quantities), 2, sharex="col", squeeze=False, width_ratios=[2.2, 1.0])
    signals = [(_measured(q, sensors), _predicted(q, runs)) for q in quantities]
    begin, end = _span([series for measured, predicted in signals for series in [measured, *predicted.values()]])
    zoom = end - min(_ZOOM, 0.5 * (end - begin))
    for (whole, part), quantity, (measured, predicted) in zip(panels, quantities, signals, strict=True):
        whole.set_ylabel(f"{symbol_math(quantity.symbol)} ({scale_of(quantity).unit})", fontsize=9)
        _draw_panel(whole, measured, predicted, (begin, end), 0.4)
        _draw_panel(part, measured, predicted, (zoom, end), 1.0)
        if measured is None:
            whole.text(0.01, 0.97, "not measured", transform=whole.transAxes, va="top", fontsize=8, color="0.35")
    head(panels[0, 0], "whole run")
    head(panels[0, 1], f"last {end - zoom:.3g} s")
    for axes in panels[-1]:
        axes.set_xlabel("time (s)", fontsize=9)
    predictions = filter_handles(runs)
    for handle in predictions:
        handle.set_label(f"{handle.get_label()}, free run")
    legend_above(figure, [Line2D([], [], label="measured", **MEASURED), *predictions])
    return figure


def _draw_panel(
    axes: Axes, measured: Curve | None, predicted: dict[str, Curve], span: tuple[float, float], width: float
) -> None:
    """Draw a span of time, s, with lines of `width` times their usual width."""
    tidy(axes)
    every, sound = [], []
    for position, (name, series) in enumerate(predicted.items()):
        time, values = _part(series, span[0])
        every.append(values)
        if np.isfinite(values).all():
            sound.append(values)
        line = _narrowed(FILTER_STYLES[name].line(), width)
        axes.plot(*thin(time, values, _POINTS), **line, zorder=2.0 + 0.1 * position)
    # What was measured sets the scale, or else the runs that did not blow up.
    reference = value_range(*sound)
    if measured is not None:
        time, values = _part(measured, span[0])
        known = np.isfinite(values)
        axes.plot(*thin(time[known], values[known], _POINTS), **_narrowed(MEASURED, width), zorder=1.9)
        reference = value_range(values) or reference
    others = value_range(*every)
    if reference is None and others is None:
        say(axes, "nothing finite to draw")
    axes.set_ylim(*around(reference, others))
    axes.set_xlim(*span)


def _narrowed(line: dict[str, Any], width: float) -> dict[str, Any]:
    return line | {"linewidth": width * line["linewidth"]}


def _measured(quantity: Quantity, sensors: dict[str, SensorRecord]) -> Curve | None:
    for name, record in sensors.items():
        symbols = [component.symbol for component in SENSORS[name]]
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


def _span(series: list[Curve | None]) -> tuple[float, float]:
    """Return begin and end of all time, s."""
    begin, end = value_range(*(line.time for line in series if line is not None)) or (0.0, 1.0)
    return begin, end if end > begin else begin + 1.0


def _part(series: Curve, since: float) -> Curve:
    begin = int(np.searchsorted(series.time, since))
    return Curve(series.time[begin:], series.values[begin:])
