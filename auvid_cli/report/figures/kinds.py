"""All kinds of figures by name, and the files that they are saved to.

Only the processes that draw load this module.
"""

import warnings
from collections.abc import Callable, Collection
from pathlib import Path

from matplotlib.figure import Figure

from auvid_cli.config.enums import FigureFormat
from auvid_cli.data.files import remove, replacing
from auvid_cli.report.figures.campaign_errors import map_figure, spread_figure
from auvid_cli.report.figures.coefficients import bounds_figure, convergence_figure, correlation_figure, estimate_figure
from auvid_cli.report.figures.motion import motion_error_figure, motion_figure, path_figure
from auvid_cli.report.figures.timeline import mission_figure, timeline_figure
from auvid_cli.report.figures.validation import free_run_figure, horizon_figure, innovation_figure

KINDS: dict[str, Callable[..., Figure]] = {
    "path": path_figure,
    "estimates": estimate_figure,
    "convergence": convergence_figure,
    "motion_errors": motion_error_figure,
    "free_runs": free_run_figure,
    "motion": motion_figure,
    "innovations": innovation_figure,
    "bounds": bounds_figure,
    "correlation": correlation_figure,
    "timeline": timeline_figure,
    "horizons": horizon_figure,
    "spread": spread_figure,
    "map": map_figure,
    "mission": mission_figure,
}


def save(figure: Figure, folder: Path, name: str, formats: Collection[FigureFormat]) -> list[Path]:
    """Write a figure in some formats, each whole or not at all; those in others, of what was before, go."""
    with warnings.catch_warnings():
        # A sign that the font lacks, of a name, stands as a box.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        paths = [_save(figure, folder / f"{name}.{form}", form) for form in FigureFormat if form in formats]
    remove(folder / f"{name}.{form}" for form in FigureFormat if form not in formats)
    return paths


def _save(figure: Figure, path: Path, form: FigureFormat) -> Path:
    # `Figure.savefig` would draw everything twice for each file, the first time for the layout alone.
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
    # The layout is found, and is the same for the next format.
    figure.set_layout_engine("none")
    return path
