"""Whether the innovations of filters stay within their own bounds."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from auvid_cli.data.innovations import Innovations
from auvid_cli.report.figures.limits import value_range
from auvid_cli.report.figures.style import Room, head, new_panels
from auvid_cli.report.notation import filter_label, symbol_math
from auvid_cli.report.scales import scale_of
from auvid_cli.vehicle.parameters import SENSORS

Array = NDArray[np.float64]

# Half the height of a panel in standard deviations: what is beyond it is counted, not drawn.
_HIGHEST = 4.0
_BINS = 32
# Samples that a bin of time has about, and the most bins.
_SAMPLES_PER_BIN, _MOST_BINS = 40, 120
# Height of a strip, inches.
_STRIP = 0.62
_BOUND = {"color": "#D55E00", "linewidth": 1.1, "linestyle": (0, (5, 2))}
_DARKEST = "0.15"


class _Strip(NamedTuple):
    """A component of a sensor, and where the middle of its strip stands."""

    sensor: str
    component: int
    middle: float


def innovation_figure(innovations: dict[str, dict[str, Innovations]]) -> Figure:
    """Draw a panel for each filter, and in it a strip for each component of each sensor.

    Each shows how many innovations there are over time and over their own standard deviations: the darker the more.

    Parameters
    ----------
    innovations : dict
        By filter, then by sensor.
    """
    sensors = dict.fromkeys(sensor for of_filter in innovations.values() for sensor in of_filter)
    components = [(sensor, component) for sensor in sensors for component in range(len(SENSORS[sensor]))]
    strips = [_Strip(*row, -2.0 * _HIGHEST * place) for place, row in enumerate(components)]
    handles = [
        Patch(color=_DARKEST, label="innovations, the darker the more"),
        Line2D(
            [],
            [],
            label="±2 standard deviations; of the innovations so many % within, so many beyond the strip",
            **_BOUND,
        ),
    ]
    room = Room(left=1.6, across=0.12)
    span = value_range(*(of.time for of_filter in innovations.values() for of in of_filter.values())) or (0.0, 1.0)
    figure, panels = new_panels(
        len(innovations), len(innovations), _STRIP * len(strips), handles, room, span, with_heads=True
    )
    for place, (axes, (name, of_filter)) in enumerate(zip(panels, innovations.items(), strict=True)):
        head(axes, filter_label(name))
        axes.grid(visible=False)
        for strip in strips:
            _draw_strip(axes, of_filter.get(strip.sensor), strip)
        middles = np.array([strip.middle for strip in strips])
        axes.hlines([*(middles - 2.0), *(middles + 2.0)], *axes.get_xlim(), **_BOUND, zorder=3.0)
        axes.hlines(middles - _HIGHEST, *axes.get_xlim(), color="0.5", linewidth=0.6)
        axes.set_ylim(middles[-1] - _HIGHEST, _HIGHEST)
        axes.set_yticks(middles, [_name(strip, innovations) for strip in strips] if place == 0 else [])
        axes.tick_params(axis="y", left=False)
    return figure


def _name(strip: _Strip, innovations: dict[str, dict[str, Innovations]]) -> str:
    """Name a component, with its usual standard deviation by the first filter that has any."""
    quantity = SENSORS[strip.sensor][strip.component]
    scale = scale_of(quantity)
    name = f"{symbol_math(quantity.symbol)}, {strip.sensor}"
    for of_filter in innovations.values():
        if strip.sensor in of_filter:
            variance = of_filter[strip.sensor].variance[:, strip.component]
            known = variance[np.isfinite(variance)]
            if known.size:
                return f"{name}\nsd {scale.factor * float(np.sqrt(np.median(known))):.2g} {scale.unit}"
    return name


def _draw_strip(axes: Axes, innovations: Innovations | None, strip: _Strip) -> None:
    time, normalised = _normalised(innovations, strip.component)
    if not time.size:
        words = "not used" if innovations is None else "no finite innovations"
    else:
        bins = int(np.clip(time.size // _SAMPLES_PER_BIN, 4, _MOST_BINS))
        span = float(time[0]), max(float(time[-1]), float(time[0]) + 1e-3)
        number, *_ = np.histogram2d(time, normalised, bins=(bins, _BINS), range=(span, (-_HIGHEST, _HIGHEST)))
        image = AxesImage(
            axes,
            cmap="Greys",
            # An image of one sample in a bin here and there would be black and white.
            norm=Normalize(0.0, 1.15 * max(float(number.max()), 2.0)),
            extent=(*span, strip.middle - _HIGHEST, strip.middle + _HIGHEST),
            origin="lower",
            interpolation="nearest",
        )
        image.set_data(number.T)
        axes.add_image(image)
        beyond = int((np.abs(normalised) > _HIGHEST).sum())
        words = f"{100.0 * (np.abs(normalised) <= 2.0).mean():.1f} %"
        words += f", {beyond} beyond" if beyond else ""
    # Above the upper bound.
    place = axes.get_xlim()[1], strip.middle + _HIGHEST
    axes.annotate(words, place, (-2.0, -2.0), textcoords="offset points", ha="right", va="top", fontsize=7.5)


def _normalised(innovations: Innovations | None, component: int) -> tuple[Array, Array]:
    """Return times, s, and innovations as multiples of their standard deviations, those that are finite."""
    if innovations is None:
        return np.empty(0), np.empty(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        normalised = innovations.innovation[:, component] / np.sqrt(innovations.variance[:, component])
    known = np.isfinite(normalised)
    return innovations.time[known], normalised[known]
