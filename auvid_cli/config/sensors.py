"""Settings of the sensors and of the magnetic field of the earth."""

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.settings import Lever, Settings
from auvid_cli.config.units import Amount, Unit, check_amount, parse_components
from auvid_cli.vehicle.parameters import SENSORS

PerComponent = tuple[float, ...]
Probability = Annotated[float, Field(ge=0, lt=1)]


class EarthField(Settings):
    """Magnetic field of the earth at the place of the run."""

    strength: Annotated[float, Amount("T"), Field(gt=0, description="strength of the earth's field, 25 to 65 uT")]
    declination: Annotated[float, Unit("rad"), Field(description="magnetic from true north, positive to the east")]
    dip: Annotated[float, Unit("rad"), Field(gt=-np.pi / 2, lt=np.pi / 2, description="angle below the horizontal")]

    @property
    def earth_field(self) -> tuple[float, float, float]:
        """Return the field, north, east and down, T."""
        level = self.strength * np.cos(self.dip)
        north, east = level * np.cos(self.declination), level * np.sin(self.declination)
        return float(north), float(east), float(self.strength * np.sin(self.dip))


class SensorSettings(Settings):
    """One sensor. A value per component is one number for all components or a list of one each."""

    sensor: ClassVar[str]

    def __init_subclass__(cls, sensor: str, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.sensor = sensor

    rate: Annotated[float, Amount("Hz"), Field(gt=0, le=1e4, description="samples per second")]
    start: Annotated[float, Amount("s"), Field(ge=0, le=1e6, description="time of the first sample")] = 0.0
    noise: Annotated[PerComponent, Field(description="standard deviation of the noise")] = ()
    range: Annotated[PerComponent, Field(description="catalogue accuracy +-range, three standard deviations")] = ()
    bias: Annotated[PerComponent, Field(description="constant bias")] = (0.0,)
    bias_spread: Annotated[PerComponent, Field(description="standard deviation of a random bias per seed")] = (0.0,)
    drift: Annotated[PerComponent, Field(description="random walk of the bias, per square root of a second")] = (0.0,)
    coloured_share: Annotated[float, Field(ge=0, le=1, description="Gauss-Markov share of the noise variance")] = 0.0
    coloured_time_constant: Annotated[
        float,
        Amount("s"),
        Field(gt=0, description="correlation time of that process: its autocorrelation falls to 1/e in this time"),
    ] = 1.0
    vibration: Annotated[PerComponent, Field(description="amplitude of a sine with a phase drawn per seed")] = (0.0,)
    vibration_frequency: Annotated[float, Amount("Hz"), Field(gt=0, description="frequency of that sine")] = 20.0
    quantisation: Annotated[PerComponent, Field(description="step of the output; 0 for none")] = (0.0,)
    dropout_probability: Annotated[Probability, Field(description="share of lost samples")] = 0.0
    outlier_probability: Annotated[Probability, Field(description="share of outliers")] = 0.0
    outlier_size: Annotated[PerComponent, Field(description="standard deviation of an outlier's error")] = (0.0,)
    delay: Annotated[
        float,
        Unit("s"),
        Field(ge=-1e3, le=1e3, description="time stamp minus time of measurement; negative: stamped too early"),
    ] = 0.0
    delay_spread: Annotated[
        float,
        Amount("s"),
        Field(ge=0, le=1e3, description="standard deviation of a further delay (clock offset), drawn per seed"),
    ] = 0.0
    standard_deviation: Annotated[
        PerComponent, Field(description="standard deviation for filters; default: noise")
    ] = ()

    @field_validator(
        *("noise", "range", "bias", "bias_spread", "drift", "vibration", "quantisation", "outlier_size"),
        "standard_deviation",
        mode="before",
    )
    @classmethod
    def _per_component(cls, value: Any, info: ValidationInfo) -> PerComponent:
        if value is None:
            return ()
        unit, width = cls._unit_and_width()
        if info.field_name == "bias":
            return parse_components(value, unit, width)
        values = parse_components(value, f"{unit}/s^0.5" if info.field_name == "drift" else unit, width, check_amount)
        if any(value < 0.0 for value in values):
            raise ValueError("expected values of 0 or more")
        if info.field_name == "standard_deviation" and not all(values):
            raise ValueError("expected values greater than 0")
        return values

    @model_validator(mode="after")
    def _noise_or_range(self) -> "SensorSettings":
        if bool(self.noise) == bool(self.range):
            raise ValueError("expected exactly one of 'noise' (standard deviation) and 'range' (three of these)")
        return self

    def noise_standard_deviation(self) -> PerComponent:
        """Return the standard deviation of the noise of each component, SI."""
        return self._all(self.noise or tuple(value / 3.0 for value in self.range))

    def stated_standard_deviation(self) -> PerComponent:
        """Return the standard deviations that filters assume for each component, SI."""
        return self._all(self.standard_deviation) if self.standard_deviation else self.noise_standard_deviation()

    def _all(self, values: PerComponent) -> PerComponent:
        _, width = self._unit_and_width()
        return values if len(values) == width else values * width

    @classmethod
    def _unit_and_width(cls) -> tuple[str, int]:
        quantities = SENSORS[cls.sensor]
        return quantities[0].unit, len(quantities)


class Gyroscope(SensorSettings, sensor="gyroscope"):
    """Body rates."""


class Accelerometer(SensorSettings, sensor="accelerometer"):
    """Specific force at the position of the sensor."""

    position: Annotated[
        Lever, Field(description="[forward, starboard, down] from the origin; used by estimators, not by an AHRS")
    ] = (0.0, 0.0, 0.0)
    scale_error: Annotated[float, Field(gt=-1, le=10, description="scale error; 0.01 means 1 % too large")] = 0.0


class Magnetometer(SensorSettings, sensor="magnetometer"):
    """Heading."""


class MagneticField(EarthField, SensorSettings, sensor="magnetic_field"):
    """Magnetic field along three axes."""


class Dvl(SensorSettings, sensor="dvl"):
    """Velocity over ground in body axes."""

    scale_error: Annotated[
        float,
        Field(
            gt=-1,
            le=10,
            description="scale error of all components, from a wrong speed of sound; 0.01 means 1 % too fast",
        ),
    ] = 0.0
    mounting_yaw: Annotated[float, Unit("rad"), Field(description="mounting yaw, positive to starboard")] = 0.0
    arm: Annotated[
        Lever, Field(description="[forward, starboard, down] from the vehicle's origin; unknown to estimators")
    ] = (0.0, 0.0, 0.0)


class Depth(SensorSettings, sensor="depth"):
    """Depth below the surface."""


class AhrsSettings(Settings):
    """Tuning of the AHRS, and the standard deviation that filters assume for its attitude."""

    standard_deviation: Annotated[
        float,
        Amount("rad"),
        Field(
            gt=0,
            description="standard deviation that filters assume; above the scatter because errors are autocorrelated",
        ),
    ] = 0.017453292519943295
    manoeuvre_acceleration: Annotated[
        float,
        Amount("m/s^2/Hz^0.5"),
        Field(gt=0, description="density of the vehicle's own acceleration, which an AHRS cannot tell from tilt"),
    ] = 0.1
    gyro_bias: Annotated[
        float, Amount("rad/s"), Field(ge=0, description="prior standard deviation of the gyro bias")
    ] = 0.0


class Attitude(SensorSettings, sensor="attitude"):
    """Roll, pitch and yaw: computed by an AHRS from the other sensors, or measured directly.

    Noise and faults apply to the direct source; the errors of an AHRS follow from those of its sensors.
    """

    source: Annotated[Literal["ahrs", "direct"], Field(description="AHRS, or true angles plus noise")] = "ahrs"
    rate: Annotated[float, Amount("Hz"), Field(gt=0, le=1e4, description="samples per second")] = 100.0
    ahrs: AhrsSettings = AhrsSettings()

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_source_and_add_noise(cls, data: Any) -> Any:
        if isinstance(data, str):
            data = {"source": data}
        if isinstance(data, dict) and not data.keys() & {"noise", "range"}:
            data = {**data, "noise": "0.1 deg"}
        return data

    def stated_standard_deviation(self) -> PerComponent:
        """Return the standard deviations that filters assume for each component, rad."""
        return (self.ahrs.standard_deviation,) * 3 if self.source == "ahrs" else super().stated_standard_deviation()


class AhrsSensors(NamedTuple):
    """An AHRS and its sensors, except the DVL, whose noise it neglects."""

    attitude: Attitude
    gyroscope: Gyroscope
    accelerometer: Accelerometer
    magnetometer: Magnetometer


class SensorSuite(Settings):
    """A sensor file; an AHRS needs gyroscope, accelerometer, magnetometer and DVL."""

    name: Annotated[str, Field(description="name of the sensors")] = ""
    gyroscope: Gyroscope | None = None
    accelerometer: Accelerometer | None = None
    magnetometer: Magnetometer | None = None
    dvl: Dvl | None = None
    attitude: Attitude | None = None
    magnetic_field: MagneticField | None = None
    depth: Depth | None = None

    @model_validator(mode="after")
    def _at_least_one(self) -> "SensorSuite":
        if not self.given():
            raise ValueError(f"expected at least one sensor of {', '.join(SENSORS)}")
        return self

    @model_validator(mode="after")
    def _sensors_of_ahrs(self) -> "SensorSuite":
        needed = ("gyroscope", "accelerometer", "magnetometer", "dvl")
        missing = [name for name in needed if getattr(self, name) is None]
        if self.has_ahrs and missing:
            raise ValueError(
                f"an AHRS needs {', '.join(needed)}; missing: {', '.join(missing)}; add them, or set "
                "attitude: {source: direct}"
            )
        return self

    @property
    def has_ahrs(self) -> bool:
        """Whether an AHRS computes the attitude."""
        return self.attitude is not None and self.attitude.source == "ahrs"

    def ahrs(self) -> AhrsSensors | None:
        """Return the AHRS with its sensors; None if the attitude is measured directly, or not at all."""
        attitude, gyroscope, accelerometer = self.attitude, self.gyroscope, self.accelerometer
        if not (self.has_ahrs and attitude and gyroscope and accelerometer and self.magnetometer):
            return None
        return AhrsSensors(attitude, gyroscope, accelerometer, self.magnetometer)

    def given(self) -> dict[str, SensorSettings]:
        """Return the given sensors by name."""
        return {name: settings for name, settings in self if isinstance(settings, SensorSettings)}
