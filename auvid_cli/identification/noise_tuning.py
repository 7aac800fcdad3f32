"""Process and measurement noise of a dataset, as its innovations make it most likely."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, TypeVar

from auvid_cli.config.augmented_states import BiasName, EstimatedDisturbance
from auvid_cli.config.experiment import Identification
from auvid_cli.config.moving_states import FURTHER_STATES
from auvid_cli.config.quantity import Unit
from auvid_cli.config.settings import Settings
from auvid_cli.data.tuning import TunedNoise, Tuning
from auvid_cli.errors import DataError
from auvid_cli.filters.noise_likelihood import most_likely_noise
from auvid_cli.filters.noise_scores import NoiseGroup
from auvid_cli.identification.augmented import AugmentedProblem, augmented_problem
from auvid_cli.identification.prepared_data import PreparedData
from auvid_cli.identification.state_layout import StateLayout
from auvid_cli.vehicle.parameters import DISTURBANCE

SettingsClass = TypeVar("SettingsClass", bound=Settings)


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
    prepared: PreparedData, with_sensors: bool = False, on_evaluation: Callable[[], None] = lambda: None
) -> Tuning:
    """Find the noise that makes the innovations of a smoother's filter most likely; no truth is looked at.

    Parameters
    ----------
    prepared : PreparedData
    with_sensors : bool
        Whether the standard deviations of the sensors are found along, and not as they are stated.
    on_evaluation : callable
        Called before each pass through the data; what it raises ends the search.

    Raises
    ------
    ConfigError, DataError
        As `augmented_problem`.
    DataError
        If the data cannot be followed with the noise that is stated.
    """
    experiment, settings = prepared.experiment, prepared.experiment.identification
    augmented = augmented_problem(prepared)
    noises = [*process_noises(augmented, settings), *(_sensor_noises(augmented, settings) if with_sensors else ())]
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
    return Tuning(tuple(tuned), likeliest.gain, likeliest.converged, experiment)


def process_noises(augmented: AugmentedProblem, settings: Identification) -> Iterator[AdjustableNoise]:
    """Yield the densities that drive moving states, by the settings that they have."""
    layout, noise = augmented.layout, settings.process_noise

    def adjustable(path: tuple[str, ...], of: Settings, rows: slice) -> AdjustableNoise:
        moving = tuple(range(rows.start, rows.stop))
        return AdjustableNoise(path, _unit(of, path[-1]), getattr(of, path[-1]), NoiseGroup(moving))

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
            yield from _disturbances(layout, of_bias)
            continue
        for block in of_bias.blocks():
            if block.walk > 0.0:
                own = "walk" if "walk" in type(of_bias).model_fields else f"{block.name.partition('_')[2]}_walk"
                yield adjustable(("estimate", bias.value, own), of_bias, layout.moving_rows_of(block.name))


def _disturbances(layout: StateLayout, settings: EstimatedDisturbance) -> Iterator[AdjustableNoise]:
    """Yield the sizes of what disturbs the motion: one for all three axes, or those of a list one by one."""
    for name, quantities in (("force", DISTURBANCE[:3]), ("moment", DISTURBANCE[3:])):
        of_name, path = getattr(settings, name), ("estimate", "disturbance", name, "standard_deviation")
        slices = [layout.moving_rows_of(quantity.symbol) for quantity in quantities]
        yield from _per_axis(path, of_name, [tuple(range(place.start, place.stop)) for place in slices])


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
