"""Figures of a campaign: spread of the errors of each filter, and a map over two settings."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvid_cli.arrays import Array
from auvid_cli.campaign.axes import CellErrors, errors_by_cell
from auvid_cli.report.figures import style
from auvid_cli.report.table import setting_text

if TYPE_CHECKING:
    # Other figures do not need it.
    import pandas as pd

_HATCHES = ("", "////", "xxxx", "....", "----", "++++", "oo")
# Share of the distance between two groups that the boxes of a group fill.
_WIDTH = 0.8
_MAX_PANELS = 12
_MAX_ERROR = 1e3  # %
_MIN_RUNS = 4  # for quartiles
_MIN_SPAN = 4.0  # ratio of the limits of the axis


def spread_figure(runs: "pd.DataFrame", columns: list[str], filters: dict[str, str]) -> Figure:
    """Draw box plots of the mean steady-state errors of the runs that ended, and the share of runs that failed.

    Parameters
    ----------
    runs : DataFrame
        A row for each: axes, filter, status, steady_state_error_percent.
    columns : list of str
        Axes: the last along each panel, the others from panel to panel.
    filters : dict
        Filter of each variant, by name of the variant.
    """
    cells = errors_by_cell(runs, columns)
    keys = list(dict.fromkeys(cell.key[:-1] for cell in cells))
    shown = keys[:_MAX_PANELS]
    figure = style.new_figure(11.0, 2.6 * len(shown) + 0.9)
    panels = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True, sharey=True))
    levels, looks = list(dict.fromkeys(cell.key[-1:] for cell in cells)), _looks(filters)
    for axes, key in zip(panels, shown, strict=True):
        for k, (name, look) in enumerate(looks.items()):
            width, marker = 0.85 * _WIDTH / len(looks), style.FILTER_STYLES[filters[name]].marker
            of_panel = {cell.key[-1:]: cell for cell in cells if cell.filter == name and cell.key[:-1] == key}
            places = np.arange(len(levels), dtype=np.float64) + _WIDTH * ((k + 0.5) / len(looks) - 0.5)
            drawn = [(place, of_panel[level]) for place, level in zip(places, levels, strict=True) if level in of_panel]
            _draw_runs(axes, drawn, width, look, marker)
        axes.set_yscale("log")
        style.plain_log_ticks(axes.yaxis)
        style.plain_frame(axes, "y")
        axes.set_ylabel("error (%)", fontsize=9)
        names = zip(columns, key, strict=False)
        style.head(axes, style.plain(", ".join(f"{column} {setting_text(value)}" for column, value in names)))
    panels[-1].set_xticks(range(len(levels)), [style.plain("".join(map(setting_text, level))) for level in levels])
    panels[-1].set_xlabel(style.plain(columns[-1] if columns else ""), fontsize=9)
    low, high = panels[0].get_ylim()
    if 0.0 < low < high < _MIN_SPAN * low:
        # Errors that hardly differ look alike.
        room = np.sqrt(_MIN_SPAN * low / high)
        panels[0].set_ylim(low / room, high * room)
    most = max(cell.ended for cell in cells)
    words = ["a mark for each run" if most < _MIN_RUNS else "box: quartiles, mark: median, whiskers: 5 to 95 %"]
    words += ["upright numbers: share of runs that failed"] * any(cell.lost for cell in cells)
    words += [f"{len(keys) - len(shown)} more combinations: see the tables"] * (len(keys) > len(shown))
    handles: list[Artist] = [Patch(label=style.plain(name), **look) for name, look in looks.items()]
    if most < _MIN_RUNS:
        handles = [
            Line2D([], [], linestyle="", label=style.plain(name), **_mark(style.FILTER_STYLES[filters[name]]))
            for name in looks
        ]
    style.legend_above(figure, [*handles, *(Patch(label=text, color="none") for text in words)])
    return figure


def _mark(look: style.FilterStyle) -> dict[str, Any]:
    return {"marker": look.marker, "color": look.color, "markeredgecolor": "black"}


def _draw_runs(
    axes: Axes, cells: list[tuple[float, CellErrors]], width: float, look: dict[str, Any], marker: str
) -> None:
    """Draw a box of the errors of each cell or, if they are too few for quartiles, marks, and the share of failures."""
    boxed: list[tuple[float, Array]] = []
    for place, cell in cells:
        errors = np.minimum(cell.errors, _MAX_ERROR)
        if errors.size >= _MIN_RUNS:
            boxed.append((place, errors))
        else:
            at = np.full(errors.size, place)
            axes.plot(at, errors, marker, color=look["facecolor"], markeredgecolor="black", markersize=6.0)
        if cell.lost:
            failed = {"rotation": 90, "fontsize": 6.5, "ha": "center", "va": "bottom", "color": "#A00000"}
            axes.text(place, 0.01, f"{cell.lost:.0%}", transform=axes.get_xaxis_transform(), **failed)
    if not boxed:
        return
    places, errors = zip(*boxed, strict=True)
    boxes = axes.boxplot(
        errors,
        positions=places,
        widths=width,
        whis=(5, 95),
        manage_ticks=False,
        patch_artist=True,
        medianprops={"linewidth": 0.0},
        flierprops={"marker": marker, "markersize": 3.0, "markeredgecolor": "0.3", "markerfacecolor": "none"},
    )
    for box in boxes["boxes"]:
        box.set(**look)
    medians = [float(np.median(values)) for values in errors]
    axes.plot(places, medians, marker, color="white", markeredgecolor="black", markersize=6.0, zorder=4.0)


def map_figure(table: "pd.DataFrame", columns: list[str], filters: dict[str, str]) -> Figure:
    """Draw the median error over two settings, a panel for each filter, with the share of runs that were lost.

    Parameters
    ----------
    table : DataFrame
        Result of `auvid_cli.campaign.summary.by_filter`. Over further axes, errors are medians and shares are means.
    columns, filters
        As of `spread_figure`; the last two axes are the map's.
    """
    down, across = columns[-2:]
    rows, cols = list(dict.fromkeys(table[down])), list(dict.fromkeys(table[across]))
    n = len(filters)
    wide = min(n, 3)
    figure = style.new_figure(1.0 + wide * (0.62 * len(cols) + 0.9), -(-n // wide) * (0.42 * len(rows) + 1.0) + 0.5)
    panels = np.atleast_1d(figure.subplots(-(-n // wide), wide, sharex=True, sharey=True, squeeze=False)).ravel()
    errors = table["steady_state_error_percent"].clip(upper=_MAX_ERROR).dropna().to_numpy(dtype=np.float64)
    # Decades; NaN without a completed run.
    lowest, highest = np.log10([errors.min(), errors.max()]) if errors.size else (0.0, 0.0)
    image = None
    for axes, name in zip(panels, filters, strict=False):
        of_filter = table[table["filter"] == name]
        error, lost, inconsistent = (
            of_filter.groupby([down, across])[value]
            .agg(over)
            .unstack()
            .reindex(index=rows, columns=cols)
            .to_numpy(np.float64)
            for value, over in (
                ("steady_state_error_percent", "median"),
                ("diverged", "mean"),
                ("inconsistent", "mean"),
            )
        )
        decades = np.log10(np.minimum(error, _MAX_ERROR))
        image = axes.imshow(decades, vmin=lowest, vmax=highest, cmap="viridis_r", aspect="auto")
        for i, j in np.ndindex(len(rows), len(cols)):
            text = _rounded(float(error[i, j])) if np.isfinite(error[i, j]) else "-"
            text += f"\n{lost[i, j]:.0%} lost" if lost[i, j] > 0.0 else ""
            text += f"\n{inconsistent[i, j]:.0%} incons." if inconsistent[i, j] > 0.0 else ""
            is_dark = decades[i, j] > 0.5 * (lowest + highest)
            axes.text(j, i, text, ha="center", va="center", fontsize=6, color="white" if is_dark else "black")
        axes.set_xticks(range(len(cols)), [style.plain(setting_text(value)) for value in cols], fontsize=8)
        axes.set_yticks(range(len(rows)), [style.plain(setting_text(value)) for value in rows], fontsize=8)
        style.head(axes, style.plain(name))
    for axes in panels[n:]:
        axes.set_visible(False)
    figure.supxlabel(style.plain(across), fontsize=9)
    figure.supylabel(style.plain(down), fontsize=9)
    if image is not None:
        bar = figure.colorbar(image, ax=panels.tolist(), shrink=0.8)
        bar.set_label("median error (%),\ndarker is larger", fontsize=8)
        bar.ax.yaxis.set_major_formatter(lambda decades, _: _rounded(10.0**decades))
    return figure


def _rounded(percent: float) -> str:
    """Write two digits, not as a power of ten."""
    return f"{float(f'{percent:.2g}'):g}"


def _looks(filters: dict[str, str]) -> dict[str, dict[str, Any]]:
    """Return the fill of each variant: the colour of its filter, and a hatching of its own."""
    return {
        name: {"facecolor": style.FILTER_STYLES[kind].color, "hatch": _HATCHES[place % len(_HATCHES)]}
        for place, (name, kind) in enumerate(filters.items())
    }
