"""Line and mark of each filter, the same in figures and on pages."""

from typing import NamedTuple

from auvid_cli.config.enums import FilterName


class FilterLine(NamedTuple):
    """Line and mark of a filter; colours after Okabe and Ito; light, wide lines are below dark, thin ones."""

    color: str  # on white
    color_on_dark: str
    width: float  # points in a figure, pixels on a page
    dash: tuple[float, ...]  # lengths of strokes and gaps, widths of the line; empty: solid
    marker: str  # of matplotlib
    marker_size: float  # points


FILTER_LINES: dict[str, FilterLine] = {
    FilterName.EKF: FilterLine("#3a97c9", "#6cc3f0", 2.6, (), "o", 7.0),
    FilterName.CKF: FilterLine("#d55e00", "#ff9a56", 1.2, (), "s", 5.0),
    FilterName.TUKF: FilterLine("#24292f", "#f2f4f6", 1.5, (1.0, 1.3), "^", 5.0),
    FilterName.UKF: FilterLine("#00875f", "#4fd6a6", 1.2, (5.0, 1.5, 1.0, 1.5), "P", 5.5),
    FilterName.SMOOTHER: FilterLine("#0072b2", "#5aaef0", 1.7, (6.0, 4.0), "D", 4.5),
    FilterName.OUTPUT_ERROR: FilterLine("#b0508a", "#f09aca", 1.8, (7.0, 2.0, 1.0, 2.0), "v", 5.5),
}
