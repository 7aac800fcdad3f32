"""What the sensors said beyond the estimates: innovations, NIS over time, autocorrelation."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import LAGS, Innovations
from auvid_cli.report.figures.series import spaced
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.envelope import envelope
from auvid_cli.report.page.parts import Part, Plot, PlotLine, Plots, Words
from auvid_cli.report.scales import scale_of
from auvid_cli.vehicle.parameters import SENSORS, Quantity

Array = NDArray[np.float64]

# Parts of a run of which the extremes are drawn, of which the NIS is averaged, and points of a smooth bound.
_SPANS, _WINDOWS, _BOUND_POINTS = 400, 60, 120
# Half the height of a plot in usual bounds of two standard deviations.
_HIGHEST = 2.5
# Of all mean NIS by chance this share lies within the band.
_WITHIN = 0.95
_TWO_SIDED = 1.96


def innovation_parts(estimates: Sequence[Estimate]) -> list[Part]:
    """Return, sensor by sensor, innovations within their bounds, NIS over time and autocorrelation."""
    sensors = dict.fromkeys(sensor for estimate in estimates for sensor in estimate.innovations)
    plots: list[Plot] = []
    for sensor in sensors:
        of_sensor = [(e.filter, e.innovations[sensor]) for e in estimates if sensor in e.innovations]
        for component, quantity in enumerate(SENSORS[sensor]):
            plots += _components(sensor, quantity, component, of_sensor)
        plots += [*_nis(sensor, of_sensor), *_memory(sensor, of_sensor)]
    if not plots:
        return []
    choice = {estimate.filter: filter_label(estimate.filter) for estimate in estimates if estimate.innovations}
    words = (
        "Innovations are measurements minus predictions. They should lie within the lines of two standard deviations "
        "95 times of 100, their normalised squares (NIS, per component) around 1 within the shaded band, and their "
        "autocorrelation within its band. Choose the estimator here."
    )
    return [Words([words]), Plots(plots, choice=choice)]


def _components(
    sensor: str, quantity: Quantity, component: int, of_sensor: Iterable[tuple[str, Innovations]]
) -> list[Plot]:
    scale = scale_of(quantity)
    lines, shares, height, beyond = [], [], 0.0, 0
    for name, innovations in of_sensor:
        known = innovations.used()[:, component] & np.isfinite(innovations.innovation[:, component])
        if not known.any():
            continue
        time = innovations.time[known]
        values = innovations.innovation[known, component] * scale.factor
        bound = 2.0 * np.sqrt(innovations.variance[known, component]) * scale.factor
        shares.append(f"{filter_label(name)} {100.0 * float((np.abs(values) <= bound).mean()):.1f} %")
        # At the start the bounds are those of the prior.
        usual = _HIGHEST * float(np.median(bound))
        height = max(height, usual)
        beyond += int((np.abs(values) > usual).sum())
        at, drawn = envelope(time, values[:, None], _SPANS)
        lines.append(PlotLine(f"{filter_label(name)} innovation", "measured", at, drawn[:, 0], of=name))
        some = spaced(time.size, _BOUND_POINTS)
        for sign, word in ((1.0, "+2 sd"), (-1.0, "-2 sd")):
            lines.append(PlotLine(f"{filter_label(name)} {word}", name, time[some], sign * bound[some], of=name))
    if not lines:
        return []
    outside = f" Beyond the axis: {beyond}." if beyond else ""
    says = f"Innovations of {quantity.symbol}; within two standard deviations: {', '.join(shares)}.{outside}"
    limits = (-height, height) if height > 0.0 else None
    return [Plot(f"{sensor}: {quantity.symbol}", says, scale.unit, lines, limits=limits)]


def _nis(sensor: str, of_sensor: Iterable[tuple[str, Innovations]]) -> list[Plot]:
    """Plot the mean NIS per component of equal windows, with the band that chance leaves it in."""
    lines: list[PlotLine] = []
    words, band = [], None
    for name, innovations in of_sensor:
        components = innovations.used().sum(axis=1)
        if not components.any():
            continue
        edges = np.linspace(innovations.time[0], innovations.time[-1], _WINDOWS + 1)
        window = np.clip(np.searchsorted(edges, innovations.time, side="right") - 1, 0, _WINDOWS - 1)
        count = np.bincount(window, components, _WINDOWS)
        squares = np.bincount(window, np.nan_to_num(innovations.nis), _WINDOWS)
        with np.errstate(invalid="ignore"):
            mean = np.where(count > 0.0, squares / count, np.nan)
        middle = 0.5 * (edges[1:] + edges[:-1])
        lines.append(PlotLine(filter_label(name), name, middle, mean))
        words.append(f"{filter_label(name)} {innovations.tally().mean_nis:.3g}")
        band = (middle, count) if band is None else band
    if band is None:
        return []
    middle, count = band
    enough = np.where(count > 0.0, count, np.nan)
    tails = ("chance, upper", 0.5 - _WITHIN / 2.0), ("chance, lower", 0.5 + _WITHIN / 2.0)
    chance = [PlotLine(label, "chance", middle, chdtri(enough, tail) / enough) for label, tail in tails]
    says = f"Mean NIS of {sensor} per component, 1 by right noise: {', '.join(words)}."
    return [Plot(f"{sensor}: NIS", says, "per component", [*chance, *lines])]


def _memory(sensor: str, of_sensor: Iterable[tuple[str, Innovations]]) -> list[Plot]:
    """Plot how innovations correlate with those before, of each component."""
    lines: list[PlotLine] = []
    largest = []
    lags = np.arange(1.0, LAGS + 1.0)
    samples = 0.0
    for name, innovations in of_sensor:
        memory = innovations.memory
        rows = zip(SENSORS[sensor], memory.correlation, memory.samples, strict=True)
        for component, (quantity, values, n) in enumerate(rows):
            if n:
                label = f"{filter_label(name)} {quantity.symbol}"
                look = f"component{component % 3}"
                lines.append(PlotLine(label, look, lags, values, of=name, key=quantity.symbol))
                largest.append((float(np.abs(values).max()), label))
                samples = max(samples, float(n))
    if not lines:
        return []
    bound = np.full(LAGS, _TWO_SIDED / np.sqrt(samples))
    chance = [PlotLine("chance, upper", "chance", lags, bound), PlotLine("chance, lower", "chance", lags, -bound)]
    size, label = max(largest)
    says = f"Autocorrelation of the innovations of {sensor}; largest {size:.2g}, of {label}."
    return [Plot(f"{sensor}: autocorrelation", says, "correlation", [*chance, *lines], x_label="samples later")]
