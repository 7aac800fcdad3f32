"""Faults that a model or its data may have: identity, text, setting and remedy of each; and the score test of one.

The effect of each on the motion or on a sensor is in `auvid_cli.identification.faults`.
"""

import re
from enum import Enum
from typing import NamedTuple

from auvid_cli.vehicle.coefficients import term
from auvid_cli.vehicle.parameters import SENSORS


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


class FaultKind(Enum):
    """Kind of a fault.

    Attributes
    ----------
    text : str
        Text in files and tables, with `{}` for the component.
    setting : str
        Setting that estimates or states it; empty if there is none.
    remedy : str
        What to do about it, with `{setting}` and `{}`.
    components : tuple of str
        Its components, where they are a list.
    """

    GYROSCOPE_BIAS = ("bias of {}", _BIASES.format("gyro"), _ESTIMATE, _symbols("gyroscope"))
    ACCELEROMETER_BIAS = ("bias of {}", _BIASES.format("accelerometer"), _ESTIMATE, _symbols("accelerometer"))
    MAGNETIC_FIELD_BIAS = (
        "bias of {}",
        _BIASES.format("magnetic_field"),
        "estimate the field of the vehicle ({setting})",
        _symbols("magnetic_field"),
    )
    ACCELEROMETER_POSITION = (
        "position of the accelerometer, {}",
        "position",
        "state where it sits (`{setting}` in the sensor's settings or map)",
        ("x", "y", "z"),
    )
    SENSOR_DELAY = (
        "delay of the {}",
        "identification.delays",
        "subtract it from the times of the {} where they are recorded or imported, or state it ({setting}.{key})",
        ("gyroscope", "DVL", "attitude", "accelerometer", "magnetometer", "magnetic field", "depth"),
    )
    INPUT_DELAY = (
        "delay of the inputs",
        "identification.delays.inputs",
        "add it to the times of the inputs where they are recorded or imported, or state it ({setting}); fins that "
        "lag: vehicle.actuators.fins.time_constant",
    )
    DVL_SCALE = ("scale of the DVL", _BIASES.format("dvl"), _DVL)
    DVL_YAW = ("mounting yaw of the DVL", _BIASES.format("dvl"), _DVL)
    DVL_LEVER_ARM = (
        "lever arm of the DVL, {}",
        _BIASES.format("dvl_arm"),
        "move what the DVL measured to the origin, or estimate its arm ({setting})",
        ("x", "y", "z"),
    )
    CURRENT = ("current, {}", _BIASES.format("current"), "estimate the current ({setting})", ("north", "east"))
    CURRENT_DRIFT = ("drift of the current, {}", "identification.estimate.current.walk", _WALK, ("north", "east"))
    FIN_TRIM = (
        "trim of the {}",
        _BIASES.format("fin_trim"),
        "add it to the recorded angle, or estimate it ({setting})",
        ("rudder", "elevator"),
    )
    FIN_TRIM_DRIFT = (
        "drift of the trim of the {}",
        "identification.estimate.fin_trim.walk",
        _WALK,
        ("rudder", "elevator"),
    )
    THRUST_OFFSET = (
        "constant thrust",
        _BIASES.format("thrust"),
        "add it to the recorded thrust, or estimate its scale ({setting})",
    )
    THRUST_SCALE_DRIFT = ("drift of the scale of the thrust", "identification.estimate.thrust.walk", _WALK)
    MASS = ("mass", "vehicle.parameters.m", "check {setting}")
    BUOYANCY = ("buoyancy", _BIASES.format("ballast"), _BALLAST.format("B", "the excess buoyancy"))
    EXCESS_BUOYANCY_DRIFT = ("drift of the excess buoyancy", "identification.estimate.ballast.buoyancy_walk", _WALK)
    CENTRE_OF_GRAVITY = ("xG", _BIASES.format("ballast"), _BALLAST.format("xG", "the moment of trim"))
    TRIM_MOMENT_DRIFT = ("drift of the moment of trim", "identification.estimate.ballast.moment_walk", _WALK)
    ANTICIPATING_FIN = (
        "{} that answers pushes",
        "",
        "an autopilot moves this fin by more than the log has, so that it seems to do less: log what it steers by (its "
        "gyroscope), move fins by a plan, or hold the coefficients of this axis; or this fin alone is late",
        ("rudder", "elevator"),
    )
    MISSING_TERM = (
        "{}",
        "vehicle.terms",
        "the model lacks this term, and others make up for it: add it ({setting})",
        tuple(term(row, ("|v|", "r")).symbol for row in (1, 5)),
    )
    ANOTHER_MINIMUM = (
        "another minimum (cost {} higher)",
        "",
        "it is nearly as probable, so these data decide nothing: use more of them, or a narrower prior",
    )
    SEGMENT = (
        "the segment from {} s",
        "",
        "one model does not hold for all: look at what changed (current, trim, load), and identify the segments "
        "one by one (--use BEGIN:END)",
    )
    UNKNOWN = ("{}",)

    def __init__(self, text: str, setting: str = "", remedy: str = "", components: tuple[str, ...] = ()) -> None:
        self.text, self.setting, self.remedy, self.components = text, setting, remedy, components


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
        return self.kind.text.format(self.component)

    @property
    def remedy(self) -> str:
        """Return what to do about it; empty if unknown."""
        key = self.component.lower().replace(" ", "_")
        return self.kind.remedy.format(self.component, key=key, setting=self.kind.setting)

    @property
    def is_alternative(self) -> bool:
        """Say whether it is another estimate, from the same data or a part of them, instead of a fault."""
        return self.kind in (FaultKind.ANOTHER_MINIMUM, FaultKind.SEGMENT)

    @classmethod
    def parse(cls, text: str) -> "Fault":
        """Return the fault that a text stands for; of kind `UNKNOWN` if there is none."""
        for kind in FaultKind:
            found = re.fullmatch(re.escape(kind.text).replace(r"\{\}", "(.+)"), text)
            component = found[1] if found and found.groups() else ""
            if found and (not kind.components or component in kind.components):
                return cls(kind, component)
        return cls(FaultKind.UNKNOWN, text)


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
