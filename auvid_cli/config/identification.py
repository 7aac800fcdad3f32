"""How to identify: which data, which coefficients and errors, which noise, by which filters."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.extra_states import AugmentedStates, BiasName, ErrorBlock
from auvid_cli.config.filters import (
    EkfSettings,
    OutputErrorSettings,
    Prior,
    SmootherSettings,
    UkfSettings,
    check_symbol,
    of_vehicle,
)
from auvid_cli.config.moving_states import InitialMotion, ProcessNoise
from auvid_cli.config.settings import SeparateSpans, Settings
from auvid_cli.config.units import Amount, Unit
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, FileError
from auvid_cli.vehicle.parameters import INERTIAL, SENSORS


class Use(Settings):
    """Which of the data are used; each segment starts with a motion of its own and the coefficients found so far."""

    spans: Annotated[
        SeparateSpans, Field(description="[begin, end], s, each; null: as far as there are data; empty: all")
    ] = ()
    least_speed: Annotated[
        float | None, Amount("m/s"), Field(gt=0, description="leave out what is slower by the DVL")
    ] = None
    longest_gap: Annotated[
        float | None, Amount("s"), Field(gt=0, description="a sensor that is silent for longer ends a segment")
    ] = None
    shortest: Annotated[float, Amount("s"), Field(ge=0, description="leave out segments that last less")] = 2.0


# So that what a disturbance forgets from one step, or measurement, to the next is little.
STEPS_PER_TIME_CONSTANT = 5


class InputSettings(Settings):
    """How inputs are between their samples."""

    between: Annotated[
        Literal["hold", "linear"], Field(description="hold: each until the next; linear: straight lines")
    ] = "hold"


# Key of the delay of the inputs, next to those of sensors.
INPUTS_DELAY = "inputs"


class Identification(Settings):
    """How coefficients are estimated from a dataset."""

    filters: Annotated[tuple[FilterName, ...], Field(min_length=1)] = (
        FilterName.SMOOTHER,
        FilterName.CKF,
        FilterName.TUKF,
    )
    coefficients: Annotated[
        Literal["all"] | tuple[str, ...],
        Field(
            description="'all', or a list; the others, and of all those with `estimate: false`, are held at the "
            "vehicle file's values"
        ),
    ] = "all"
    attitude_from: Annotated[
        Literal["ahrs", "inertial"],
        Field(description="the attitude record, or instead of it those of accelerometer and magnetometer themselves"),
    ] = "ahrs"
    use: Use = Use()
    inputs: InputSettings = InputSettings()
    delays: dict[str, Annotated[float, Amount("s")]] = Field(
        default_factory=dict,
        description="by sensor: how much later than they were taken its samples are stamped; `inputs`: how much later "
        "than stated they act",
    )
    estimate: AugmentedStates = AugmentedStates()
    prior: Prior = Prior()
    process_noise: ProcessNoise = ProcessNoise()
    noise: Annotated[
        Literal["stated", "estimate"],
        Field(description="process noise as stated here, or as the data make it most likely"),
    ] = "stated"
    measurement_noise: dict[str, Annotated[float, Field(ge=1e-6, le=1e6)]] = Field(
        default_factory=dict, description="by sensor: how many times the standard deviation that its record states"
    )
    initial_motion: InitialMotion = InitialMotion()
    integration_step: Annotated[
        float, Unit("s"), Field(ge=1e-5, le=1e3, description="longest step of the filter's integration")
    ] = 0.02
    keep_every: Annotated[
        int, Field(ge=1, strict=True, description="interval at which states are written; all innovations are written")
    ] = 1
    gate: Annotated[
        float | None,
        Field(
            ge=1e-3, le=1e6, description="reject a component whose innovation is more standard deviations; null: none"
        ),
    ] = None
    robust: Annotated[
        Literal["none", "huber"],
        Field(description="huber: smoother and output_error weigh down residuals beyond 2 standard deviations"),
    ] = "none"
    judge: Annotated[
        bool,
        Field(description="fit the smoother whether or not it is asked for, to judge the others by it"),
    ] = True
    ekf: EkfSettings = EkfSettings()
    ukf: UkfSettings = UkfSettings()
    smoother: SmootherSettings = SmootherSettings()
    output_error: OutputErrorSettings = OutputErrorSettings()

    @property
    def unused_sensors(self) -> tuple[str, ...]:
        """Return the sensors of motion that no estimator uses, whether the vehicle has them or not."""
        return ("attitude",) if self.attitude_from == "inertial" else INERTIAL

    @property
    def estimates_delays(self) -> bool:
        """Whether delays are estimated first."""
        return BiasName.DELAY in self.estimate.biases

    @property
    def is_marginal(self) -> bool:
        """Whether the smoother maximises the posterior of the coefficients with the trajectory integrated out."""
        if self.smoother.answer == "automatic":
            return self.noise == "estimate" or BiasName.DISTURBANCE in self.estimate.biases
        return self.smoother.answer == "marginal"

    @field_validator("measurement_noise", mode="after")
    @classmethod
    def _known_sensors(cls, value: dict[str, float]) -> dict[str, float]:
        for sensor in value:
            if sensor not in SENSORS:
                raise ValueError(f"unknown sensor {sensor!r}; there are {', '.join(SENSORS)}")
        return value

    @field_validator("coefficients", mode="before")
    @classmethod
    def _names_alone(cls, value: Any) -> Any:
        if isinstance(value, dict):
            raise ValueError("expected 'all', or a list of those to estimate; values stand in vehicle.coefficients")
        return value

    @field_validator("coefficients", mode="after")
    @classmethod
    def _known_coefficients(cls, value: Any, info: ValidationInfo) -> Any:
        if value == "all":
            return value
        if not value:
            raise ValueError("at least one coefficient, or 'all'")
        for symbol in value:
            check_symbol(symbol, of_vehicle(info))
        return tuple(symbol for symbol in of_vehicle(info).symbols if symbol in value)

    @model_validator(mode="after")
    def _biases_of_sensors_in_use(self) -> "Identification":
        for name in self.estimate.biases:
            if any(block.sensor in self.unused_sensors for block in self.estimate.blocks_of(name)):
                raise ValueError(
                    f"estimate.biases has {name}, which is not used with attitude_from: {self.attitude_from}; leave "
                    f"it out, or set attitude_from: {'ahrs' if self.attitude_from == 'inertial' else 'inertial'}"
                )
        return self

    @field_validator("delays")
    @classmethod
    def _delays_of_something(cls, value: dict[str, float]) -> dict[str, float]:
        known = (*SENSORS, INPUTS_DELAY)
        if unknown := [name for name in value if name not in known]:
            raise ValueError(f"{unknown[0]!r} is no sensor; expected one of {', '.join(known)}")
        return value

    @model_validator(mode="after")
    def _disturbance_of_a_size(self) -> "Identification":
        blocks = self._disturbances()
        if BiasName.DISTURBANCE in self.estimate.biases and not blocks:
            raise ValueError(
                "estimate.biases has disturbance, so estimate.disturbance must state the standard_deviation of a force "
                "or a moment, such as {force: {standard_deviation: 5 N, time_constant: 3 s}}"
            )
        shortest = STEPS_PER_TIME_CONSTANT * self.integration_step
        for block in blocks:
            if block.time_constant < shortest:
                raise ValueError(
                    f"estimate.disturbance: {block.name} has a time_constant of {block.time_constant:g} s; expected at "
                    f"least {shortest:g} s, {STEPS_PER_TIME_CONSTANT} times integration_step: what fades sooner is "
                    "white process noise (process_noise.velocity, process_noise.rate)"
                )
        return self

    def _disturbances(self) -> tuple[ErrorBlock, ...]:
        asked = BiasName.DISTURBANCE in self.estimate.biases
        return self.estimate.disturbance.blocks() if asked else ()

    def estimated(self, vehicle: VehicleSettings) -> tuple[str, ...]:
        """Return the symbols of a vehicle's coefficients to estimate, in the order of its table."""
        if self.coefficients != "all":
            return tuple(self.coefficients)
        left_out = vehicle.not_estimated()
        return tuple(symbol for symbol in vehicle.coefficient_set.symbols if symbol not in left_out)

    def fixed(self, vehicle: VehicleSettings) -> tuple[str, ...]:
        """Return the symbols of the others, which are held at the vehicle file's values."""
        estimated = self.estimated(vehicle)
        return tuple(symbol for symbol in vehicle.coefficient_set.symbols if symbol not in estimated)

    def default_filters(self) -> tuple[FilterName, ...]:
        """Return the filters that run where none is named: with a gate none of those that cannot have one."""
        return tuple(name for name in self.filters if self.gate is None or not name.in_one_batch) or self.filters

    def with_judge(self, filters: Sequence[FilterName]) -> tuple[FilterName, ...]:
        """Add the smoother, which judges the others; not where a gate is set, which it cannot have."""
        judges = self.judge and self.gate is None and JUDGE not in filters
        return (*dict.fromkeys(filters), *([JUDGE] if judges else []))

    def for_filter(self, name: FilterName | None) -> "Identification":
        """Return the settings with one filter or none, and those that concern others alone as they are by default."""
        fields = type(self).model_fields
        others = {other: fields[other].default for other in FilterName if other in fields and other != name}
        return self.model_copy(update={"filters": () if name is None else (name,), **others})

    def check_filters(self, filters: Sequence[FilterName]) -> None:
        """Raise ConfigError or FileError if filters cannot run with these settings, whatever the data."""
        if self.gate is not None and any(name.in_one_batch for name in filters):
            batch = next(name for name in filters if name.in_one_batch)
            raise ConfigError(
                f"identification.gate has no meaning for {batch}, which weighs all measurements at once; leave out "
                "the gate or the filter, or let it weigh down outliers (identification.robust=huber)"
            )
        if self._disturbances() and any(name.is_free_run_fit for name in filters):
            raise ConfigError(
                "identification.estimate.biases has disturbance, which output_error cannot follow: it fits motions "
                "without process noise; leave out one of the two, or take the smoother"
            )
        earlier = self.prior.from_estimate
        if earlier is not None and not Path(earlier).is_file():
            raise FileError(f"identification.prior.from_estimate: {earlier}: no such estimate file")


def _of_its_vehicle(value: Any, info: ValidationInfo) -> Any:
    """Validate how to identify beside the vehicle, whose own terms it may name."""
    vehicle = info.data.get("vehicle")
    if vehicle is None:
        # That is wrong itself, and what would be said of its coefficients might be as well.
        return Identification()
    settings = Identification.model_validate(value, context=vehicle.coefficient_set)
    if settings.prior.mean == "geometry" and vehicle.geometry is None:
        raise ValueError(
            f"prior.mean is geometry, and the vehicle {vehicle.name!r} states none: describe hull and fins in "
            "vehicle.geometry, or take mean: zero or vehicle"
        )
    estimated = settings.estimated(vehicle)
    if not estimated:
        raise ValueError("no coefficient is left to estimate: all of the vehicle's have `estimate: false`")
    for symbol in settings.output_error.bounds:
        if symbol not in estimated:
            raise ValueError(f"output_error.bounds names {symbol}, which is not among the coefficients to estimate")
    return settings


# Stands behind the vehicle.
IdentificationOfVehicle = Annotated[Identification, BeforeValidator(_of_its_vehicle)]
