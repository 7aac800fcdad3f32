"""Process and measurement noise of a dataset, as its innovations make it most likely."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import log
from typing import NamedTuple, TypeVar

import numpy as np

from auvid_cli.config.experiment import RunSettings
from auvid_cli.config.extra_states import BiasName, EstimatedDisturbance
from auvid_cli.config.identification import STEPS_PER_TIME_CONSTANT, Identification
from auvid_cli.config.moving_states import FURTHER_STATES, DisturbingForce, DisturbingMoment
from auvid_cli.config.settings import Settings, three
from auvid_cli.config.units import Unit
from auvid_cli.data.findings import DisturbanceChoice, TunedNoise, Tuning
from auvid_cli.errors import DataError
from auvid_cli.filters.noise_likelihood import most_likely_noise
from auvid_cli.filters.noise_scores import NoiseGroup
from auvid_cli.identification.compiled_layout import place_of_fading_rate
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.problem_setup import AugmentedProblem, augmented_problem, shortest_interval
from auvid_cli.vehicle.matrices import mass_matrix
from auvid_cli.vehicle.parameters import DISTURBANCE

SettingsClass = TypeVar("SettingsClass", bound=Settings)

# Times the shortest time constant that settings may state, so that one that is rounded may be stated.
_NOT_SHORTER = 1.01


class AdjustableNoise(NamedTuple):
    """Noise that may be tuned.

    Attributes
    ----------
    path : tuple of str
        Of its setting, within those of the identification; of one of a list its number at the end.
    unit : str
    stated : float
    group : NoiseGroup
    """

    path: tuple[str, ...]
    unit: str
    stated: float
    group: NoiseGroup


def tune_noise(
    prepared: PreparedData,
    with_sensors: bool = False,
    on_evaluation: Callable[[], None] = lambda: None,
    with_time_constants: bool = False,
) -> Tuning:
    """Find the noise that makes the innovations of a smoother's filter most likely; no truth is looked at.

    Parameters
    ----------
    prepared : PreparedData
    with_sensors : bool
        Whether the standard deviations of the sensors are found along, and not as they are stated.
    on_evaluation : callable
        Called before each pass through the data; what it raises ends the search.
    with_time_constants : bool
        Whether it is found how long a disturbance lasts, and not as it is stated: more than a log with few sensors
        tells.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If the data cannot be followed with the noise that is stated.
    """
    experiment, settings = prepared.experiment, prepared.experiment.identification
    augmented = augmented_problem(prepared)
    noises = [*process_noises(augmented, settings, with_time_constants)]
    if with_sensors:
        noises += _sensor_noises(augmented, settings)
    likeliest = most_likely_noise(
        augmented.joint, [noise.group for noise in noises], settings.smoother.max_passes, on_evaluation
    )
    if likeliest is None:
        raise DataError(
            "no trajectory follows these data with the noise that is stated: raise identification.process_noise to "
            "begin with, and look at signs and units (auvid inspect)"
        )
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
    if settings.smoother.answer == "automatic":
        # Process noise that data ask for is there, and biases the joint answer.
        experiment = _changed(experiment, ("identification", "smoother", "answer"), "marginal")
    return Tuning(tuple(tuned), likeliest.log_likelihood, likeliest.gain, likeliest.converged, experiment)


def choose_disturbance(
    prepared: PreparedData, with_sensors: bool = False, on_evaluation: Callable[[], None] = lambda: None
) -> Tuning:
    """Tune without a disturbance, then with one that lasts as long as data say, and keep it if that pays.

    Parameters are those of `tune_noise`, and so is what is raised. The disturbance is that of the settings, whether or
    not they ask for it; where they state no size, one of each axis, as white process noise has it.
    """
    asked = prepared.experiment.identification
    others = tuple(bias for bias in asked.estimate.biases if bias != BiasName.DISTURBANCE)
    without = tune_noise(_with_estimate(prepared, biases=others), with_sensors, on_evaluation)
    stated = asked.estimate.disturbance
    disturbance = stated if stated.blocks() else _as_of_white_noise(without.experiment)
    biases = (*others, BiasName.DISTURBANCE)
    having = _with_estimate(prepared, biases=biases, disturbance=disturbance)
    with_one = tune_noise(having, with_sensors, on_evaluation, with_time_constants=True)
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
    return replace(kept, gain=over_stated, choice=choice)


def _with_estimate(prepared: PreparedData, **changes: object) -> PreparedData:
    """Return the data with other blocks of states to be estimated."""
    experiment = prepared.experiment
    estimate = experiment.identification.estimate.model_copy(update=changes)
    identification = experiment.identification.model_copy(update={"estimate": estimate})
    return prepared.with_settings(experiment.model_copy(update={"identification": identification}))


def _as_of_white_noise(experiment: RunSettings) -> EstimatedDisturbance:
    """Return a disturbance that does in the long run what white process noise does."""
    noise, force, moment = experiment.identification.process_noise, DisturbingForce(), DisturbingMoment()
    inertia = np.diagonal(mass_matrix(experiment.vehicle.known_parameters()))
    of_force, of_moment = (
        np.array(three(density)) * own / np.sqrt(2.0 * np.array(three(of.time_constant)))
        for density, own, of in ((noise.velocity, inertia[:3], force), (noise.rate, inertia[3:], moment))
    )
    return EstimatedDisturbance(
        force=force.model_copy(update={"standard_deviation": tuple(of_force.tolist())}),
        moment=moment.model_copy(update={"standard_deviation": tuple(of_moment.tolist())}),
    )


def process_noises(
    augmented: AugmentedProblem, settings: Identification, with_time_constants: bool = False
) -> Iterator[AdjustableNoise]:
    """Yield what drives moving states and, if asked, how long what disturbs them lasts, by the settings they have."""
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
    """Yield how large what disturbs the motion is and how long it lasts, of all three axes or of those of a list."""
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
        yield from _per_axis((*path, "standard_deviation"), of, rows)
        for lasts in _per_axis((*path, "time_constant"), of, rows) if with_time_constants else ():
            rates = tuple(place[row] for row in lasts.group.moving)
            least = min(log(_NOT_SHORTER * shortest / lasts.stated), 0.0)
            yield lasts._replace(group=lasts.group._replace(rates=rates, min_log_factor=least))


def _rows(rows: slice) -> tuple[int, ...]:
    return tuple(range(rows.start, rows.stop))


def _per_axis(path: tuple[str, ...], of: Settings, rows: Sequence[tuple[int, ...]]) -> Iterator[AdjustableNoise]:
    """Yield noise along three axes, each of which drives some moving states: one for all, or those of a list."""
    sizes: tuple[float, ...] = getattr(of, path[-1])
    each = [((), sum(rows, ()))] if len(sizes) == 1 else [((str(axis),), own) for axis, own in enumerate(rows)]
    for size, (place, moving) in zip(sizes, each, strict=True):
        if moving:
            yield AdjustableNoise((*path, *place), _unit(of, path[-1]), size, NoiseGroup(moving))


def _unit(settings: Settings, key: str) -> str:
    """Return the unit that a setting states for a number."""
    return next(item.unit for item in type(settings).model_fields[key].metadata if isinstance(item, Unit))


def _sensor_noises(augmented: AugmentedProblem, settings: Identification) -> Iterator[AdjustableNoise]:
    for number, name in enumerate(augmented.measuring):
        stated = settings.measurement_noise.get(name, 1.0)
        yield AdjustableNoise(("measurement_noise", name), "1", stated, NoiseGroup(sensor=number))


def _changed(settings: SettingsClass, path: tuple[str, ...], value: float | str) -> SettingsClass:
    """Return the same settings with another value at a path."""
    key, *rest = path
    own = getattr(settings, key)
    if isinstance(own, dict):
        value_there = {**own, rest[0]: value}
    elif isinstance(own, tuple):
        place = int(rest[0]) if rest else 0
        value_there = (*own[:place], value, *own[place + 1 :])
    else:
        value_there = _changed(own, tuple(rest), value) if rest else value
    return settings.model_copy(update={key: value_there})
