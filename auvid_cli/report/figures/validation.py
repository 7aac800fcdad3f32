"""Figures of innovations, of free runs and of predictions over horizons."""

from collections.abc import Sequence
from math import ceil
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvid_cli.arrays import Array
from auvid_cli.data.dataset import SensorRecord
from auvid_cli.data.innovations import Innovations
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.report.figures import style
from auvid_cli.report.plot_data import (
    HorizonPlot,
    around,
    component_innovations,
    free_run_residual,
    horizon_plots,
    scale_of,
    value_range,
)
from auvid_cli.report.table import filter_label, symbol_math
from auvid_cli.validation.results import Prediction
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity, state_of

_HALF_HEIGHT = 4.0  # half height of a strip, standard deviations; innovations beyond are counted
_BINS = 32
_SAMPLES_PER_BIN = 40  # samples in a bin of time
_MAX_BINS = 120
# Height of a strip, inches.
_STRIP = 0.62
_BOUND = {"color": "#D55E00", "linewidth": 1.1, "linestyle": (0, (5, 2))}
_DARKEST = "0.15"
_MAX_PARTS = 120  # parts of a run whose residuals are averaged
_MIN_SAMPLES = 3  # samples in a part
# Percentile of the residuals that sets the scale if noise does not.
_SCALE_PERCENTILE = 95.0
_FREE_RUN_NOISE = "0.85"
_COLUMNS = 3
# Errors that set the limits, and the margin as a factor.
_SCALING = ("rmse", "noise", "expected_rmse", "constant_velocity_rmse")
_MARGIN = 1.4
# Share of the height, in decades, that is free for words.
_ROOM_FOR_WORDS = 0.15
_EXPECTED = "0.85"
_HORIZON_NOISE = {"color": "0.35", "linewidth": 0.9, "linestyle": (0, (1, 2))}
# Colours as on the page, see page.css.
_OTHERS = {
    "constant_velocity_rmse": ("unchanged", {"color": "#E69F00", "linestyle": (0, (5, 2)), "marker": "v"}),
    "prior_rmse": ("prior", {"color": "#7A3E9D", "linestyle": (0, (5, 1.5, 1, 1.5)), "marker": "^"}),
    "vehicle_file_rmse": ("vehicle file", {"color": "#8C5A2B", "linestyle": (0, (9, 2)), "marker": "D"}),
}


class _Strip(NamedTuple):
    """A component of a sensor, and the ordinate of the middle of its strip."""

    sensor: str
    component: int
    middle: float


def innovation_figure(innovations: dict[str, dict[str, Innovations]]) -> Figure:
    """Draw a panel for each filter, and in it a strip for each component of each sensor.

    A strip is a histogram of normalised innovations over time; darker means more of them.

    Parameters
    ----------
    innovations : dict
        By filter, then by sensor.
    """
    sensors = dict.fromkeys(sensor for of_filter in innovations.values() for sensor in of_filter)
    components = [(sensor, component) for sensor in sensors for component in range(len(SENSORS[sensor]))]
    strips = [_Strip(*row, -2.0 * _HALF_HEIGHT * place) for place, row in enumerate(components)]
    handles = [
        Patch(color=_DARKEST, label="measured - predicted, over its standard deviation (darker: more often)"),
        Line2D(
            [],
            [],
            label="±2 standard deviations; number: share within (95 % is right)",
            **_BOUND,
        ),
    ]
    room = style.Room(left=1.6, across=0.12)
    span = value_range(*(of.time for of_filter in innovations.values() for of in of_filter.values())) or (0.0, 1.0)
    figure, panels = style.new_panels(
        len(innovations), len(innovations), _STRIP * len(strips), handles, room, span, with_heads=True
    )
    for place, (axes, (name, of_filter)) in enumerate(zip(panels, innovations.items(), strict=True)):
        style.head(axes, filter_label(name))
        axes.grid(visible=False)
        for strip in strips:
            _draw_strip(axes, of_filter.get(strip.sensor), strip)
        middles = np.array([strip.middle for strip in strips])
        axes.hlines([*(middles - 2.0), *(middles + 2.0)], *axes.get_xlim(), **_BOUND, zorder=3.0)
        axes.hlines(middles - _HALF_HEIGHT, *axes.get_xlim(), color="0.5", linewidth=0.6)
        axes.set_ylim(middles[-1] - _HALF_HEIGHT, _HALF_HEIGHT)
        axes.set_yticks(middles, [_name(strip, innovations) for strip in strips] if place == 0 else [])
        axes.tick_params(axis="y", left=False)
    return figure


def _name(strip: _Strip, innovations: dict[str, dict[str, Innovations]]) -> str:
    """Return the name of a component with its median standard deviation in the first filter that has one."""
    quantity = SENSORS[strip.sensor][strip.component]
    scale = scale_of(quantity)
    name = f"{symbol_math(quantity.symbol)}, {strip.sensor}"
    for of_filter in innovations.values():
        if strip.sensor in of_filter:
            variance = of_filter[strip.sensor].variance[:, strip.component]
            known = variance[np.isfinite(variance)]
            if known.size:
                return f"{name}\nsd {scale.factor * float(np.sqrt(np.median(known))):.2g} {scale.unit}"
    return name


def _draw_strip(axes: Axes, innovations: Innovations | None, strip: _Strip) -> None:
    words = "not used"
    if innovations is not None:
        component = component_innovations(innovations, strip.component)
        words = "no finite innovations"
        if component.time.size:
            words = f"{component.percent_within:.1f} % within"
            _draw_histogram(axes, component.time, component.normalised, strip.middle)
            if beyond := int((np.abs(component.normalised) > _HALF_HEIGHT).sum()):
                words += f", {beyond} beyond 4 sd"
    # Above the upper bound.
    place = axes.get_xlim()[1], strip.middle + _HALF_HEIGHT
    axes.annotate(words, place, (-2.0, -2.0), textcoords="offset points", ha="right", va="top", fontsize=7.5)


def _draw_histogram(axes: Axes, time: Array, normalised: Array, middle: float) -> None:
    bins = int(np.clip(time.size // _SAMPLES_PER_BIN, 4, _MAX_BINS))
    span = float(time[0]), max(float(time[-1]), float(time[0]) + 1e-3)
    number, *_ = np.histogram2d(time, normalised, bins=(bins, _BINS), range=(span, (-_HALF_HEIGHT, _HALF_HEIGHT)))
    image = AxesImage(
        axes,
        cmap="Greys",
        # Keeps an image with few samples from being only black and white.
        norm=Normalize(0.0, 1.15 * max(float(number.max()), 2.0)),
        extent=(*span, middle - _HALF_HEIGHT, middle + _HALF_HEIGHT),
        origin="lower",
        interpolation="nearest",
    )
    image.set_data(number.T)
    axes.add_image(image)


class _Panel(NamedTuple):
    """A component of a sensor."""

    sensor: str
    quantity: Quantity
    time: Array
    values: Array
    noise: float


def free_run_figure(sensors: dict[str, SensorRecord], runs: dict[str, FreeRun]) -> Figure:
    """Draw a panel for the depth and each measured motion state: means of measurements minus free runs.

    Parameters
    ----------
    runs : dict of FreeRun
        By filter.
    """
    handles: list[Artist] = [*style.filter_handles(runs, marked=True)]
    wanted = _panels(sensors)
    begin, end = value_range(*(panel.time for panel in wanted)) or (0.0, 1.0)
    handles.append(Patch(color=_FREE_RUN_NOISE, linewidth=0, label="expected from sensor noise alone (95 %)"))
    figure, panels = style.new_panels(len(wanted), 3, 1.7, handles, style.Room(), (begin, end))
    for axes, panel in zip(panels, wanted, strict=True):
        _draw_panel(axes, panel, runs, (begin, max(end, begin + 1e-3)))
    style.name_values(figure, "measured - free run, mean of each of at most 120 parts of the run")
    return figure


def _panels(sensors: dict[str, SensorRecord]) -> list[_Panel]:
    """Return the measured motion states in their order."""
    found = []
    for name, record in sensors.items():
        for column, quantity in enumerate(SENSORS[name]):
            known = np.isfinite(record.values[:, column])
            if state_of(quantity) in MOTION_AND_DEPTH_SYMBOLS and known.any():
                values, noise = record.values[known, column], float(record.standard_deviation[column])
                found.append(_Panel(name, quantity, record.time[known], values, noise))
    return sorted(found, key=lambda panel: MOTION_AND_DEPTH_SYMBOLS.index(state_of(panel.quantity)))


def _draw_panel(axes: Axes, panel: _Panel, runs: dict[str, FreeRun], span: tuple[float, float]) -> None:
    scale = scale_of(panel.quantity)
    style.name_panel(axes, f"{symbol_math(panel.quantity.symbol)}, {panel.sensor} ({scale.unit})")
    parts = int(np.clip(panel.time.size // _MIN_SAMPLES, 1, _MAX_PARTS))
    edges = np.linspace(*span, parts + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    place = np.clip(np.searchsorted(edges, panel.time, side="right") - 1, 0, parts - 1)
    count = np.bincount(place, minlength=parts).astype(np.float64)
    count[count == 0.0] = np.nan
    noise = 2.0 * scale.factor * panel.noise / np.sqrt(count)
    axes.fill_between(middle, -noise, noise, color=_FREE_RUN_NOISE, linewidth=0, zorder=1.0)
    means = []
    for position, (name, run) in enumerate(runs.items()):
        residual = free_run_residual(panel.quantity, panel.time, panel.values, run)
        if residual is None:
            continue
        mean = scale.factor * np.bincount(place, residual, parts) / count
        means.append(mean)
        axes.plot(middle, mean, **style.FILTER_STYLES[name].marked_line(position, parts), zorder=2.0 + 0.1 * position)
    if value_range(*means) is None:
        style.show_message(axes, "no free run")
        return
    axes.set_ylim(*_free_run_limits(noise, means, scale.factor * float(np.ptp(panel.values))))


def _free_run_limits(noise: Array, means: list[Array], height: float) -> tuple[float, float]:
    """Return limits that contain the noise and most residuals of the best model, at most the measured range."""
    sizes = [
        np.percentile(np.abs(mean[np.isfinite(mean)]), _SCALE_PERCENTILE) for mean in means if np.isfinite(mean).any()
    ]
    largest = max(float(np.nanmax(noise)), min(1.3 * float(min(sizes)), height))
    every = value_range(*means)
    return around((-largest, largest), every)


def horizon_figure(filter_name: str, predictions: Sequence[Prediction]) -> Figure:
    """Draw a panel for each motion state, and the depth if there is any: RMSE over the horizon, both logarithmic.

    Errors of the prior may be larger by orders of magnitude and do not set the limits.

    Parameters
    ----------
    predictions : sequence of Prediction
        Only those ahead are drawn.
    """
    plots = horizon_plots(predictions)
    rows_of_panels = ceil(len(plots) / _COLUMNS)
    figure = style.new_figure(11.0, 2.4 * rows_of_panels + 0.4)
    panels = figure.subplots(rows_of_panels, _COLUMNS, sharex=True)
    for axes in panels.flat[len(plots) :]:
        axes.remove()
    for axes, plot in zip(panels.flat, plots, strict=False):
        axes.set_ylabel(f"RMSE of {symbol_math(plot.quantity.symbol)} ({plot.scale.unit})", fontsize=9)
        style.head(axes, "")
        if plot.horizons.size:
            _draw_errors(axes, filter_name, plot)
        else:
            style.show_message(axes, "no measurements ahead")
    for axes in panels.flat[len(plots) - _COLUMNS : len(plots)]:
        axes.set_xlabel("horizon (s)", fontsize=9)
        axes.tick_params(labelbottom=True)
    style.legend_above(figure, _handles(filter_name, predictions))
    return figure


def _draw_errors(axes: Axes, filter_name: str, plot: HorizonPlot) -> None:
    horizons, errors = plot.horizons, plot.errors
    for position, (field, (_, line)) in enumerate(_OTHERS.items()):
        axes.plot(horizons, errors[field], linewidth=1.2, markersize=4.0, zorder=2.0 + 0.1 * position, **line)
    look = style.FILTER_STYLES[filter_name]
    axes.plot(horizons, errors["rmse"], **look.line() | {"linestyle": "-"}, **look.mark(), zorder=3.0)
    axes.plot(horizons, errors["noise"], **_HORIZON_NOISE)
    axes.set_yscale("log")
    axes.set_xscale("log")
    drawn = np.concatenate([errors[field] for field in _SCALING])
    drawn = drawn[np.isfinite(drawn) & (drawn > 0.0)]
    low, high = (drawn.min() / _MARGIN, drawn.max() * _MARGIN) if drawn.size else (0.1, 1.0)
    floor = np.full(horizons.size, low)
    axes.fill_between(horizons, floor, errors["expected_rmse"], color=_EXPECTED, linewidth=0.0, zorder=1.0)
    prior = errors["prior_rmse"][~np.isnan(errors["prior_rmse"])]
    if prior.size and prior.min() > high:
        # Above all lines.
        high *= (high / low) ** _ROOM_FOR_WORDS
        style.name_panel(axes, "prior: above the axis")
    axes.set_ylim(low, high)
    axes.set_xticks(horizons, [f"{horizon:g}" for horizon in horizons])
    style.plain_decades(axes.yaxis)
    axes.minorticks_off()
    style.plain_frame(axes)


def _handles(filter_name: str, predictions: Sequence[Prediction]) -> list[Artist]:
    """Return the legend entries of the lines that exist."""
    look = style.FILTER_STYLES[filter_name]
    handles: list[Artist] = [
        Line2D([], [], label=filter_label(filter_name), **look.line() | {"linestyle": "-"}, **look.mark())
    ]
    for field, (label, line) in _OTHERS.items():
        if any(getattr(row, field) is not None for row in predictions):
            handles.append(Line2D([], [], label=label, linewidth=1.2, markersize=4.0, **line))
    handles.append(Line2D([], [], label="noise of the sensor", **_HORIZON_NOISE))
    handles.append(Patch(color=_EXPECTED, label="explained by the stated uncertainty"))
    return handles
