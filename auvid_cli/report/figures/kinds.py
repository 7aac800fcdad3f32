"""From a figure request to a figure and its files; loads matplotlib, so only the processes that draw import it."""

import warnings
from collections.abc import Collection
from pathlib import Path

from matplotlib.figure import Figure

from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.files import remove, replacing
from auvid_cli.report.figures import draw
from auvid_cli.report.figures.coefficients import (
    bounds_figure,
    convergence_figure,
    correlation_figure,
    estimate_figure,
    map_figure,
    spread_figure,
)
from auvid_cli.report.figures.motion import motion_error_figure, motion_figure, path_figure
from auvid_cli.report.figures.timeline import mission_figure, timeline_figure
from auvid_cli.report.figures.validation import free_run_figure, horizon_figure, innovation_figure


def draw_figure(request: draw.FigureRequest) -> Figure:
    """Return the figure of a request."""
    match request:
        case draw.PathRequest(truth, motions):
            return path_figure(truth, motions)
        case draw.MotionErrorRequest(truth, motions):
            return motion_error_figure(truth, motions)
        case draw.EstimateRequest(symbols, estimates, true):
            return estimate_figure(symbols, estimates, true)
        case draw.ConvergenceRequest(symbols, estimates, true):
            return convergence_figure(symbols, estimates, true)
        case draw.InnovationRequest(innovations):
            return innovation_figure(innovations)
        case draw.FreeRunRequest(sensors, runs):
            return free_run_figure(sensors, runs)
        case draw.MotionRequest(quantities, sensors, runs):
            return motion_figure(quantities, sensors, runs)
        case draw.HorizonRequest(filter_name, predictions):
            return horizon_figure(filter_name, predictions)
        case draw.BoundsRequest(identifiability):
            return bounds_figure(identifiability)
        case draw.CorrelationRequest(identifiability):
            return correlation_figure(identifiability)
        case draw.TimelineRequest(sensors, inspection):
            return timeline_figure(sensors, inspection)
        case draw.MissionRequest(time, inputs, band, symbols, percents):
            return mission_figure(time, inputs, band, symbols, percents)
        case draw.SpreadRequest(runs, columns, filters):
            return spread_figure(runs, columns, filters)
        case draw.MapRequest(table, columns, filters):
            return map_figure(table, columns, filters)


def save(figure: Figure, folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Write a figure in each of `formats`, and remove its files of other formats."""
    with warnings.catch_warnings():
        # A character of a name that the font lacks is drawn as a box.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        paths = [_save(figure, folder / f"{name}.{form}", form) for form in FigureFormat if form in formats]
    remove(folder / f"{name}.{form}" for form in FigureFormat if form not in formats)
    return paths


def _save(figure: Figure, path: Path, form: FigureFormat) -> Path:
    # `Figure.savefig` would draw everything twice for each file, first only for the layout.
    with replacing(path) as temporary:
        match form:
            case FigureFormat.PNG:
                from matplotlib.backends.backend_agg import FigureCanvasAgg

                options = {"metadata": {"Software": "auvid"}, "pil_kwargs": {"compress_level": 4}}
                FigureCanvasAgg(figure).print_png(temporary, **options)
            case FigureFormat.SVG:
                from matplotlib.backends.backend_svg import FigureCanvasSVG

                FigureCanvasSVG(figure).print_svg(temporary, metadata={"Date": None})
            case FigureFormat.PDF:
                from matplotlib.backends.backend_pdf import FigureCanvasPdf

                FigureCanvasPdf(figure).print_pdf(temporary, metadata={"CreationDate": None})
    # The layout is kept for the next format.
    figure.set_layout_engine("none")
    return path
