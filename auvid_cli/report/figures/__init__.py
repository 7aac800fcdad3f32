"""The figures of a run, as PNG and SVG. Nothing here touches matplotlib's global state."""

from auvid_cli.report.figures.draw import draw_figures

__all__ = ["draw_figures"]
