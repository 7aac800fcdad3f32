"""How far the estimated motion is from the true one, beside how far it says it may be."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvid_cli.angles import wrap
from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Course
from auvid_cli.report.figures.limits import value_range
from auvid_cli.report.figures.series import finite, spaced
from auvid_cli.report.figures.style import (
    BAND_SHADE,
    FILTER_STYLES,
    Room,
    draw_band,
    filter_handles,
    name_panel,
    name_values,
    new_panels,
    say,
)
from auvid_cli.report.notation import symbol_math
from auvid_cli.report.scales import scale_of
from auvid_cli.vehicle.parameters import MOTION, Quantity

Array = NDArray[np.float64]

_POINTS = 250
# Half the height of a panel in usual bands, or in usual errors: those that so many percent do not reach.
_HIGHEST, _MOST = 2.0, 90.0


def motion_error_figure(truth: TruthRecord, estimates: list[Course]) -> Figure:
    """Draw a panel for each motion state: estimates minus truth, within bands of two standard deviations."""
    handles = [
        *filter_handles((estimate.filter for estimate in estimates), marked=True),
        Patch(color="0.5", alpha=BAND_SHADE, linewidth=0, label="±2 standard deviations"),
    ]
    span = value_range(*(estimate.time for estimate in estimates)) or (0.0, 1.0)
    figure, panels = new_panels(len(MOTION), 3, 1.7, handles, Room(), span)
    for column, (axes, quantity) in enumerate(zip(panels, MOTION, strict=True)):
        _draw_panel(axes, quantity, truth.time, truth.motion[:, column], estimates)
    name_values(figure, "estimate - truth")
    return figure


def _draw_panel(axes: Axes, quantity: Quantity, time: Array, true: Array, estimates: list[Course]) -> None:
    scale = scale_of(quantity)
    name_panel(axes, f"{symbol_math(quantity.symbol)} ({scale.unit})")
    is_angle = scale.unit == "°"
    sound, others = [], []
    for position, estimate in enumerate(estimates):
        if quantity.symbol not in estimate.state or not estimate.time.size:
            continue
        some = spaced(estimate.time.size, _POINTS)
        column, at = estimate.state.index(quantity.symbol), estimate.time[some]
        error = finite(estimate.mean[some, column]) - np.interp(at, time, np.unwrap(true) if is_angle else true)
        error = scale.factor * (wrap(error) if is_angle else error)
        band = 2.0 * scale.factor * finite(estimate.standard_deviation[some, column])
        style = FILTER_STYLES[estimate.filter]
        draw_band(axes, at, -band, band, style.color, len(estimates))
        axes.plot(at, error, **style.marked_line(position, at.size), zorder=2.0 + 0.1 * position)
        (sound if estimate.completed else others).append((error, band))
    if not sound + others:
        say(axes, "no estimate")
        return
    height = _height(sound or others)
    axes.set_ylim(-height, height)


def _height(drawn: list[tuple[Array, Array]]) -> float:
    """Return half the height of a panel: all errors, but no more than a few times what is usual later on."""
    usual = 0.0
    for error, band in drawn:
        for values, share in ((band, 50.0), (np.abs(error), _MOST)):
            late = values[values.size // 2 :]
            late = late[np.isfinite(late)]
            usual = max(usual, float(np.percentile(late, share)) if late.size else 0.0)
    _, largest = value_range(*(np.abs(error) for error, _ in drawn)) or (0.0, 0.0)
    return max(1.2 * usual, min(1.1 * largest, _HIGHEST * usual)) or 1.1 * largest or 1.0
