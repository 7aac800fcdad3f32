"""Inputs, sensors, and what the model left to itself makes of them, over the same time."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.evaluation.predicted_motion import FreeRun
from auvid_cli.report.free_run_residuals import free_run_residual
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.envelope import envelope
from auvid_cli.report.page.parts import Part, Plot, PlotLine, Plots, Words
from auvid_cli.report.scales import scale_of
from auvid_cli.report.sentence import sentence
from auvid_cli.vehicle.parameters import SENSORS, Quantity

Array = NDArray[np.float64]

# Parts of a run of which the extremes are drawn; and about as many samples as a free run keeps, so many residuals.
_SPANS, _MOST_RESIDUALS = 700, 100_000
HOW_TO_LOOK = (
    "Drag over any of these to look closer at all of them; double-click, or press 0, for the whole run. Of long series "
    "the least and the greatest value of each of many short spans are drawn."
)


def course_parts(dataset: Dataset, runs: Mapping[str, FreeRun]) -> list[Part]:
    """Return plots that are zoomed together: inputs, then what each sensor read, and what free runs leave of that."""
    plots = [*input_plots(dataset.inputs), *sensor_plots(dataset.sensors, runs)]
    residuals = "Residuals are measurements minus the free run: the final model, moved by the inputs alone."
    return [Words([f"{HOW_TO_LOOK} {residuals}"]), Plots(plots, linked="time", wide=True)]


def input_plots(inputs: InputRecord) -> list[Plot]:
    """Plot each input."""
    plots = []
    for column, quantity in enumerate(inputs.quantities):
        scale = scale_of(quantity)
        time, values = envelope(inputs.time, inputs.values[:, [column]] * scale.factor, _SPANS)
        says = sentence(f"{quantity.meaning}, {_range(values, scale.unit)}")
        line = PlotLine(quantity.symbol, "input", time, values[:, 0], "steps")
        plots.append(Plot(f"input: {quantity.symbol.replace('_', ' ')}", says, scale.unit, [line]))
    return plots


def sensor_plots(
    sensors: Mapping[str, SensorRecord],
    runs: Mapping[str, FreeRun],
    marks: Mapping[str, list[tuple[float, float]]] | None = None,
) -> list[Plot]:
    """Plot what each component of each sensor read, shaded at its marks, and its residuals."""
    plots = []
    for name, record in sensors.items():
        for column, quantity in enumerate(SENSORS[name]):
            if not np.isfinite(record.values[:, column]).any():
                continue
            scale = scale_of(quantity)
            time, values = envelope(record.time, record.values[:, [column]] * scale.factor, _SPANS)
            says = sentence(f"{quantity.meaning} by {name}, {_range(values, scale.unit)}")
            line = PlotLine("measured", "measured", time, values[:, 0])
            shaded = () if marks is None else marks.get(name, ())
            plots.append(Plot(f"{name}: {quantity.symbol}", says, scale.unit, [line], marks=shaded))
            plots += _residual(name, quantity, record.time, record.values[:, column], runs)
    return plots


def _residual(sensor: str, quantity: Quantity, time: Array, measured: Array, runs: Mapping[str, FreeRun]) -> list[Plot]:
    """Plot measurements minus free runs, of motion states."""
    scale = scale_of(quantity)
    known = np.isfinite(measured)
    time, measured = time[known], measured[known]
    some = slice(None, None, 1 + time.size // _MOST_RESIDUALS)
    time, measured = time[some], measured[some]
    lines, words = [], []
    # Of a model that blew up no more is shown than of what was measured; the rest would hide the others.
    height = scale.factor * float(np.ptp(measured))
    beyond = False
    for name, run in runs.items():
        left = free_run_residual(quantity, time, measured, run)
        if left is None:
            continue
        left *= scale.factor
        finite = left[np.isfinite(left)]
        if finite.size:
            at, drawn = envelope(time, left[:, None], _SPANS)
            beyond |= height > 0.0 and bool((np.abs(finite) > height).any())
            lines.append(PlotLine(filter_label(name), name, at, drawn[:, 0]))
            words.append(f"{filter_label(name)} {_root_mean_square(finite):.3g} {scale.unit}")
    if not lines:
        return []
    says = f"Measured minus free run; root mean square {', '.join(words)}."
    if beyond:
        says += " Not all of it is within the axis."
    limits = (-height, height) if height > 0.0 else None
    return [Plot(f"{sensor}: {quantity.symbol}, residual", says, scale.unit, lines, limits=limits)]


def _root_mean_square(values: Array) -> float:
    """Return it also of values whose squares are too large for a number."""
    largest = float(np.abs(values).max())
    return largest * float(np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0


def _range(values: Array, unit: str) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.4g} to {known.max():.4g} {unit}" if known.size else "nothing finite"
