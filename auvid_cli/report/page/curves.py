"""Curves of a page: motion, path, residuals and their envelopes."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.special import chdtri

from auvid_cli.arrays import Array, release_memory
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord, TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.data.innovations import N_LAGS, Innovations
from auvid_cli.evaluation.results import FreeRun
from auvid_cli.report.page import parts
from auvid_cli.report.plot_data import (
    component_innovations,
    envelope,
    free_run_residual,
    scale_of,
    spaced,
    travelled,
    travelled_paths,
)
from auvid_cli.report.table import filter_label
from auvid_cli.text import sentence
from auvid_cli.vehicle.parameters import DEPTH, MOTION_AND_DEPTH_SYMBOLS, SENSORS, Quantity

_MOTION_PARTS = 700  # content of a run whose extremes are drawn
_MAX_RESIDUALS = 100_000  # about as many as a free run keeps
HOW_TO_LOOK = (
    "Drag over a plot to zoom into all of them; double-click or press 0 to see the whole run. A long series is drawn "
    "by the smallest and the largest value of each of many short spans."
)
_WIDTH = 520.0
_HEIGHT = 420.0
_LEFT = 58.0
_TOP = 30.0
_BOTTOM = 48.0
_RIGHT = 16.0
_MARGIN = 0.05
_MAX_POINTS = 500  # points of a path in space
_RESIDUAL_PARTS = 400  # parts of a run of which the extremes are drawn
_NIS_WINDOWS = 60  # parts of a run for the mean NIS
_BOUND_POINTS = 120  # points of a smooth bound
_HALF_HEIGHT = 2.5  # half height of a plot, in median bounds of two standard deviations
_BAND_PROBABILITY = 0.95  # probability of the band of the mean NIS
_TWO_SIDED = 1.96  # standard deviations


def course_parts(dataset: Dataset, runs: Mapping[str, FreeRun]) -> list[parts.Part]:
    """Return plots that are zoomed together: inputs, measurements, and residuals of the free runs."""
    plots = [*input_plots(dataset.inputs), *sensor_plots(dataset.sensors, runs)]
    residuals = "Residuals are measurements minus the free run, in which the inputs alone drive the final model."
    return [parts.Words([f"{HOW_TO_LOOK} {residuals}"]), parts.Plots(plots, linked="time", wide=True)]


def input_plots(inputs: InputRecord) -> list[parts.Plot]:
    """Plot each input."""
    plots = []
    for column, quantity in enumerate(inputs.quantities):
        scale = scale_of(quantity)
        time, values = _envelope(inputs.time, inputs.values[:, column], scale.factor)
        says = sentence(f"{quantity.meaning}, {_range(values, scale.unit)}")
        line = parts.PlotLine(quantity.symbol, "input", time, values, "steps")
        plots.append(parts.Plot(f"input: {quantity.symbol.replace('_', ' ')}", says, scale.unit, [line]))
    return plots


def sensor_plots(
    sensors: Mapping[str, SensorRecord],
    runs: Mapping[str, FreeRun],
    marks: Mapping[str, list[tuple[float, float]]] | None = None,
) -> list[parts.Plot]:
    """Plot the measurements of each component of each sensor, with shaded marks, and their residuals."""
    plots = []
    for name, record in sensors.items():
        for column, quantity in enumerate(SENSORS[name]):
            if not np.isfinite(record.values[:, column]).any():
                continue
            scale = scale_of(quantity)
            time, values = _envelope(record.time, record.values[:, column], scale.factor)
            says = sentence(f"{quantity.meaning} by {name}, {_range(values, scale.unit)}")
            line = parts.PlotLine("measured", "measured", time, values)
            shaded = () if marks is None else marks.get(name, ())
            plots.append(parts.Plot(f"{name}: {quantity.symbol}", says, scale.unit, [line], marks=shaded))
            plots += _residual(name, quantity, record.time, record.values[:, column], runs)
    return plots


def _envelope(time: Array, values: Array, factor: float) -> tuple[Array, Array]:
    """Return the envelope of a column of a table times a factor."""
    values = values * factor
    release_memory()
    return envelope(time, values, _MOTION_PARTS)


def _residual(
    sensor: str, quantity: Quantity, time: Array, measured: Array, runs: Mapping[str, FreeRun]
) -> list[parts.Plot]:
    """Plot measurements minus free runs, of motion states."""
    scale = scale_of(quantity)
    known = np.flatnonzero(np.isfinite(measured))
    some = known[:: 1 + known.size // _MAX_RESIDUALS]
    time, measured = time[some], measured[some]
    release_memory()
    lines, words = [], []
    # The height of the measurements limits the axis, because a model that diverged would hide the others.
    height = scale.factor * float(np.ptp(measured))
    beyond = False
    for name, run in runs.items():
        residual = free_run_residual(quantity, time, measured, run)
        if residual is None:
            continue
        residual *= scale.factor
        finite = residual[np.isfinite(residual)]
        if finite.size:
            beyond |= height > 0.0 and bool((np.abs(finite) > height).any())
            lines.append(parts.PlotLine(filter_label(name), name, *envelope(time, residual, _MOTION_PARTS)))
            words.append(f"{filter_label(name)} {_root_mean_square(finite):.3g} {scale.unit}")
    if not lines:
        return []
    says = f"Measured minus free run; root mean square {', '.join(words)}."
    if beyond:
        says += " Not all of it is within the axis."
    limits = (-height, height) if height > 0.0 else None
    return [parts.Plot(f"{sensor}: {quantity.symbol}, residual", says, scale.unit, lines, limits=limits)]


def _root_mean_square(values: Array) -> float:
    """Return the root mean square without overflow."""
    largest = float(np.abs(values).max())
    return largest * float(np.sqrt(np.mean((values / largest) ** 2))) if largest else 0.0


def _range(values: Array, unit: str) -> str:
    known = values[np.isfinite(values)]
    return f"{known.min():.4g} to {known.max():.4g} {unit}" if known.size else "nothing finite"


def path_parts(truth: TruthRecord | None, estimates: Sequence[Estimate]) -> list[parts.Part]:
    """Draw the true path, if it is known, and dead reckoning from the estimated motion."""
    tracks = _tracks(truth, estimates)
    if not tracks:
        return []
    ends = ", ".join(
        f"{track.label} {np.linalg.norm(track.position[-1] - tracks[0].position[-1]):.3g} m" for track in tracks[1:]
    )
    words = "The path of an estimate is dead reckoning: the estimated velocity, rotated by the attitude and integrated"
    words += " from the true start." if truth is not None else " from its start. It drifts."
    is_known = all(DEPTH.symbol in estimate.state for estimate in estimates)
    words += " The depth is the estimated one." if is_known else " The depth drifts, too."
    if ends and truth is not None:
        words += f" Position errors at the end: {ends}."
    says = f"Paths of {', '.join(track.label for track in tracks)} in space."
    return [parts.Words([words]), _plan(tracks), _profile(tracks), parts.Space(says, tracks)]


def _tracks(truth: TruthRecord | None, estimates: Sequence[Estimate]) -> list[parts.PathTrack]:
    tracks = []
    for track in travelled_paths(truth, (estimate.history(MOTION_AND_DEPTH_SYMBOLS) for estimate in estimates)):
        names = ("truth", "true") if track.filter is None else (filter_label(track.filter), track.filter)
        tracks.append(parts.PathTrack(*names, track.position[spaced(len(track.position), _MAX_POINTS)]))
    return tracks


def _legend(tracks: Sequence[parts.PathTrack]) -> list[tuple[str, str]]:
    return [(track.look, track.label) for track in tracks]


def _plan(tracks: Sequence[parts.PathTrack]) -> parts.Picture:
    """Draw north over east, both to one scale."""
    every = np.concatenate([track.position for track in tracks])
    (north, east), ranges = every[:, :2].max(axis=0), np.ptp(every[:, :2], axis=0)
    wide, high = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    metres = (1.0 + 2.0 * _MARGIN) * max(ranges[1] / wide, ranges[0] / high, 1e-3)
    middle = north - 0.5 * ranges[0], east - 0.5 * ranges[1]
    across = parts.Axis(middle[1] - 0.5 * metres * wide, middle[1] + 0.5 * metres * wide, _LEFT, _LEFT + wide)
    up = parts.Axis(middle[0] - 0.5 * metres * high, middle[0] + 0.5 * metres * high, _TOP + high, _TOP)
    shapes = parts.frame(across, up, "east (m)", "north (m)")
    shapes += [parts.stroke(t.position[:, 1], t.position[:, 0], across, up, t.look) for t in tracks]
    says = f"The paths reach over {ranges[0]:.3g} m north and {ranges[1]:.3g} m east."
    return parts.Picture("Plan", says, _WIDTH, _HEIGHT, shapes, _legend(tracks))


def _profile(tracks: Sequence[parts.PathTrack]) -> parts.Picture:
    """Draw depth, growing downwards, over the distance along the track."""
    along = [travelled(track.position) for track in tracks]
    depths = np.concatenate([track.position[:, 2] for track in tracks])
    room = max(_MARGIN * float(np.ptp(depths)), 0.5)
    across = parts.Axis(0.0, max(float(max(x[-1] for x in along)), 1.0), _LEFT, _WIDTH - _RIGHT)
    down = parts.Axis(float(depths.min()) - room, float(depths.max()) + room, _TOP, _HEIGHT - _BOTTOM)
    shapes: list[parts.Shape] = parts.frame(across, down, "distance along the track (m)", "depth (m)")
    shapes += [
        parts.stroke(x, track.position[:, 2], across, down, track.look) for x, track in zip(along, tracks, strict=True)
    ]
    says = f"Depth from {depths.min():.3g} to {depths.max():.3g} m along {across.high:.4g} m of track."
    return parts.Picture("Profile", says, _WIDTH, _HEIGHT, shapes, _legend(tracks))


def innovation_parts(estimates: Sequence[Estimate]) -> list[parts.Part]:
    """Return, sensor by sensor, innovations within their bounds, NIS over time and autocorrelation."""
    sensors = dict.fromkeys(sensor for estimate in estimates for sensor in estimate.innovations)
    plots: list[parts.Plot] = []
    for sensor in sensors:
        of_sensor = [(e.filter, e.innovations[sensor]) for e in estimates if sensor in e.innovations]
        for component, quantity in enumerate(SENSORS[sensor]):
            plots += _components(sensor, quantity, component, of_sensor)
        plots += [*_nis(sensor, of_sensor), *_autocorrelation(sensor, of_sensor)]
    if not plots:
        return []
    choice = {estimate.filter: filter_label(estimate.filter) for estimate in estimates if estimate.innovations}
    words = (
        "Innovations are measurements minus predictions. 95 of 100 should be within the lines of two standard "
        "deviations. Their normalised squares (NIS, per component) should be near 1, within the band, and their "
        "autocorrelation within its band. Choose the estimator here."
    )
    return [parts.Words([words]), parts.Plots(plots, choice=choice)]


def _components(
    sensor: str, quantity: Quantity, component: int, of_sensor: Iterable[tuple[str, Innovations]]
) -> list[parts.Plot]:
    scale = scale_of(quantity)
    lines, shares, height, beyond = [], [], 0.0, 0
    for name, innovations in of_sensor:
        found = component_innovations(innovations, component)
        if not found.time.size:
            continue
        values, bound = found.values * scale.factor, 2.0 * found.deviation * scale.factor
        shares.append(f"{filter_label(name)} {found.percent_within:.1f} %")
        # At the start the bounds are those of the prior.
        usual = _HALF_HEIGHT * float(np.median(bound))
        height = max(height, usual)
        beyond += int((np.abs(values) > usual).sum())
        drawn = envelope(found.time, values, _RESIDUAL_PARTS)
        lines.append(parts.PlotLine(f"{filter_label(name)} innovation", "measured", *drawn, of=name))
        some = spaced(found.time.size, _BOUND_POINTS)
        for sign, word in ((1.0, "+2 sd"), (-1.0, "-2 sd")):
            lines.append(
                parts.PlotLine(f"{filter_label(name)} {word}", name, found.time[some], sign * bound[some], of=name)
            )
    if not lines:
        return []
    outside = f" Beyond the axis: {beyond}." if beyond else ""
    says = f"Innovations of {quantity.symbol}; within two standard deviations: {', '.join(shares)}.{outside}"
    limits = (-height, height) if height > 0.0 else None
    return [parts.Plot(f"{sensor}: {quantity.symbol}", says, scale.unit, lines, limits=limits)]


def _nis(sensor: str, of_sensor: Iterable[tuple[str, Innovations]]) -> list[parts.Plot]:
    """Plot the mean NIS per component in equal windows, with the 95 % band of a consistent filter."""
    lines: list[parts.PlotLine] = []
    words, band = [], None
    for name, innovations in of_sensor:
        components = innovations.used().sum(axis=1)
        if not components.any():
            continue
        edges = np.linspace(innovations.time[0], innovations.time[-1], _NIS_WINDOWS + 1)
        window = np.clip(np.searchsorted(edges, innovations.time, side="right") - 1, 0, _NIS_WINDOWS - 1)
        count = np.bincount(window, components, _NIS_WINDOWS)
        squares = np.bincount(window, np.nan_to_num(innovations.nis), _NIS_WINDOWS)
        with np.errstate(invalid="ignore"):
            mean = np.where(count > 0.0, squares / count, np.nan)
        middle = 0.5 * (edges[1:] + edges[:-1])
        lines.append(parts.PlotLine(filter_label(name), name, middle, mean))
        words.append(f"{filter_label(name)} {innovations.sums().mean_nis:.3g}")
        band = (middle, count) if band is None else band
    if band is None:
        return []
    middle, count = band
    enough = np.where(count > 0.0, count, np.nan)
    tails = ("chance, upper", 0.5 - _BAND_PROBABILITY / 2.0), ("chance, lower", 0.5 + _BAND_PROBABILITY / 2.0)
    chance = [parts.PlotLine(label, "chance", middle, chdtri(enough, tail) / enough) for label, tail in tails]
    says = f"Mean NIS of {sensor} per component, 1 if the noise is right: {', '.join(words)}."
    return [parts.Plot(f"{sensor}: NIS", says, "per component", [*chance, *lines])]


def _autocorrelation(sensor: str, of_sensor: Iterable[tuple[str, Innovations]]) -> list[parts.Plot]:
    """Plot the autocorrelation of the innovations of each component."""
    lines: list[parts.PlotLine] = []
    largest = []
    lags = np.arange(1.0, N_LAGS + 1.0)
    samples = 0.0
    for name, innovations in of_sensor:
        found = innovations.autocorrelation
        rows = zip(SENSORS[sensor], found.correlation, found.samples, strict=True)
        for component, (quantity, values, n) in enumerate(rows):
            if n:
                label = f"{filter_label(name)} {quantity.symbol}"
                look = f"component{component % 3}"
                lines.append(parts.PlotLine(label, look, lags, values, of=name, key=quantity.symbol))
                largest.append((float(np.abs(values).max()), label))
                samples = max(samples, float(n))
    if not lines:
        return []
    bound = np.full(N_LAGS, _TWO_SIDED / np.sqrt(samples))
    chance = [
        parts.PlotLine("chance, upper", "chance", lags, bound),
        parts.PlotLine("chance, lower", "chance", lags, -bound),
    ]
    size, label = max(largest)
    says = f"Autocorrelation of the innovations of {sensor}; largest {size:.2g}, of {label}."
    return [parts.Plot(f"{sensor}: autocorrelation", says, "correlation", [*chance, *lines], x_label="samples later")]
