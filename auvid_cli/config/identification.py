"""Settings of the identification: data, coefficients, extra states, noise, filters, and tolerances of known numbers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.coefficients import Prior, check_symbol, of_vehicle
from auvid_cli.config.enums import JUDGE, FilterName
from auvid_cli.config.extra_states import AugmentedStates, BiasName, ErrorBlock, InitialMotion, ProcessNoise
from auvid_cli.config.settings import SeparateSpans, Settings
from auvid_cli.config.units import Amount, Unit, check_size, parse_quantity
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.errors import ConfigError, FileError
from auvid_cli.vehicle.parameters import INERTIAL, SENSORS

_Share = Annotated[float, Unit("1"), Field(ge=0, le=10)]
_Length = Annotated[float, Amount("m"), Field(ge=0)]
_Angle = Annotated[float, Amount("rad"), Field(ge=0, le=1)]


class Tolerances(Settings):
    """Standard deviations of known quantities that have no `standard_deviation` of their own and are not estimated.

    They enter the total standard deviations. `usual` has the defaults; `none` has zeros: everything is known exactly.
    The documentation lists their sources on the page about ± and the judgement.
    """

    mass: Annotated[_Share, Field(description="of the mass, as a share of it")] = 0.005
    inertia: Annotated[_Share, Field(description="of each moment of inertia, as a share of it")] = 0.05
    added_mass: Annotated[_Share, Field(description="of each added mass, as a share of it")] = 0.1
    buoyancy: Annotated[_Share, Field(description="of buoyancy less weight, as a share of the buoyancy")] = 0.001
    centre_of_gravity: Annotated[_Length, Field(description="of zG")] = 0.001
    trim: Annotated[_Length, Field(description="of xG and yG, by which a floating vehicle is trimmed")] = 0.0001
    thrust: Annotated[_Share, Field(description="of the surge force, as a share of it")] = 0.05
    thrust_fade: Annotated[
        _Share, Field(description="of the fall of thrust from rest to the mean speed, as a share")
    ] = 0.1
    linear_damping: Annotated[
        _Share,
        Field(
            description="of drag and damping of pitch and yaw that do not grow with speed, as a share, at mean speed"
        ),
    ] = 0.1
    fins: Annotated[_Share, Field(description="of each fin angle, as a share of it")] = 0.02
    held_coefficients: Annotated[
        _Share, Field(description="of each coefficient that is not estimated, as a share of it")
    ] = 0.4
    dvl_scale: Annotated[_Share, Field(description="of the scale of the DVL")] = 0.002
    dvl_yaw: Annotated[_Angle, Field(description="of the mounting yaw of the DVL")] = 0.0034907
    dvl_position: Annotated[_Length, Field(description="of each coordinate of the DVL")] = 0.01
    gyroscope_scale: Annotated[_Share, Field(description="of the scale of each gyro")] = 0.002
    gyroscope_mounting: Annotated[_Angle, Field(description="of the mounting of the gyroscope about each axis")] = (
        0.0034907
    )
    ahrs: Annotated[_Angle, Field(description="of the constant errors of roll, pitch and heading of an AHRS")] = (
        0.0034907
    )
    accelerometer_position: Annotated[_Length, Field(description="of each coordinate of the accelerometer")] = 0.01
    delay: Annotated[float, Amount("s"), Field(ge=0, description="of each delay of gyroscope, DVL and inputs")] = 0.003

    @model_validator(mode="before")
    @classmethod
    def _accept_a_word(cls, data: Any) -> Any:
        if data == "usual":
            return {}
        if data == "none":
            return dict.fromkeys(cls.model_fields, 0.0)
        if isinstance(data, str):
            raise ValueError("expected usual, none, or standard deviations such as {inertia: 3 %, delay: 1 ms}")
        return data


# Smallest time constant of a disturbance, in integration steps: it must change little from one step to the next.
STEPS_PER_TIME_CONSTANT = 5
# Key of the delay of the inputs, next to those of sensors.
INPUTS_DELAY = "inputs"


class Use(Settings):
    """Selection of data; each segment starts from its own initial motion, with the coefficients found so far."""

    spans: Annotated[SeparateSpans, Field(description="spans [begin, end], s; null: open end; empty: all data")] = ()
    least_speed: Annotated[float | None, Amount("m/s"), Field(gt=0, description="lowest speed of the DVL to use")] = (
        None
    )
    longest_gap: Annotated[
        float | None, Amount("s"), Field(gt=0, description="a longer gap of a sensor ends the segment")
    ] = None
    shortest: Annotated[float, Amount("s"), Field(ge=0, description="length of the shortest segment to use")] = 2.0


class InputSettings(Settings):
    """Interpolation of the inputs."""

    between: Annotated[
        Literal["hold", "linear"], Field(description="between samples: hold (constant until the next sample) or linear")
    ] = "hold"


class EkfSettings(Settings):
    """Extended Kalman filter."""

    transition: Annotated[
        Literal["exact", "first_order"],
        Field(description="transition matrix: variational equation along the integration, or the paper's I + A dt"),
    ] = "exact"


class UkfSettings(Settings):
    """Scaled unscented transformation."""

    alpha: Annotated[float, Field(ge=1e-4, le=10, description="scaling of the points")] = 0.1
    beta: Annotated[float, Field(ge=0, le=100, description="weight of the central point; 2 suits a Gaussian")] = 2.0
    kappa: Annotated[float, Field(ge=0, le=1000, description="secondary scaling")] = 0.0

    @model_validator(mode="after")
    def _positive_definite_covariance(self) -> "UkfSettings":
        if self.beta < self.alpha**2:
            raise ValueError("beta must be at least alpha^2; otherwise the covariance can become indefinite")
        return self


class OutputErrorSettings(Settings):
    """Output-error method: fit of coefficients and initial motion, without process noise."""

    max_evaluations: Annotated[int, Field(ge=1, strict=True, description="largest number of simulations")] = 100
    use_prior: Annotated[bool, Field(strict=True, description="whether the fit includes the priors")] = False
    bounds: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="bounds [lowest, highest] of the estimate, by coefficient"
    )

    @field_validator("bounds", mode="before")
    @classmethod
    def _parse_bounds(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        units = of_vehicle(info).units
        parsed = {}
        for symbol, interval in value.items():
            check_symbol(symbol, of_vehicle(info))
            if not isinstance(interval, list | tuple) or len(interval) != 2:
                raise ValueError(f"the bounds of {symbol}: expected [lowest, highest]")
            low, high = (check_size(parse_quantity(bound, units[symbol]), units[symbol]) for bound in interval)
            if not low < high:
                raise ValueError(f"the bounds of {symbol}: the lowest must be less than the highest")
            parsed[symbol] = low, high
        return parsed


class SmootherSettings(Settings):
    """Smoother: the most probable trajectory and coefficients, with process noise."""

    max_passes: Annotated[int, Field(ge=1, strict=True, description="largest number of passes from each start")] = 50
    answer: Annotated[
        Literal["automatic", "joint", "marginal"],
        Field(
            description="estimate: joint (most probable coefficients and trajectory), marginal (most probable "
            "coefficients, with the trajectory integrated out), or automatic (marginal if a disturbance or the noise "
            "is estimated)"
        ),
    ] = "automatic"


class Identification(Settings):
    """Estimation of coefficients from a dataset."""

    filters: Annotated[tuple[FilterName, ...], Field(min_length=1, description="filters to run")] = (
        FilterName.SMOOTHER,
        FilterName.CKF,
        FilterName.TUKF,
    )
    coefficients: Annotated[
        Literal["all"] | tuple[str, ...],
        Field(
            description="'all' (except those with `estimate: false`), or a list; the other coefficients have the "
            "values of the vehicle file"
        ),
    ] = "all"
    attitude_from: Annotated[
        Literal["ahrs", "inertial"],
        Field(description="source of the attitude: its record, or the records of accelerometer and magnetometer"),
    ] = "ahrs"
    use: Use = Use()
    inputs: InputSettings = InputSettings()
    delays: dict[str, Annotated[float, Amount("s")]] = Field(
        default_factory=dict,
        description="known delays: of a sensor, time stamp minus time of measurement; of `inputs`, time from command "
        "to effect",
    )
    estimate: AugmentedStates = AugmentedStates()
    prior: Prior = Prior()
    process_noise: ProcessNoise = ProcessNoise()
    noise: Annotated[
        Literal["stated", "estimate"],
        Field(description="process noise: as stated in `process_noise`, or estimated by maximum likelihood"),
    ] = "stated"
    measurement_noise: dict[str, Annotated[float, Field(ge=1e-6, le=1e6)]] = Field(
        default_factory=dict, description="factor on the standard deviation of a sensor's record, by sensor"
    )
    tolerances: Tolerances = Tolerances()
    initial_motion: InitialMotion = InitialMotion()
    integration_step: Annotated[
        float, Unit("s"), Field(ge=1e-5, le=1e3, description="longest step of the integration")
    ] = 0.02
    keep_every: Annotated[int, Field(ge=1, strict=True, description="write every n-th state (and all innovations)")] = 1
    gate: Annotated[
        float | None,
        Field(
            ge=1e-3,
            le=1e6,
            description="gate in standard deviations of the innovation: components beyond it are rejected; null: none",
        ),
    ] = None
    robust: Annotated[
        Literal["none", "huber"],
        Field(description="huber: smoother and output_error give less weight to residuals beyond 2 sigma"),
    ] = "none"
    judge: Annotated[bool, Field(description="whether the smoother runs as the reference for other filters")] = True
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

    @field_validator("measurement_noise", "delays")
    @classmethod
    def _known_sensors(cls, value: dict[str, float], info: ValidationInfo) -> dict[str, float]:
        known = (*SENSORS, *([INPUTS_DELAY] if info.field_name == "delays" else []))
        if unknown := [name for name in value if name not in known]:
            raise ValueError(f"unknown sensor {unknown[0]!r}; expected one of {', '.join(known)}")
        return value

    @field_validator("coefficients", mode="before")
    @classmethod
    def _no_values(cls, value: Any) -> Any:
        if isinstance(value, dict):
            raise ValueError("expected 'all' or a list of names; values belong in vehicle.coefficients")
        return value

    @field_validator("coefficients", mode="after")
    @classmethod
    def _known_coefficients(cls, value: Any, info: ValidationInfo) -> Any:
        if value == "all":
            return value
        if not value:
            raise ValueError("expected at least one coefficient, or 'all'")
        for symbol in value:
            check_symbol(symbol, of_vehicle(info))
        return tuple(symbol for symbol in of_vehicle(info).symbols if symbol in value)

    @model_validator(mode="after")
    def _biases_of_used_sensors(self) -> "Identification":
        for name in self.estimate.biases:
            if any(block.sensor in self.unused_sensors for block in self.estimate.blocks_of(name)):
                raise ValueError(
                    f"estimate.biases has {name}, which is not used with attitude_from: {self.attitude_from}; leave "
                    f"it out, or set attitude_from: {'ahrs' if self.attitude_from == 'inertial' else 'inertial'}"
                )
        return self

    @model_validator(mode="after")
    def _slow_disturbance(self) -> "Identification":
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
                    f"least {shortest:g} s, {STEPS_PER_TIME_CONSTANT} times integration_step; model a faster "
                    "disturbance by white process noise (process_noise.velocity, process_noise.rate)"
                )
        return self

    def _disturbances(self) -> tuple[ErrorBlock, ...]:
        is_estimated = BiasName.DISTURBANCE in self.estimate.biases
        return self.estimate.disturbance.blocks() if is_estimated else ()

    def estimated(self, vehicle: VehicleSettings) -> tuple[str, ...]:
        """Return the symbols of a vehicle's coefficients to estimate, in the order of its table."""
        if self.coefficients != "all":
            return tuple(self.coefficients)
        excluded = vehicle.not_estimated()
        return tuple(symbol for symbol in vehicle.coefficient_set.symbols if symbol not in excluded)

    def fixed(self, vehicle: VehicleSettings) -> tuple[str, ...]:
        """Return the symbols of the other coefficients, which keep the vehicle file's values."""
        estimated = self.estimated(vehicle)
        return tuple(symbol for symbol in vehicle.coefficient_set.symbols if symbol not in estimated)

    def default_filters(self) -> tuple[FilterName, ...]:
        """Return the filters that run if the user names none: with a gate, only those that can have one."""
        return tuple(name for name in self.filters if self.gate is None or not name.in_one_batch) or self.filters

    def with_judge(self, filters: Sequence[FilterName]) -> tuple[FilterName, ...]:
        """Return the filters with the smoother added as the reference, unless a gate, which it cannot have, is set."""
        needs_judge = self.judge and self.gate is None and JUDGE not in filters
        return (*dict.fromkeys(filters), *([JUDGE] if needs_judge else []))

    def for_filter(self, name: FilterName | None) -> "Identification":
        """Return the settings with only this filter, or none; settings of other filters have their defaults."""
        fields = type(self).model_fields
        others = {other: fields[other].default for other in FilterName if other in fields and other != name}
        return self.model_copy(update={"filters": () if name is None else (name,), **others})

    def check_filters(self, filters: Sequence[FilterName]) -> None:
        """Raise ConfigError or FileError if filters cannot run with these settings, whatever the data."""
        if self.gate is not None and any(name.in_one_batch for name in filters):
            batch = next(name for name in filters if name.in_one_batch)
            raise ConfigError(
                f"identification.gate: not possible for {batch}, which fits all measurements at once; leave out the "
                "gate or the filter, or reduce the weight of outliers (identification.robust=huber)"
            )
        if self._disturbances() and any(name.is_free_run_fit for name in filters):
            raise ConfigError(
                "identification.estimate.biases: disturbance is not possible for output_error, which has no process "
                "noise; leave out one of the two, or use the smoother"
            )
        earlier = self.prior.from_estimate
        if earlier is not None and not Path(earlier).is_file():
            raise FileError(f"identification.prior.from_estimate: {earlier}: no such estimate file")


def _with_vehicle(value: Any, info: ValidationInfo) -> Any:
    """Validate the settings together with the vehicle, a field before them, whose own terms they may name."""
    vehicle = info.data.get("vehicle")
    if vehicle is None:
        # The vehicle is invalid, so its coefficients are unknown.
        return Identification()
    settings = Identification.model_validate(value, context=vehicle.coefficient_set)
    if settings.prior.mean == "geometry" and vehicle.geometry is None:
        raise ValueError(
            f"prior.mean is geometry, but the vehicle {vehicle.name!r} has none; describe hull and fins in "
            "vehicle.geometry, or use mean: zero or vehicle"
        )
    estimated = settings.estimated(vehicle)
    if not estimated:
        raise ValueError("no coefficient to estimate: all of the vehicle's have `estimate: false`")
    for symbol in settings.output_error.bounds:
        if symbol not in estimated:
            raise ValueError(f"output_error.bounds names {symbol}, which is not among the coefficients to estimate")
    return settings


IdentificationOfVehicle = Annotated[Identification, BeforeValidator(_with_vehicle)]
