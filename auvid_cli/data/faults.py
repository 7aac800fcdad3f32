"""Faults that a model or its data may have: identity, text, setting and remedy of each; and the score test of one.

How each acts on the motion or on a sensor is in `auvid_cli.identification.faults`.
"""

import re
from enum import StrEnum, auto
from typing import NamedTuple

from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.term_library import term


class FaultKind(StrEnum):
    """Kind of a fault; files and tables have its text, see `Fault`."""

    GYROSCOPE_BIAS = auto()
    ACCELEROMETER_BIAS = auto()
    MAGNETIC_FIELD_BIAS = auto()
    ACCELEROMETER_POSITION = auto()
    SENSOR_DELAY = auto()
    INPUT_DELAY = auto()
    DVL_SCALE = auto()
    DVL_YAW = auto()
    DVL_LEVER_ARM = auto()
    CURRENT = auto()
    CURRENT_DRIFT = auto()
    FIN_TRIM = auto()
    FIN_TRIM_DRIFT = auto()
    THRUST_OFFSET = auto()
    THRUST_SCALE_DRIFT = auto()
    MASS = auto()
    BUOYANCY = auto()
    EXCESS_BUOYANCY_DRIFT = auto()
    CENTRE_OF_GRAVITY = auto()
    TRIM_MOMENT_DRIFT = auto()
    ANTICIPATING_FIN = auto()
    MISSING_TERM = auto()
    ANOTHER_MINIMUM = auto()
    SEGMENT = auto()
    UNKNOWN = auto()


class _Description(NamedTuple):
    """Text, setting and remedy of a kind of faults, and its components where they are a list.

    In texts `{}` is the component, in remedies `{setting}` the setting.
    """

    text: str
    setting: str = ""
    remedy: str = ""
    components: tuple[str, ...] = ()


def _symbols(sensor: str) -> tuple[str, ...]:
    return tuple(quantity.symbol for quantity in SENSORS[sensor])


_BIASES = "identification.estimate.biases: [{}]"
_ESTIMATE = "estimate it ({setting})"
_WALK = (
    "it is estimated as one constant: let it walk ({setting}), or identify parts of the run one by one (--use "
    "BEGIN:END)"
)
_DVL = "estimate scale and mounting of the DVL ({setting})"
_BALLAST = "check vehicle.parameters.{}, or estimate {} ({{setting}})"

_DESCRIPTIONS = {
    FaultKind.GYROSCOPE_BIAS: _Description("bias of {}", _BIASES.format("gyro"), _ESTIMATE, _symbols("gyroscope")),
    FaultKind.ACCELEROMETER_BIAS: _Description(
        "bias of {}", _BIASES.format("accelerometer"), _ESTIMATE, _symbols("accelerometer")
    ),
    FaultKind.MAGNETIC_FIELD_BIAS: _Description(
        "bias of {}",
        _BIASES.format("magnetic_field"),
        "estimate the field of the vehicle ({setting})",
        _symbols("magnetic_field"),
    ),
    FaultKind.ACCELEROMETER_POSITION: _Description(
        "position of the accelerometer, {}",
        "position",
        "state where it sits (`{setting}` in the sensor's settings or map)",
        ("x", "y", "z"),
    ),
    FaultKind.SENSOR_DELAY: _Description(
        "delay of the {}",
        "identification.delays",
        "subtract it from the times of the {} where they are recorded or imported, or state it ({setting}.{key})",
        ("gyroscope", "DVL", "attitude", "accelerometer", "magnetometer", "magnetic field", "depth"),
    ),
    FaultKind.INPUT_DELAY: _Description(
        "delay of the inputs",
        "identification.delays.inputs",
        "add it to the times of the inputs where they are recorded or imported, or state it ({setting}); fins that "
        "lag: vehicle.actuators.fins.time_constant",
    ),
    FaultKind.DVL_SCALE: _Description("scale of the DVL", _BIASES.format("dvl"), _DVL),
    FaultKind.DVL_YAW: _Description("mounting yaw of the DVL", _BIASES.format("dvl"), _DVL),
    FaultKind.DVL_LEVER_ARM: _Description(
        "lever arm of the DVL, {}",
        _BIASES.format("dvl_arm"),
        "move what the DVL measured to the origin, or estimate its arm ({setting})",
        ("x", "y", "z"),
    ),
    FaultKind.CURRENT: _Description(
        "current, {}", _BIASES.format("current"), "estimate the current ({setting})", ("north", "east")
    ),
    FaultKind.CURRENT_DRIFT: _Description(
        "drift of the current, {}", "identification.estimate.current.walk", _WALK, ("north", "east")
    ),
    FaultKind.FIN_TRIM: _Description(
        "trim of the {}",
        _BIASES.format("fin_trim"),
        "add it to the recorded angle, or estimate it ({setting})",
        ("rudder", "elevator"),
    ),
    FaultKind.FIN_TRIM_DRIFT: _Description(
        "drift of the trim of the {}", "identification.estimate.fin_trim.walk", _WALK, ("rudder", "elevator")
    ),
    FaultKind.THRUST_OFFSET: _Description(
        "constant thrust",
        _BIASES.format("thrust"),
        "add it to the recorded thrust, or estimate its scale ({setting})",
    ),
    FaultKind.THRUST_SCALE_DRIFT: _Description(
        "drift of the scale of the thrust", "identification.estimate.thrust.walk", _WALK
    ),
    FaultKind.MASS: _Description("mass", "vehicle.parameters.m", "check {setting}"),
    FaultKind.BUOYANCY: _Description(
        "buoyancy", _BIASES.format("ballast"), _BALLAST.format("B", "the excess buoyancy")
    ),
    FaultKind.EXCESS_BUOYANCY_DRIFT: _Description(
        "drift of the excess buoyancy", "identification.estimate.ballast.buoyancy_walk", _WALK
    ),
    FaultKind.CENTRE_OF_GRAVITY: _Description(
        "xG", _BIASES.format("ballast"), _BALLAST.format("xG", "the moment of trim")
    ),
    FaultKind.TRIM_MOMENT_DRIFT: _Description(
        "drift of the moment of trim", "identification.estimate.ballast.moment_walk", _WALK
    ),
    FaultKind.ANTICIPATING_FIN: _Description(
        "{} that answers pushes",
        "",
        "an autopilot moves this fin by more than the log has, so that it seems to do less: log what it steers by (its "
        "gyroscope), move fins by a plan, or hold the coefficients of this axis; or this fin alone is late",
        ("rudder", "elevator"),
    ),
    FaultKind.MISSING_TERM: _Description(
        "{}",
        "vehicle.terms",
        "the model lacks this term, and others make up for it: add it ({setting})",
        tuple(term(row, ("|v|", "r")).symbol for row in (1, 5)),
    ),
    FaultKind.ANOTHER_MINIMUM: _Description(
        "another minimum (cost {} higher)",
        "",
        "it is nearly as probable, so these data decide nothing: use more of them, or a narrower prior",
    ),
    FaultKind.SEGMENT: _Description(
        "the segment from {} s",
        "",
        "one model does not hold for all: look at what changed (current, trim, load), and identify the segments "
        "one by one (--use BEGIN:END)",
    ),
    FaultKind.UNKNOWN: _Description("{}"),
}


class Fault(NamedTuple):
    """A fault; its string is the text of files and tables.

    Attributes
    ----------
    kind : FaultKind
    component : str
        Axis, symbol, sensor or fin. Of another minimum how much higher its cost is, of a segment its first time, s.
    """

    kind: FaultKind
    component: str = ""

    def __str__(self) -> str:
        return _DESCRIPTIONS[self.kind].text.format(self.component)

    @property
    def remedy(self) -> str:
        """Return what to do about it; empty if unknown."""
        key = self.component.lower().replace(" ", "_")
        return _DESCRIPTIONS[self.kind].remedy.format(self.component, key=key, setting=setting_of(self.kind))

    @property
    def is_alternative(self) -> bool:
        """Say whether it is another estimate, from the same data or a part of them, instead of a fault."""
        return self.kind in (FaultKind.ANOTHER_MINIMUM, FaultKind.SEGMENT)

    @classmethod
    def parse(cls, text: str) -> "Fault":
        """Return the fault that a text stands for; of kind `UNKNOWN` if there is none."""
        for kind, description in _DESCRIPTIONS.items():
            found = re.fullmatch(re.escape(description.text).replace(r"\{\}", "(.+)"), text)
            component = found[1] if found and found.groups() else ""
            if found and (not description.components or component in description.components):
                return cls(kind, component)
        return cls(FaultKind.UNKNOWN, text)


def setting_of(kind: FaultKind) -> str:
    """Return the setting that estimates or states a fault; empty if there is none."""
    return _DESCRIPTIONS[kind].setting


class FaultTest(NamedTuple):
    """Score test of a fault in the data of an estimate, or its difference from an alternative estimate.

    Attributes
    ----------
    fault : Fault
    unit : str
        SI unit of the size.
    size, standard_deviation : float
        Most likely size if there is no other fault; of an alternative estimate the difference of its coefficient.
    coefficient : str
        The coefficient that the fault biases most, or that differs most.
    susceptibility : float
        Bias of that coefficient by a fault of one standard deviation, which these data cannot show, in standard
        deviations of the coefficient.
    """

    fault: Fault
    unit: str
    size: float
    standard_deviation: float
    coefficient: str
    susceptibility: float

    @property
    def z(self) -> float:
        """Return the size as a multiple of its standard deviation."""
        return self.size / self.standard_deviation

    def __str__(self) -> str:
        name = f"{self.fault} has another {self.coefficient}" if self.fault.is_alternative else str(self.fault)
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{name} ({self.size:.3g} +- {self.standard_deviation:.2g}{unit}, {abs(self.z):.1f} sigma)"


class Cause(NamedTuple):
    """A likely cause of innovations, or of contradictions between signals, that the stated noise does not explain.

    Attributes
    ----------
    gain : float
        Increase of the log-likelihood if it is taken into account.
    name, remedy : str
    lasts : bool
        Whether it is an autocorrelated error of a sensor, or motion without explanation.
    """

    gain: float
    name: str
    remedy: str
    lasts: bool = False

    @property
    def name_with_gain(self) -> str:
        """Return the name and how much it gains."""
        return f"{self.name} (gains {self.gain:.0f} in log-likelihood)"

    def __str__(self) -> str:
        return f"{self.name_with_gain}: {self.remedy}"
