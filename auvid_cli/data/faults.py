"""Possible faults of a model or its data, with text, setting and remedy, and the score test of a fault."""

import re
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.data.array_checks import check_finite, check_shapes
from auvid_cli.errors import InvalidDataError
from auvid_cli.text import degrees_for
from auvid_cli.vehicle.coefficients import term
from auvid_cli.vehicle.parameters import PARAMETER_SYMBOLS, SENSORS

_ROUNDING = 1e-9  # of a variance


def _symbols(sensor: str) -> tuple[str, ...]:
    return tuple(quantity.symbol for quantity in SENSORS[sensor])


# Significance beyond which a fault is needed to explain the data; chosen as in `auvid_cli.evaluation.judgement`.
LARGEST_FAULT = 3.5
# Row and factors of the terms that are tested.
TESTED_TERMS: tuple[tuple[int, tuple[str, ...]], ...] = (
    *((row, ("|v|", "r")) for row in (1, 5)),
    (0, ("u",)),
    (3, ("u", "p")),
    (4, ("q",)),
    (5, ("r",)),
)
# Words of version 0.2.0 and earlier, in files, and those of today.
_FORMER_TEXT = "that answers pushes", "reacting to disturbances"
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
        Setting that estimates or states it; may be empty.
    remedy : str
        Advice, with `{setting}` and `{}` for the component.
    components : tuple of str
        Valid components; empty if there are none or any.
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
        "state its position (`{setting}` in the sensor's settings or map)",
        ("x", "y", "z"),
    )
    ATTITUDE_BIAS = ("bias of {}", _BIASES.format("attitude"), _ESTIMATE, _symbols("attitude"))
    GYROSCOPE_SCALE = ("scale of {}", "", "calibrate the gyroscope", _symbols("gyroscope"))
    GYROSCOPE_MOUNTING = ("mounting of the gyroscope, {}", "", "check how the gyroscope is mounted", ("x", "y", "z"))
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
        "correct the DVL's velocities to the origin, or estimate its arm ({setting})",
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
    FIN_SCALE = ("scale of the {}", "", "calibrate the angle of the {}", ("rudder", "elevator"))
    THRUST_SCALE = (
        "scale of the thrust",
        _BIASES.format("thrust"),
        "check the thrust, or estimate its scale ({setting})",
    )
    THRUST_FADE = (
        "thrust that falls with speed",
        "",
        "the recorded thrust is that at rest: record the thrust at this speed",
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
    PARAMETER = (
        "{}",
        "vehicle.parameters",
        "check vehicle.parameters.{}",
        tuple(symbol for symbol in PARAMETER_SYMBOLS if symbol not in ("m", "B", "xG")),
    )
    TRIM_MOMENT_DRIFT = ("drift of the moment of trim", "identification.estimate.ballast.moment_walk", _WALK)
    ANTICIPATING_FIN = (
        "{} reacting to disturbances",
        "",
        "the autopilot reacted to disturbances that the log does not show, so that the fin seems to have less effect: "
        "leave the coefficients of this axis out of identification.coefficients, or estimate a disturbance "
        "(identification.estimate.biases); or the recorded angle of this fin is late",
        ("rudder", "elevator"),
    )
    MISSING_TERM = (
        "{}",
        "vehicle.terms",
        "the model lacks this term, and others compensate for it: add it ({setting})",
        tuple(term(row, factors).symbol for row, factors in TESTED_TERMS),
    )
    HELD_COEFFICIENT = (
        "held {}",
        "identification.coefficients",
        "these data contradict the held value: estimate the coefficient ({setting}), or correct its value",
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
        Axis, symbol, sensor or fin; increase of the cost of another minimum; first time of a segment, s.
    """

    kind: FaultKind
    component: str = ""

    def __str__(self) -> str:
        return self.kind.text.format(self.component)

    @property
    def remedy(self) -> str:
        """Return advice; empty if there is none."""
        key = self.component.lower().replace(" ", "_")
        return self.kind.remedy.format(self.component, key=key, setting=self.kind.setting)

    @property
    def parameter(self) -> str:
        """Return the symbol of the known parameter that is wrong; empty if it is none."""
        single = {FaultKind.MASS: "m", FaultKind.BUOYANCY: "B", FaultKind.CENTRE_OF_GRAVITY: "xG"}
        return self.component if self.kind is FaultKind.PARAMETER else single.get(self.kind, "")

    @property
    def is_alternative(self) -> bool:
        """Whether it is another estimate, from the same data or a part of them, instead of a fault."""
        return self.kind in (FaultKind.ANOTHER_MINIMUM, FaultKind.SEGMENT)

    @classmethod
    def parse(cls, text: str) -> "Fault":
        """Return the fault of a text; of kind `UNKNOWN` if no kind matches."""
        text = text.replace(*_FORMER_TEXT)
        for kind in FaultKind:
            found = re.fullmatch(re.escape(kind.text).replace(r"\{\}", "(.+)"), text)
            component = found[1] if found and found.groups() else ""
            if found and (not kind.components or component in kind.components):
                return cls(kind, component)
        return cls(FaultKind.UNKNOWN, text)


# A fault states both significances if the one beside other faults is this many times the one alone.
_MUCH_MORE = 1.5


class FaultTest(NamedTuple):
    """Score test of a fault in the data of an estimate, or its difference from an alternative estimate.

    Attributes
    ----------
    fault : Fault
    unit : str
        SI unit of the size.
    size, standard_deviation : float
        Most likely size if there is no other fault, or difference of the coefficient in an alternative estimate.
    coefficient : str
        Coefficient that the fault biases most, or that differs most.
    susceptibility : float
        Bias of that coefficient by a fault of one standard deviation, in standard deviations of the coefficient.
    tolerance : float
        Standard deviation of the size before any data, see `identification.tolerances`; 0 without one.
    significance : float
        Size in the standard deviation that data and tolerances allow, if the other known quantities are wrong by as
        much as their tolerances allow; negative if unknown.
    rank : int
        1 for the first fault that is needed to explain the data, 2 for the next, and so on; 0 if it is not needed.
    alternatives : tuple of Fault
        Other faults that these data cannot tell from it; empty if it is not needed.
    moved : tuple of str
        Coefficients that it moves by more than their total standard deviation; empty if it is not needed.
    """

    fault: Fault
    unit: str
    size: float
    standard_deviation: float
    coefficient: str
    susceptibility: float
    tolerance: float = 0.0
    significance: float = -1.0
    rank: int = 0
    alternatives: tuple[Fault, ...] = ()
    moved: tuple[str, ...] = ()

    def row(self) -> tuple[object, ...]:
        """Return the values as cells of a table: alternatives separated by "; ", coefficients by spaces."""
        return str(self.fault), *self[1:-2], "; ".join(map(str, self.alternatives)), " ".join(self.moved)

    @classmethod
    def from_row(cls, fault: str, *values: Any) -> "FaultTest":
        """Return the test of a `row`, whose last cells may be missing."""
        n_numbers = len(cls._fields) - 3
        alternatives, moved = (*values[n_numbers:], "", "")[:2]
        faults = tuple(map(Fault.parse, filter(None, alternatives.split("; "))))
        test = cls(Fault.parse(fault), *values[:n_numbers])
        return test._replace(alternatives=faults, moved=tuple(moved.split()))

    @property
    def excess(self) -> float:
        """Return the significance, or without tolerances the size in its standard deviations."""
        return abs(self.z) if self.significance < 0.0 else self.significance

    @property
    def z(self) -> float:
        """Return the size as a multiple of its standard deviation."""
        return self.size / self.standard_deviation

    def __str__(self) -> str:
        name = f"{self.fault} has another {self.coefficient}" if self.fault.is_alternative else str(self.fault)
        if self.alternatives:
            *others, last = map(str, self.alternatives)
            name = f"{', '.join((name, *others))} or {last}"
        factor, shown = degrees_for(self.unit)
        unit = "" if shown == "1" else f" {shown}"
        # Alone it may look small, and be needed all the same if the other faults are in the data too.
        beside = f" alone, {self.excess:.1f} beside the others" if self.excess > _MUCH_MORE * abs(self.z) else ""
        size = f"{factor * self.size:.3g} +- {factor * self.standard_deviation:.2g}{unit}"
        return f"{name} ({size}, {abs(self.z):.1f} sigma{beside})"


class Cause(NamedTuple):
    """Likely cause of innovations, or of contradictions between signals, beyond the stated noise.

    Attributes
    ----------
    gain : float
        Increase of the log-likelihood by a model with this cause.
    name, remedy : str
    lasts : bool
        Whether it is an autocorrelated error of a sensor, or a motion outside the model.
    """

    gain: float
    name: str
    remedy: str
    lasts: bool = False

    @property
    def name_with_gain(self) -> str:
        """Return the name with the gain."""
        return f"{self.name} (gains {self.gain:.0f} in log-likelihood)"

    def __str__(self) -> str:
        return f"{self.name_with_gain}: {self.remedy}"


class Contributor(NamedTuple):
    """Considered error that makes an estimate uncertain."""

    fault: Fault
    deviation: float  # root of the variance of the estimate that would vanish if it were known


class ConsideredErrors(NamedTuple):
    """Errors of known quantities, and their effects on the constant states of an estimate, SI."""

    faults: tuple[Fault, ...]
    units: tuple[str, ...]
    # Shape (k, k); second moments of the errors, from tolerances and data; zero for a fault that no total has to allow
    # for
    covariance: Array
    effect: Array  # shape (n, k); error of each constant state, true less estimated, per unit of each
    inflation: Array  # shape (n,); factor of the standard deviations by autocorrelated residuals

    def check(self, n_states: int) -> None:
        """Raise an InvalidDataError if shapes or values are impossible for an estimate with `n_states` states."""
        k, n = len(self.faults), self.inflation.size
        check_shapes("/considered", (self.covariance, (k, k)), (self.effect, (n, k)))
        check_finite("/considered", self.covariance, self.effect, self.inflation)
        if n > n_states or len(self.units) != k:
            raise InvalidDataError("/considered does not match the state, or has columns of different lengths")
        if (self.inflation < 1.0 - _ROUNDING).any():
            raise InvalidDataError("/considered/inflation has factors below 1")
        self._square_root()

    @property
    def added(self) -> Array:
        """Return the covariance of the constant states that they add to that of the data, shape (n, n)."""
        return self.effect @ self.covariance @ self.effect.T

    def total_deviation(self, of_data: Array) -> Array:
        """Return the total standard deviations of the constant states from those by the data, shape (n,)."""
        return np.sqrt(of_data**2 + np.diagonal(self.added))

    def draw(self, count: int, rng: np.random.Generator) -> Array:
        """Return errors drawn from their second moments, shape (count, k)."""
        root = self._square_root()
        return np.asarray(rng.standard_normal((count, root.shape[1])) @ root.T, dtype=np.float64)

    def _square_root(self) -> Array:
        """Return a matrix R with ``R R' = covariance``, shape (k, rank).

        Raises
        ------
        InvalidDataError
            If the covariance is not symmetric and positive semidefinite.
        """
        variance = np.diagonal(self.covariance)
        if (variance < 0.0).any():
            raise InvalidDataError("/considered/covariance has negative variances")
        # Normalised, because the units differ.
        deviation = np.sqrt(variance)
        product = np.outer(deviation, deviation)
        correlation = np.divide(self.covariance, product, out=np.zeros_like(product), where=product > 0.0)
        is_rest = (product == 0.0) & (self.covariance != 0.0)
        if is_rest.any() or (np.abs(correlation - correlation.T) > _ROUNDING).any():
            raise InvalidDataError("/considered/covariance is not symmetric, or has covariances without variances")
        values, directions = np.linalg.eigh(correlation)
        rounding = _ROUNDING * values.max(initial=0.0)
        if values.min(initial=0.0) < -rounding:
            raise InvalidDataError("/considered/covariance is not positive semidefinite")
        kept = values > rounding
        return np.asarray(deviation[:, None] * directions[:, kept] * np.sqrt(values[kept]), dtype=np.float64)

    def given(self, k: int) -> "ConsideredErrors":
        """Return the errors if the one of column k were known."""
        variance, joint = self.covariance[k, k], self.covariance[k]
        if variance <= 0.0:
            return self
        covariance = self.covariance - np.outer(joint, joint) / variance
        # The rest of the known one is rounding.
        covariance[k], covariance[:, k] = 0.0, 0.0
        return self._replace(covariance=covariance)

    def contributors(self, row: int, count: int = 2) -> list[Contributor]:
        """Return the errors whose knowledge would reduce the variance of a constant state most, the largest first.

        Each is chosen with the ones before it taken as known. With correlated errors a later one can reduce more.
        """
        left, found = self, list[Contributor]()
        for _ in range(count):
            variance, joint = np.diagonal(left.covariance), left.covariance @ self.effect[row]
            unknown = variance > _ROUNDING * np.diagonal(self.covariance)
            reduction = np.divide(joint**2, variance, out=np.zeros_like(joint), where=unknown)
            k = int(reduction.argmax()) if reduction.size else 0
            if not reduction.size or reduction[k] <= 0.0:
                break
            found.append(Contributor(self.faults[k], float(np.sqrt(reduction[k]))))
            left = left.given(k)
        return sorted(found, key=lambda each: each.deviation, reverse=True)
