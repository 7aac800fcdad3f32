"""From a drawn figure to its files."""

import warnings
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from auvid_cli.data.files import replacing


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure as PNG and SVG, each whole or not at all."""
    with warnings.catch_warnings():
        # A sign that the font lacks, of a name, stands as a box.
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        return _save(figure, folder, name)


def _save(figure: Figure, folder: Path, name: str) -> list[Path]:
    png, svg = folder / f"{name}.png", folder / f"{name}.svg"
    # `Figure.savefig` would draw everything twice for each file, the first time for the layout alone.
    with replacing(png) as temporary:
        FigureCanvasAgg(figure).print_png(temporary, metadata={"Software": "auvid"}, pil_kwargs={"compress_level": 4})
    # The layout is found, and is the same for both.
    figure.set_layout_engine("none")
    with replacing(svg) as temporary:
        FigureCanvasSVG(figure).print_svg(temporary, metadata={"Date": None})
    return [png, svg]
