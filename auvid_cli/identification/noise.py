"""Noise levels of a dataset, estimated by maximum likelihood of the innovations."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from math import log
from typing import NamedTuple, TypeVar

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import (
    FURTHER_STATES,
    BiasName,
    DisturbingForce,
    DisturbingMoment,
    EstimatedDisturbance,
    ProcessNoise,
)
from auvid_cli.config.identification import STEPS_PER_TIME_CONSTANT, Identification
from auvid_cli.config.settings import Settings, three
from auvid_cli.config.units import Unit, magnitude_of
from auvid_cli.data.findings import DisturbanceChoice, TunedNoise, Tuning
from auvid_cli.errors import DataError
from auvid_cli.filters.noise_likelihood import NoiseProgress, OnPass
from auvid_cli.filters.noise_scores import NoiseGroup
from auvid_cli.filters.noise_search import MAX_TRAJECTORIES, NoiseFactors, most_likely_noise
from auvid_cli.identification.compiled_layout import place_of_fading_rate
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, Motion, augmented_problem, shortest_interval
from auvid_cli.vehicle.parameters import DISTURBANCE, INPUTS
from auvid_cli.vehicle.rigid_body import mass_matrix

SettingsClass = TypeVar("SettingsClass", bound=Settings)

# Smallest factor on the noise of a sensor in a coarse tuning. Below it, process noise would replace that of the sensor.
_LEAST_SENSOR_FACTOR = 0.1
# A search on longer data begins with a coarse one on a part of them.
_LONG_DATA = 600.0  # s
_PART = 300.0  # s; length of the part
_WINDOW = 60.0  # s; length of the windows of which it consists
# Mean change of an input below which it is constant apart from rounding.
_NEGLIGIBLE_CHANGE = 1e-9  # SI
# Factor on the shortest time constant and the smallest level that settings accept: a rounded estimate is accepted too.
_MARGIN = 1.01


class AdjustableNoise(NamedTuple):
    """Noise level that can be estimated."""

    path: tuple[str, ...]  # keys of the setting below `identification`; the last is an index for an element of a list
    unit: str
    stated: float  # value in the settings
    group: NoiseGroup


class TuningProgress(NamedTuple):
    """How far a tuning has come."""

    search: NoiseProgress
    # Returns the best noise so far, without intervals, and its motion; none before the first trajectory of all data
    so_far: Callable[[], tuple[Tuning, Motion]] | None
    begins_with_part: bool  # whether a search on windows of long data comes first
    data: str = "the data"  # which it passes through

    def __str__(self) -> str:
        """Return how far it is, in words."""
        search = self.search
        where = f"trajectory {min(search.trajectories + 1, MAX_TRAJECTORIES)} of at most {MAX_TRAJECTORIES}"
        count = f"{search.passes} pass{'' if search.passes == 1 else 'es'}"
        return f"{count} through {self.data}, {where}, gain in log-likelihood {search.gain:.4g}"


OnProgress = Callable[[TuningProgress], None]


def tune_noise(
    prepared: PreparedData,
    with_sensors: bool = False,
    on_progress: OnProgress = lambda progress: None,
    with_time_constants: bool = False,
) -> tuple[Tuning, Motion]:
    """Return the most likely noise levels, and the motion with them; the truth of a simulation is not used.

    Parameters
    ----------
    prepared : PreparedData
    with_sensors : bool
        Whether to tune the standard deviations of the sensors too.
    on_progress : callable
        Receives a `TuningProgress` before each pass through the data. An exception from it ends the search.
    with_time_constants : bool
        Whether to tune the time constants of disturbances too. A log with few sensors does not determine them.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If no trajectory follows the data with the stated noise.
    """
    experiment, settings = prepared.experiment, prepared.experiment.identification
    augmented = augmented_problem(prepared)
    noises = [*process_noises(augmented, settings, with_time_constants)]
    if with_sensors:
        noises += _sensor_noises(augmented, settings)
    part = _part(prepared)
    begins_with_part = part is not None

    def report(search: NoiseProgress) -> None:
        def so_far() -> tuple[Tuning, Motion]:
            assert search.trajectory is not None, "asked for only after the first trajectory"
            factor, unknown = np.exp(search.log_factor), np.full(len(noises), np.nan)
            level, trajectory = search.log_likelihood, search.trajectory
            best = NoiseFactors(factor, unknown, unknown, level, search.gain, search.converged, trajectory)
            return _tuning(experiment, noises, best), Motion.of_trajectory(augmented, search.trajectory)

        on_progress(TuningProgress(search, so_far if search.trajectories else None, begins_with_part))

    def on_part(search: NoiseProgress) -> None:
        on_progress(TuningProgress(search._replace(share=0.0), None, True, "the windows"))

    groups, max_passes, first = _groups(noises), settings.smoother.max_passes, None
    if part is not None:
        first = most_likely_noise(augmented_problem(part).joint, groups, max_passes, on_part, is_coarse=True)
    likeliest = most_likely_noise(augmented.joint, groups, max_passes, report, first=first)
    if likeliest is None:
        raise DataError(
            "no trajectory follows these data with the stated noise: start from a larger "
            "identification.process_noise, and check signs and units (auvid inspect)"
        )
    return _tuning(experiment, noises, likeliest), Motion.of_trajectory(augmented, likeliest.trajectory)


def _part(prepared: PreparedData) -> PreparedData | None:
    """Return one window of each fifth of long data: that in which fin angles and thrust change most.

    Turns determine the coefficients; straight motion contains little information about them. None if the data are not
    long, or the segments too short.
    """
    spans = [segment.timelines.span for segment in prepared.segments]
    starts = np.concatenate([np.arange(begin, end - _WINDOW, _WINDOW) for begin, end in spans])
    n_windows = round(_PART / _WINDOW)
    if sum(end - begin for begin, end in spans) <= _LONG_DATA or starts.size < n_windows:
        return None
    inputs = prepared.dataset.inputs
    deviation = np.array(
        [inputs.between(start, start + _WINDOW).values[:, : len(INPUTS)].std(axis=0) for start in starts]
    )
    # Relative to their mean over all windows; zero for inputs that are constant.
    change = (deviation / np.maximum(deviation.mean(axis=0), _NEGLIGIBLE_CHANGE)).sum(axis=1)
    chosen = [part[change[part].argmax()] for part in np.array_split(np.arange(starts.size), n_windows)]
    # Slightly shorter than `_WINDOW`, so that neighbouring windows remain separate segments.
    windows = tuple((start, start + 0.99 * _WINDOW) for start in starts[chosen].tolist())
    use = prepared.experiment.identification.use
    return prepared.with_identification(use=use.model_copy(update={"spans": windows, "shortest": 0.0}))


def tune_coarsely(
    prepared: PreparedData,
    least: ProcessNoise,
    sensors: Collection[str],
    on_pass: OnPass,
    start: Motion | None = None,
) -> tuple[Tuning, Motion] | None:
    """Return the most likely noise levels without their intervals, and the motion; None if none follows the data.

    Parameters
    ----------
    prepared : PreparedData
    least : ProcessNoise
        Lower limits of the process noise. Less is hardly observable, and slows the convergence of the smoother.
    sensors : collection of str
        Sensors whose noise is tuned too.
    on_pass : callable
        Receives a `NoiseProgress` before each pass through the data; an exception from it ends the search.
    start : Motion, optional
        Of a similar model; the search starts there.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    """
    experiment, settings = prepared.experiment, prepared.experiment.identification
    augmented = augmented_problem(prepared)
    noises = [_with_limit(noise, least) for noise in process_noises(augmented, settings, with_time_constants=True)]
    noises += [
        noise._replace(group=noise.group._replace(min_log_factor=min(log(_LEAST_SENSOR_FACTOR / noise.stated), 0.0)))
        for noise in _sensor_noises(augmented, settings)
        if noise.path[-1] in sensors
    ]
    groups, max_passes = _groups(noises), settings.smoother.max_passes
    trajectory = None if start is None else start.trajectory(augmented)
    likeliest = most_likely_noise(augmented.joint, groups, max_passes, on_pass, is_coarse=True, start=trajectory)
    if likeliest is None:
        return None
    return _tuning(experiment, noises, likeliest), Motion.of_trajectory(augmented, likeliest.trajectory)


def _groups(noises: Sequence[AdjustableNoise]) -> list[NoiseGroup]:
    """Return the groups, with lower limits so that the settings accept each level."""
    smallest = [min(log(_MARGIN * magnitude_of(noise.unit).smallest / noise.stated), 0.0) for noise in noises]
    return [
        noise.group._replace(min_log_factor=max(noise.group.min_log_factor, limit))
        for noise, limit in zip(noises, smallest, strict=True)
    ]


def _with_limit(noise: AdjustableNoise, least: ProcessNoise) -> AdjustableNoise:
    """Return a noise level with the lower limit of the process noise; other levels have none."""
    section, key, *axis = noise.path
    if section != "process_noise":
        return noise
    limit = getattr(least, key)
    limit = three(limit)[int(axis[0]) if axis else 0] if isinstance(limit, tuple) else limit
    return noise._replace(group=noise.group._replace(min_log_factor=min(log(limit / noise.stated), 0.0)))


def _tuning(experiment: RunSettings, noises: Sequence[AdjustableNoise], likeliest: NoiseFactors) -> Tuning:
    """Return the tuned levels, and the settings with them."""
    factors = zip(noises, likeliest.factor.tolist(), likeliest.low.tolist(), likeliest.high.tolist(), strict=True)
    tuned = [
        TunedNoise(
            ".".join(("identification", *noise.path)), noise.unit, noise.stated, *(noise.stated * f for f in each)
        )
        for noise, *each in factors
    ]
    for noise, row in zip(noises, tuned, strict=True):
        experiment = _changed(experiment, ("identification", *noise.path), float(f"{row.worth_stating:.3g}"))
    experiment = _changed(experiment, ("identification", "noise"), "stated")
    if experiment.identification.smoother.answer == "automatic":
        # With process noise the joint estimate of coefficients and trajectory is biased.
        experiment = _changed(experiment, ("identification", "smoother", "answer"), "marginal")
    return Tuning(tuple(tuned), likeliest.log_likelihood, likeliest.gain, likeliest.converged, experiment)


def choose_disturbance(
    prepared: PreparedData, with_sensors: bool = False, on_progress: OnProgress = lambda progress: None
) -> tuple[Tuning, Motion]:
    """Tune without and with a disturbance as a state, and return the better one by the Bayesian information criterion.

    The disturbance is that of the settings, even if it is not among their `biases`; without a size there, one for each
    axis that is equivalent to the white process noise. Parameters and errors are those of `tune_noise`.
    """
    experiment, asked = prepared.experiment, prepared.experiment.identification
    others = tuple(bias for bias in asked.estimate.biases if bias != BiasName.DISTURBANCE)
    first = tune_noise(prepared.with_settings(experiment.with_estimate(biases=others)), with_sensors, on_progress)
    without = first[0]
    stated = asked.estimate.disturbance
    disturbance = stated if stated.blocks() else disturbance_like_noise(without.experiment)
    biases = (*others, BiasName.DISTURBANCE)
    having = prepared.with_settings(experiment.with_estimate(biases=biases, disturbance=disturbance))

    def on_second(progress: TuningProgress) -> None:
        # Interrupted now, the finished tuning without a disturbance is the best so far.
        on_progress(progress._replace(so_far=lambda: first))

    with_one, motion = tune_noise(having, with_sensors, on_second, with_time_constants=True)
    segments = augmented_problem(having).joint.segments
    measured = sum(int(np.isfinite(timeline.measurement).sum()) for segment in segments for timeline in segment)
    numbers = len(with_one.noises) - len(without.noises)
    gain = with_one.log_likelihood - without.log_likelihood
    choice = DisturbanceChoice(gain, numbers, 0.5 * numbers * log(measured))
    kept, as_asked = (
        with_one if choice.is_kept else without,
        with_one if BiasName.DISTURBANCE in asked.estimate.biases else without,
    )
    over_stated = kept.log_likelihood - as_asked.log_likelihood + as_asked.gain
    return replace(kept, gain=over_stated, choice=choice), motion if choice.is_kept else first[1]


def disturbance_like_noise(experiment: RunSettings) -> EstimatedDisturbance:
    """Return a disturbance with the same power spectral density at low frequencies as the white process noise."""
    noise, force, moment = experiment.identification.process_noise, DisturbingForce(), DisturbingMoment()
    inertia = np.diagonal(mass_matrix(experiment.vehicle.known_parameters()))
    of_force, of_moment = (
        np.array(three(density)) * masses / np.sqrt(2.0 * np.array(three(of.time_constant)))
        for density, masses, of in ((noise.velocity, inertia[:3], force), (noise.rate, inertia[3:], moment))
    )
    return EstimatedDisturbance(
        force=force.model_copy(update={"standard_deviation": tuple(of_force.tolist())}),
        moment=moment.model_copy(update={"standard_deviation": tuple(of_moment.tolist())}),
    )


def process_noises(
    augmented: AugmentedProblem, settings: Identification, with_time_constants: bool = False
) -> Iterator[AdjustableNoise]:
    """Yield the noise that drives moving states and, if asked, the time constants of disturbances."""
    layout, noise = augmented.layout, settings.process_noise

    def adjustable(path: tuple[str, ...], of: Settings, rows: slice) -> AdjustableNoise:
        return AdjustableNoise(path, _unit(of, path[-1]), getattr(of, path[-1]), NoiseGroup(_rows(rows)))

    first = layout.moving_rows_of("motion").start
    for place, key in enumerate(("velocity", "rate", "attitude")):
        rows = [(first + 3 * place + axis,) for axis in range(3)]
        yield from _per_axis(("process_noise", key), noise, rows)
    for state in FURTHER_STATES:
        if layout.row(state.quantity.symbol) is not None:
            yield adjustable(("process_noise", state.name), noise, layout.moving_rows_of(state.name))
    for bias in dict.fromkeys(settings.estimate.biases):
        of_bias = getattr(settings.estimate, bias.value)
        if bias == BiasName.DISTURBANCE:
            yield from _disturbances(augmented, settings, with_time_constants)
            continue
        for block in of_bias.blocks():
            if block.walk > 0.0:
                yield adjustable(
                    ("estimate", bias.value, f"{block.prefix}walk"), of_bias, layout.moving_rows_of(block.name)
                )


def _disturbances(
    augmented: AugmentedProblem, settings: Identification, with_time_constants: bool
) -> Iterator[AdjustableNoise]:
    """Yield standard deviations and time constants of disturbances, common to three axes or one for each."""
    layout, constants = augmented.layout, augmented.process.constants
    shortest = STEPS_PER_TIME_CONSTANT * max(settings.integration_step, shortest_interval(augmented.measuring))
    place = {
        row: place_of_fading_rate(constants, axis)
        for axis, quantity in enumerate(DISTURBANCE)
        for row in _rows(layout.moving_rows_of(quantity.symbol))
    }
    for name, quantities in (("force", DISTURBANCE[:3]), ("moment", DISTURBANCE[3:])):
        of, path = getattr(settings.estimate.disturbance, name), ("estimate", "disturbance", name)
        rows = [_rows(layout.moving_rows_of(quantity.symbol)) for quantity in quantities]
        for size in _per_axis((*path, "standard_deviation"), of, rows):
            yield size._replace(group=size.group._replace(is_stationary=True))
        for constant in _per_axis((*path, "time_constant"), of, rows) if with_time_constants else ():
            rates = tuple(place[row] for row in constant.group.moving)
            least = min(log(_MARGIN * shortest / constant.stated), 0.0)
            yield constant._replace(group=constant.group._replace(rates=rates, min_log_factor=least))


def _rows(rows: slice) -> tuple[int, ...]:
    return tuple(range(rows.start, rows.stop))


def _per_axis(path: tuple[str, ...], of: Settings, rows: Sequence[tuple[int, ...]]) -> Iterator[AdjustableNoise]:
    """Yield noise along three axes, one level for all or one for each; `rows` are the moving states of each axis."""
    sizes: tuple[float, ...] = getattr(of, path[-1])
    axes = [((), sum(rows, ()))] if len(sizes) == 1 else [((str(axis),), own) for axis, own in enumerate(rows)]
    for size, (index, moving) in zip(sizes, axes, strict=True):
        if moving:
            yield AdjustableNoise((*path, *index), _unit(of, path[-1]), size, NoiseGroup(moving))


def _unit(settings: Settings, key: str) -> str:
    """Return the unit of a number in the settings."""
    return next(item.unit for item in type(settings).model_fields[key].metadata if isinstance(item, Unit))


def _sensor_noises(augmented: AugmentedProblem, settings: Identification) -> Iterator[AdjustableNoise]:
    for number, name in enumerate(augmented.measuring):
        stated = settings.measurement_noise.get(name, 1.0)
        yield AdjustableNoise(("measurement_noise", name), "1", stated, NoiseGroup(sensor=number))


def _changed(settings: SettingsClass, path: tuple[str, ...], value: float | str) -> SettingsClass:
    """Return the settings with another value at a path."""
    key, *rest = path
    old = getattr(settings, key)
    if isinstance(old, dict):
        new = {**old, rest[0]: value}
    elif isinstance(old, tuple):
        index = int(rest[0]) if rest else 0
        new = (*old[:index], value, *old[index + 1 :])
    else:
        new = _changed(old, tuple(rest), value) if rest else value
    return settings.model_copy(update={key: new})
