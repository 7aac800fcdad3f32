"""Settings of a manoeuvre: commands, autopilot, limits of the fins, and the envelope of a designed run."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from auvid_cli.config.extra_states import Disturbance
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Amount, Unit
from auvid_cli.vehicle.coefficients import CoefficientSet

_Length = Annotated[float, Amount("m"), Field(gt=0)]
_Inclination = Annotated[float, Amount("rad"), Field(gt=0, lt=1.48)]
Seconds = Annotated[float, Amount("s"), Field(gt=0, le=1e6)]
Pause = Annotated[float, Amount("s"), Field(ge=0, le=1e6)]
Radians = Annotated[float, Unit("rad")]
# Roll and heading are undefined at +-90 deg.
Pitch = Annotated[float, Unit("rad"), Field(gt=-1.57, lt=1.57)]
PositiveRadians = Annotated[float, Amount("rad"), Field(gt=0)]


class Envelope(Settings):
    """Limits of a designed run, valid for all trial vehicles; each key is an option of `auvid design`."""

    box: Annotated[_Length, Field(description="largest extent of the track, north and east")] = 200.0
    depth: Annotated[_Length, Field(description="largest difference in depth")] = 40.0
    pitch: Annotated[_Inclination, Field(description="largest pitch angle, up or down")] = float(np.deg2rad(40.0))
    roll: Annotated[_Inclination, Field(description="largest roll angle, to either side")] = float(np.deg2rad(40.0))
    speed: Annotated[
        float | None,
        Amount("m/s"),
        Field(gt=0, description="lowest speed after the start; default: 0.4 times the cruising speed"),
    ] = None
    energy: Annotated[
        float | None,
        Amount("J"),
        Field(gt=0, description="largest work of the thrust, without losses; default: no limit"),
    ] = None


class Limits(Settings):
    """Largest commands of the autopilot. The dynamics of fins and thrust are set in `vehicle.actuators`."""

    fin_angle: Annotated[PositiveRadians, Field(lt=1.6, description="largest fin angle")] = 0.35
    fin_rate: Annotated[float, Amount("rad/s"), Field(gt=0, description="largest fin rate")] = 1.0
    surge_force: Annotated[float, Amount("N"), Field(gt=0, description="largest thrust, in either direction")] = 1e4


class FinTrim(Settings):
    """Offset between actual and recorded fin angles."""

    rudder: Annotated[Radians, Field(description="actual minus recorded angle")] = 0.0
    elevator: Annotated[Radians, Field(description="actual minus recorded angle")] = 0.0
    spread: Annotated[
        float, Amount("rad"), Field(ge=0, description="standard deviation of a random offset per seed")
    ] = 0.0


class Multisine(Settings):
    """Sum of equal sines at evenly spaced frequencies with Schroeder phases, scaled to its peak."""

    amplitude: Annotated[float, Field(ge=0, description="peak, in rad, N or N m depending on the channel")]
    lowest: Annotated[float, Amount("Hz"), Field(gt=0, description="lowest frequency")] = 0.02
    highest: Annotated[float, Amount("Hz"), Field(gt=0, description="highest frequency")] = 0.5
    lines: Annotated[int, Field(ge=1, le=1000, description="number of sines")] = 8
    phase: Annotated[Radians, Field(description="phase added to all sines, so that channels differ")] = 0.0

    @model_validator(mode="after")
    def _frequencies_in_order(self) -> "Multisine":
        if self.lowest > self.highest:
            raise ValueError(f"expected lowest ({self.lowest:g} Hz) not above highest ({self.highest:g} Hz)")
        return self


class FinMultisine(Multisine):
    """Multisine of a fin."""

    amplitude: Annotated[float, Amount("rad"), Field(ge=0, description="peak deflection")]


class ForceMultisine(Multisine):
    """Multisine of the thrust."""

    amplitude: Annotated[float, Amount("N"), Field(ge=0, description="peak force")]


class MomentMultisine(Multisine):
    """Multisine of the roll moment."""

    amplitude: Annotated[float, Amount("N*m"), Field(ge=0, description="peak moment")]


class TurnMultisine(Multisine):
    """Multisine of the propeller's revolutions."""

    amplitude: Annotated[float, Unit("turn/s"), Field(ge=0, description="peak revolutions")]


class Propeller(Settings):
    """Revolutions and voltage along a run, independent of the autopilot, for own terms of the vehicle.

    The surge force then has no part that balances the drag: only those of the speed loop and of the excitation.
    """

    revolutions: Annotated[float, Unit("turn/s"), Field(description="mean revolutions after the fade-in")]
    voltage: Annotated[float, Unit("V"), Field(description="voltage at the start")] = 0.0
    final_voltage: Annotated[float | None, Unit("V"), Field(description="voltage at the end; default: constant")] = None
    excitation: Annotated[TurnMultisine | None, Field(description="multisine added to the revolutions")] = None


class Excitation(Settings):
    """Excitation added to the autopilot's commands, for each channel."""

    fade_in: Annotated[Pause, Field(description="time in which excitation, turn rate and speed build up")] = 0.0
    orthogonal: Annotated[
        bool,
        Field(
            description="use other harmonics of the run's duration in each channel, so that channels are orthogonal "
            "and start and end at zero"
        ),
    ] = False
    rudder: FinMultisine | None = None
    elevator: FinMultisine | None = None
    surge_force: ForceMultisine | None = None
    roll_moment: MomentMultisine | None = None

    def channels(self) -> tuple[Multisine | None, ...]:
        """Return the multisine or None of each input, in the order of the inputs."""
        return self.rudder, self.elevator, self.surge_force, self.roll_moment


class Autopilot(Settings):
    """Control loops on the true motion, with gains scaled by the vehicle's length and speed."""

    speed: Annotated[bool, Field(description="whether thrust controls the speed; otherwise constant thrust")] = True
    vertical: Annotated[Literal["pitch", "depth", "none"], Field(description="controlled by the elevator")] = "pitch"
    horizontal: Annotated[Literal["turn_rate", "none"], Field(description="controlled by the rudder")] = "turn_rate"
    bandwidth: Annotated[float, Field(ge=1e-3, le=1e3, description="stiffness; 1 for a torpedo shape")] = 1.0


class DepthAutopilot(Autopilot):
    """Autopilot of level manoeuvres: the elevator controls the depth."""

    vertical: Annotated[Literal["pitch", "depth", "none"], Field(description="controlled by the elevator")] = "depth"


class LevelAutopilot(DepthAutopilot):
    """Autopilot of manoeuvres with a prescribed rudder: the elevator controls the depth, the rudder is free."""

    horizontal: Annotated[Literal["turn_rate", "none"], Field(description="controlled by the rudder")] = "none"


class NoAutopilot(Autopilot):
    """Autopilot of given inputs: all loops are off."""

    speed: Annotated[bool, Field(description="whether thrust controls the speed")] = False
    vertical: Annotated[Literal["pitch", "depth", "none"], Field(description="controlled by the elevator")] = "none"
    horizontal: Annotated[Literal["turn_rate", "none"], Field(description="controlled by the rudder")] = "none"


class ManoeuvreSettings(Settings):
    """Settings of all manoeuvres."""

    name: Annotated[str, Field(description="name of the manoeuvre")] = ""
    duration: Annotated[Seconds, Field(description="length of the run")]
    speed: Annotated[float, Amount("m/s"), Field(gt=0, le=100, description="speed to hold")]
    initial_speed: Annotated[
        float | None, Amount("m/s"), Field(ge=0, le=100, description="speed at the start; default: the speed to hold")
    ] = None
    current_north: Annotated[float, Unit("m/s"), Field(ge=-100, le=100, description="current to the north")] = 0.0
    current_east: Annotated[float, Unit("m/s"), Field(ge=-100, le=100, description="current to the east")] = 0.0
    initial_pitch: Annotated[Pitch, Field(description="pitch at the start")] = 0.0
    input_rate: Annotated[float, Amount("Hz"), Field(gt=0, le=1e4, description="rate at which inputs change")] = 100.0
    recorded_rate: Annotated[
        float | None,
        Amount("Hz"),
        Field(gt=0, le=1e4, description="rate at which inputs are recorded and held; null: all inputs are recorded"),
    ] = None
    limits: Limits = Limits()
    excitation: Excitation = Excitation()
    propeller: Annotated[Propeller | None, Field(description="revolutions and voltage, for own terms")] = None
    fin_trim: FinTrim = FinTrim()
    thrust_error: Annotated[
        float, Field(gt=-1, le=10, description="scale error of the recorded surge force; 0.1 means 10 % too large")
    ] = 0.0
    input_delay: Annotated[
        float, Amount("s"), Field(ge=0, le=10, description="time from a recorded input until it acts")
    ] = 0.0
    disturbance: Disturbance = Disturbance()

    def missing_propulsion(self, coefficients: CoefficientSet) -> str:
        """Return an error message if terms need revolutions or voltage that the manoeuvre lacks; otherwise ""."""
        terms = coefficients.of_propulsion
        if self.propeller is not None or not terms:
            return ""
        return (
            f"no revolutions or voltage for the vehicle's terms {', '.join(term.symbol for term in terms)}; set for "
            "example manoeuvre.propeller={revolutions: 20 turn/s, voltage: 24 V}, or remove these terms (vehicle.terms)"
        )

    @model_validator(mode="after")
    def _minimum_duration(self) -> "ManoeuvreSettings":
        if self.duration < 1.0 or self.duration * self.input_rate < 2.0:
            raise ValueError("expected a duration of at least 1 s and two periods of the input rate")
        return self

    @model_validator(mode="after")
    def _band_for_orthogonal_sines(self) -> "ManoeuvreSettings":
        if self.excitation.orthogonal:
            given = [channel for channel in self.excitation.channels() if channel is not None]
            # The narrowest band that always contains a harmonic of each channel.
            min_band = len(given) / self.duration
            if any(channel.highest - channel.lowest < min_band for channel in given):
                raise ValueError(
                    f"{len(given)} orthogonal multisines in {self.duration:g} s: expected highest at least "
                    f"{min_band:.3g} Hz above lowest in each of them"
                )
        return self

    @model_validator(mode="after")
    def _recorded_rate_below_input_rate(self) -> "ManoeuvreSettings":
        if self.recorded_rate is not None and self.recorded_rate > self.input_rate:
            raise ValueError(
                f"expected recorded_rate ({self.recorded_rate:g} Hz) not above input_rate ({self.input_rate:g} Hz)"
            )
        return self


class Spiral(ManoeuvreSettings):
    """A descending helix."""

    type: Literal["spiral"]
    turn_rate: Annotated[float, Unit("rad/s"), Field(description="mean yaw rate, positive to starboard")]
    pitch: Annotated[Pitch, Field(description="mean pitch angle; negative: nose down")]
    autopilot: Autopilot = Autopilot()


class Zigzag(ManoeuvreSettings):
    """Rudder reversed each time the heading has changed by `heading` to one side."""

    type: Literal["zigzag"]
    rudder: Annotated[PositiveRadians, Field(description="rudder deflection")]
    heading: Annotated[PositiveRadians, Field(description="change of heading at which the rudder is reversed")]
    approach: Annotated[Pause, Field(description="straight run before the first rudder")] = 10.0
    autopilot: LevelAutopilot = LevelAutopilot()


class TurningCircle(ManoeuvreSettings):
    """Constant rudder after a straight run."""

    type: Literal["turning_circle"]
    rudder: Annotated[Radians, Field(description="rudder deflection")]
    approach: Annotated[Pause, Field(description="straight run before the rudder")] = 10.0
    autopilot: LevelAutopilot = LevelAutopilot()


class Lawnmower(ManoeuvreSettings):
    """Straight legs with half turns to alternating sides, the first to starboard."""

    type: Literal["lawnmower"]
    leg: Annotated[Seconds, Field(description="time on each straight leg")]
    turn_rate: Annotated[float, Amount("rad/s"), Field(gt=0, description="yaw rate in a turn")]
    autopilot: DepthAutopilot = DepthAutopilot()


class MultisineRun(ManoeuvreSettings):
    """A straight, level run with excitation."""

    type: Literal["multisine"]
    autopilot: Autopilot = Autopilot()


class Doublets(ManoeuvreSettings):
    """3-2-1-1 steps, first of the rudder, then of the elevator, repeated to the end."""

    type: Literal["doublets"]
    rudder: Annotated[float, Amount("rad"), Field(ge=0, description="rudder step")]
    elevator: Annotated[float, Amount("rad"), Field(ge=0, description="elevator step")]
    unit_time: Annotated[Seconds, Field(description="length of the '1'")]
    pause: Annotated[Pause, Field(description="rest between two sequences")] = 5.0
    autopilot: Autopilot = Autopilot()


class Recorded(ManoeuvreSettings):
    """Inputs from a file: CSV with columns time, rudder, elevator, surge_force, roll_moment in SI."""

    type: Literal["recorded"]
    file: Annotated[str, Field(description="CSV file, relative to the settings file that names it")]
    autopilot: NoAutopilot = NoAutopilot()


AnyManoeuvre = Annotated[
    Spiral | Zigzag | TurningCircle | Lawnmower | MultisineRun | Doublets | Recorded, Field(discriminator="type")
]
