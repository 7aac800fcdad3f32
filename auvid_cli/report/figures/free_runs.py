"""What the identified models, moved by the inputs alone, leave of the measurements."""

from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvid_cli.data.dataset import SensorRecord
from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.report.figures.limits import around, value_range
from auvid_cli.report.figures.style import FILTER_STYLES, Room, filter_handles, name_panel, name_values, new_panels, say
from auvid_cli.report.free_run_residuals import free_run_residual
from auvid_cli.report.notation import symbol_math
from auvid_cli.report.scales import scale_of
from auvid_cli.vehicle.parameters import MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity, state_of

Array = NDArray[np.float64]

# Parts of a run of which the residuals are averaged at most, and samples that each has about, at least.
_MOST_PARTS, _FEWEST = 120, 3
# Of the means of all filters, so many percent set the scale, where noise does not.
_MOST = 95.0
_NOISE = "0.85"


class _Panel(NamedTuple):
    """A component of a sensor."""

    sensor: str
    quantity: Quantity
    time: Array
    values: Array
    noise: float


def free_run_figure(sensors: dict[str, SensorRecord], runs: dict[str, FreeRun]) -> Figure:
    """Draw a panel for each motion state that is measured, and the depth: means of what free runs leave of it.

    Parameters
    ----------
    sensors : dict of SensorRecord
    runs : dict of FreeRun
        By filter.
    """
    handles: list[Artist] = [*filter_handles(runs, marked=True)]
    wanted = _panels(sensors)
    begin, end = value_range(*(panel.time for panel in wanted)) or (0.0, 1.0)
    handles.append(Patch(color=_NOISE, linewidth=0, label="±2 standard deviations of the means, of noise alone"))
    figure, panels = new_panels(len(wanted), 3, 1.7, handles, Room(), (begin, end))
    for axes, panel in zip(panels, wanted, strict=True):
        _draw_panel(axes, panel, runs, (begin, max(end, begin + 1e-3)))
    name_values(figure, "means of measured - free run")
    return figure


def _panels(sensors: dict[str, SensorRecord]) -> list[_Panel]:
    """Return what is measured of the motion, in its order."""
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
    name_panel(axes, f"{symbol_math(panel.quantity.symbol)}, {panel.sensor} ({scale.unit})")
    parts = int(np.clip(panel.time.size // _FEWEST, 1, _MOST_PARTS))
    edges = np.linspace(*span, parts + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    place = np.clip(np.searchsorted(edges, panel.time, side="right") - 1, 0, parts - 1)
    count = np.bincount(place, minlength=parts).astype(np.float64)
    count[count == 0.0] = np.nan
    noise = 2.0 * scale.factor * panel.noise / np.sqrt(count)
    axes.fill_between(middle, -noise, noise, color=_NOISE, linewidth=0, zorder=1.0)
    means = []
    for position, (name, run) in enumerate(runs.items()):
        left = free_run_residual(panel.quantity, panel.time, panel.values, run)
        if left is None:
            continue
        mean = scale.factor * np.bincount(place, left, parts) / count
        means.append(mean)
        axes.plot(middle, mean, **FILTER_STYLES[name].marked_line(position, parts), zorder=2.0 + 0.1 * position)
    if value_range(*means) is None:
        say(axes, "no free run")
        return
    axes.set_ylim(*_limits(noise, means, scale.factor * float(np.ptp(panel.values))))


def _limits(noise: Array, means: list[Array], height: float) -> tuple[float, float]:
    """Leave room for the noise, and for most of what the best model leaves, up to the height of what was measured."""
    sizes = [np.percentile(np.abs(mean[np.isfinite(mean)]), _MOST) for mean in means if np.isfinite(mean).any()]
    largest = max(float(np.nanmax(noise)), min(1.3 * float(min(sizes)), height))
    every = value_range(*means)
    return around((-largest, largest), every)
