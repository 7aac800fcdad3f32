"""What data can say about each coefficient, and which coefficients go together."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvid_cli.evaluation.assessment import CLASSES, Identifiability
from auvid_cli.report.figures.style import head, new_figure, plain_log_ticks
from auvid_cli.report.notation import symbol_math

# Okabe and Ito's, from sure to unknown.
_COLORS = dict(zip((label for _, label in CLASSES), ("#009E73", "#56B4E9", "#E69F00", "#D55E00"), strict=True))
# Percent that a bar without bound, or beyond it, is drawn with.
_LARGEST = 1e4


def bounds_figure(identifiability: Identifiability) -> Figure:
    """Draw bounds in percent of the value, and how they fall with the duration."""
    n = len(identifiability.bounds)
    figure = new_figure(11.0, 0.26 * max(n, 6) + 1.4)
    bars, growth = figure.subplots(1, 2, width_ratios=[1.5, 1.0])
    percents = np.array([min(bound.percent, _LARGEST) for bound in identifiability.bounds])
    smallest = max(float(percents.min()), 1e-6)
    bars.barh(range(n), percents, color=[_COLORS[bound.label] for bound in identifiability.bounds])
    bars.set_xscale("log")
    bars.set_xlim(0.3 * smallest, 3.0 * max(float(percents.max()), CLASSES[-2][0]))
    _tidy_log(bars)
    bars.set_yticks(range(n), [symbol_math(bound.coefficient) for bound in identifiability.bounds])
    bars.invert_yaxis()
    for limit, label in CLASSES[:-1]:
        bars.axvline(limit, color="0.4", linewidth=0.8, linestyle=(0, (4, 3)))
        bars.text(limit, -0.8, label.removeprefix("within "), ha="center", fontsize=8, color="0.35")
    bars.set_xlabel("Cramér-Rao bound (% of the value)", fontsize=9)
    times = [time for time, _ in identifiability.growth]
    for j, bound in enumerate(identifiability.bounds):
        series = [min(percent[j], _LARGEST) for _, percent in identifiability.growth]
        growth.plot(times, series, color=_COLORS[bound.label], linewidth=1.0)
    growth.set_yscale("log")
    growth.set_xscale("log")
    _tidy_log(growth)
    plain_log_ticks(growth.xaxis)
    head(growth, "bound over duration, each coefficient")
    growth.set_xlabel("duration (s)", fontsize=9)
    growth.set_ylabel("bound (%)", fontsize=9)
    return figure


def correlation_figure(identifiability: Identifiability) -> Figure:
    """Draw the correlations of the errors of an estimate that reaches the bound."""
    n = len(identifiability.bounds)
    figure = new_figure(0.36 * max(n, 6) + 2.2, 0.33 * max(n, 6) + 1.6)
    axes = figure.subplots()
    image = axes.imshow(identifiability.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu")
    names = [symbol_math(bound.coefficient) for bound in identifiability.bounds]
    axes.set_xticks(range(n), names, rotation=90, fontsize=8)
    axes.set_yticks(range(n), names, fontsize=8)
    for i, j in np.argwhere(np.abs(np.nan_to_num(identifiability.correlation)) > 0.7):
        if i != j:
            axes.text(
                j, i, f"{identifiability.correlation[i, j]:.2f}", ha="center", va="center", fontsize=6, color="white"
            )
    figure.colorbar(image, ax=axes, shrink=0.8, label="correlation")
    head(axes, "")
    return figure


def _tidy_log(axes: Axes) -> None:
    """Set small type and a faint grid on logarithmic axes."""
    axes.grid(color="0.9", linewidth=0.6, which="major")
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=8)
    axes.spines[["top", "right"]].set_visible(False)
