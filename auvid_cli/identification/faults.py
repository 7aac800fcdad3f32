"""Models of faults for the score tests of the smoother, and the vehicle that they disturb."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from functools import cache
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.extra_states import DELAYS
from auvid_cli.data.faults import TESTED_TERMS, Fault, FaultKind
from auvid_cli.numerics import LANES, compiled, types
from auvid_cli.vehicle.coefficients import SIGNALS, Coefficient, Regressor, term
from auvid_cli.vehicle.equations import N_BLOCK, N_FACTORS, N_SLOPE, motion_derivative, vehicle_constants
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, N_MOTION, PARAMETERS, SENSORS
from auvid_cli.vehicle.rigid_body import (
    N_BALLAST,
    body_to_earth,
    current_in_body_axes,
    earth_to_body,
    mass_matrix,
    specific_force,
)

_vector = types.float64[::1]
_matrix = types.float64[:, ::1]
_THRUST = INPUT_SYMBOLS.index("surge_force")
_ROLL_MOMENT = INPUT_SYMBOLS.index("roll_moment")
_PARAMETER_STEP = 1e-3  # of a known parameter; m, N or N m of one that is zero
_DIFFERENCE_STEP = 1e-4  # s, of the central difference of the specific force


class Motion(NamedTuple):
    """States of a vehicle and its inputs at n times, SI."""

    motion: Array  # shape (n, 9)
    inputs: Array  # shape (n, 4)
    input_rate: Array  # shape (n, 4); time derivative of the inputs
    small_rate: Array  # shape (n, 4); the same, zero where the change is large
    rates: Array  # shape (n, 9); time derivative of the motion
    current: Array  # shape (n, 2); north and east; zero if it is not estimated
    ballast: Array  # shape (n, 2); see `Ballast`; zero if it is not estimated
    time: Array  # shape (n,)

    @property
    def drift(self) -> Array:
        """Return the current in body axes, shape (n, 3)."""
        return current_in_body_axes(self.motion[:, 6:9], *self.current.T)

    @property
    def over_ground(self) -> Array:
        """Return the velocity that a DVL measures, shape (n, 3)."""
        return self.motion[:, :3] + self.drift

    @property
    def over_ground_rate(self) -> Array:
        """Return its time derivative, shape (n, 3), with a current that is constant in earth axes."""
        return self.rates[:, :3] - np.cross(self.motion[:, 3:6], self.drift)


class FaultedVehicle:
    """A vehicle with its coefficients, and its response to faults.

    Parameters
    ----------
    parameters : mapping
        Known parameters by symbol, SI.
    coefficients : ndarray, shape (N_FACTORS + terms,)
        From `auvid_cli.vehicle.equations.factors`.
    terms : sequence of Coefficient
        The vehicle's own terms.
    arm : sequence of float
        Position of the accelerometer in body axes, m.
    earth_field : sequence of float
        Magnetic field north, east, down, T.
    """

    def __init__(
        self,
        parameters: Mapping[str, float],
        coefficients: Array,
        terms: Sequence[Coefficient] = (),
        arm: Sequence[float] = (0.0, 0.0, 0.0),
        earth_field: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        self._parameters, self.coefficients, self._terms = parameters, coefficients, terms
        self._constants = vehicle_constants(parameters, terms)
        self._inverse_mass = np.linalg.inv(mass_matrix(parameters))
        self._arm, self._earth_field = np.array(arm), np.array(earth_field)
        self._changed = cache(self._changed_constants)

    def with_coefficients(self, coefficients: Array) -> "FaultedVehicle":
        """Return the vehicle with other coefficients."""
        other = copy(self)
        other.coefficients = coefficients
        return other

    def rates(self, motion: Array, inputs: Array, ballast: Array, constants: Array | None = None) -> Array:
        """Return the time derivative of motions, shape (n, 9); with the constants of another vehicle if given."""
        rates = np.empty(motion.shape)
        lanes = np.repeat(self.coefficients, LANES)
        arrays = (np.ascontiguousarray(values) for values in (motion, inputs, ballast))
        constants = self._constants if constants is None else constants
        _fill_in_rates(*arrays, lanes, constants, rates, np.zeros(N_BLOCK + N_SLOPE))
        return rates

    def at_accelerometer(self, rates: Array) -> Array:
        """Return the acceleration at the accelerometer due to rates of motion, shape (n, 3), m/s^2."""
        return np.asarray(rates[:, :3] + np.cross(rates[:, 3:6], self._arm), dtype=np.float64)

    def specific_force(self, motion: Array, inputs: Array, ballast: Array) -> Array:
        """Return the specific force at the accelerometer, shape (n, 3), m/s^2."""
        return specific_force(motion, self.rates(motion, inputs, ballast), self._arm)

    def magnetic_field(self, motion: Array) -> Array:
        """Return the magnetic field in body axes, shape (n, 3), T."""
        return earth_to_body(motion[:, 6:9], np.tile(self._earth_field, (len(motion), 1)))

    def by_parameter(self, at: Motion, symbol: str) -> Array:
        """Return the change of the rates per unit of a known parameter, shape (n, 9), by a difference quotient."""
        constants, step = self._changed(symbol)
        return (self.rates(at.motion, at.inputs, at.ballast, constants) - at.rates) / step

    def by_ballast(self, at: Motion, change: Array) -> Array:
        """Return the change of the rates if the ballast increases by `change`, shape (n, 9); it is linear."""
        return self.rates(at.motion, at.inputs, at.ballast + change) - at.rates

    def by_inputs(self, at: Motion, change: Array) -> Array:
        """Return the change of the rates if the inputs increase by `change`, shape (n, 9); it is linear."""
        return self.rates(at.motion, at.inputs + change, at.ballast) - at.rates

    def by_force(self, at: Motion, row: int, force: Array) -> Array:
        """Return the change of the rates due to a force, N, or moment, N m, in a row of X Y Z K M N, shape (n, 9)."""
        rates = np.zeros((len(force), N_MOTION))
        rates[:, :6] = force[:, None] * self._inverse_mass[:, row]
        return rates

    def _changed_constants(self, symbol: str) -> tuple[Array, float]:
        """Return the constants of the vehicle with another value of a known parameter, and the step to this value."""
        value = self._parameters[symbol]
        step = _PARAMETER_STEP * abs(value) or _PARAMETER_STEP
        return vehicle_constants({**self._parameters, symbol: value + step}, self._terms), step


@compiled(types.void(_matrix, _matrix, _matrix, _vector, _vector, _matrix, _vector))
def _fill_in_rates(motion, inputs, ballast, coefficient_block, constants, rates, work):
    """Fill in the time derivative of each motion."""
    block, derivative = work[:N_BLOCK], work[N_BLOCK:]
    for k in range(motion.shape[0]):
        for i in range(N_MOTION):
            block[i * LANES] = motion[k, i]
        for i in range(N_BALLAST):
            coefficient_block[(N_FACTORS - N_BALLAST + i) * LANES] = ballast[k, i]
        motion_derivative(block, coefficient_block, inputs[k], constants, 1, derivative)
        for i in range(N_MOTION):
            rates[k, i] = derivative[i * LANES]


Effect = Callable[[FaultedVehicle, Motion], Array]


class FaultModel(NamedTuple):
    """Effect of a fault on the data."""

    fault: Fault
    unit: str  # SI unit of its size
    state: str  # symbol of the state, or of the delay, that represents it where it is estimated; empty if there is none
    sensor: str  # sensor whose measurements it changes; empty if it acts on the motion
    # ``effect(model, at)`` per unit: the addition to the measurements of its sensor, shape (n, c); without a sensor the
    # addition to the rates of the motion, shape (n, 9)
    effect: Effect
    regressor: Regressor | None = None  # regressor of a missing term
    is_drift: bool = False  # whether it is a drift of `state`; tested only if `state` is estimated as a constant
    # Field of `auvid_cli.config.identification.Tolerances` with its standard deviation; empty if it has none
    tolerance: str = ""
    parameter: str = ""  # symbol of the known parameter that is wrong, if it is one
    # Symbol of the disturbance to which a fin reacts before a sensor shows it; tested only if that is estimated,
    # conditional on a delay of the inputs
    reacts_to: str = ""


def _constant(component: int) -> Effect:
    return lambda model, at: np.tile(np.eye(3)[component], (len(at.motion), 1))


def _lever(axis: int) -> Effect:
    return lambda model, at: np.asarray(np.cross(at.motion[:, 3:6], np.eye(3)[axis]), dtype=np.float64)


def _force_at(axis: int) -> Effect:
    def effect(model: FaultedVehicle, at: Motion) -> Array:
        arm, turning = np.eye(3)[axis], at.motion[:, 3:6]
        centripetal = np.cross(turning, np.cross(turning, arm))
        return np.asarray(np.cross(at.rates[:, 3:6], arm) + centripetal, dtype=np.float64)

    return effect


def _current(axis: int) -> Effect:
    return lambda model, at: at._replace(current=np.tile(np.eye(2)[axis], (len(at.motion), 1))).drift


def _offset(column: int) -> Effect:
    return lambda model, at: model.by_inputs(at, np.eye(at.inputs.shape[1])[column])


def _scaled(column: int) -> Effect:
    return lambda model, at: model.by_inputs(at, at.inputs * np.eye(at.inputs.shape[1])[column])


def _ballast(part: int) -> Effect:
    return lambda model, at: model.by_ballast(at, np.eye(N_BALLAST)[part])


def _parameter(symbol: str, tolerance: str, kind: FaultKind = FaultKind.PARAMETER, state: str = "") -> FaultModel:
    component = symbol if kind is FaultKind.PARAMETER else ""
    (unit,) = (quantity.unit for quantity in PARAMETERS if quantity.symbol == symbol)
    return FaultModel(
        Fault(kind, component),
        *(unit, state, ""),
        lambda model, at: model.by_parameter(at, symbol),
        tolerance=tolerance,
        parameter=symbol,
    )


def _gain(axis: int) -> Effect:
    return lambda model, at: np.asarray(at.motion[:, 3:6] * np.eye(3)[axis], dtype=np.float64)


def _fading(model: FaultedVehicle, at: Motion) -> Array:
    fading = np.zeros(at.inputs.shape)
    fading[:, _THRUST] = -at.motion[:, 0] * at.inputs[:, _THRUST]
    return model.by_inputs(at, fading)


def _late_force(model: FaultedVehicle, at: Motion) -> Array:
    before, after = (
        model.specific_force(at.motion + by * at.rates, at.inputs + by * at.input_rate, at.ballast)
        for by in (-_DIFFERENCE_STEP, _DIFFERENCE_STEP)
    )
    return (before - after) / (2.0 * _DIFFERENCE_STEP)


def _late_field(model: FaultedVehicle, at: Motion) -> Array:
    # The field is constant in earth axes, and rotates in body axes.
    return np.asarray(np.cross(at.motion[:, 3:6], model.magnetic_field(at.motion)), dtype=np.float64)


def missing_term(term: Coefficient) -> FaultModel:
    """Return the fault that the model lacks a term."""

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        inputs = np.delete(at.inputs, _ROLL_MOMENT, axis=1)
        signals: dict[str, Array] = dict(zip(SIGNALS, (*at.motion[:, :6].T, *inputs.T), strict=False))
        pairs = zip(term.signals, term.moduli, strict=True)
        values = [np.abs(signals[signal]) if modulus else signals[signal] for signal, modulus in pairs]
        return model.by_force(at, term.row, np.asarray(np.prod(values, axis=0), dtype=np.float64))

    return FaultModel(Fault(FaultKind.MISSING_TERM, term.symbol), term.unit, "", "", effect, term.regressor)


def held_coefficient(coefficient: Coefficient) -> FaultModel:
    """Return the fault that a coefficient that is not estimated has another value."""
    fault = Fault(FaultKind.HELD_COEFFICIENT, coefficient.symbol)
    return missing_term(coefficient)._replace(fault=fault, regressor=None, tolerance="held_coefficients")


def _delay(sensor: str, effect: Effect) -> FaultModel:
    component = "DVL" if sensor == "dvl" else sensor.replace("_", " ")
    fault = Fault(FaultKind.SENSOR_DELAY, component)
    return FaultModel(fault, "s", DELAYS[sensor].symbol, sensor, effect, tolerance="delay")


def _anticipating(fin: str, column: int, rate: int, moment: str) -> FaultModel:
    """Return the fault that a fin reacts to disturbances before a sensor shows them: the rate follows its small moves.

    The effectiveness of the fin is not used, because its sign is uncertain if all moves are small.
    """

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        rates = np.zeros(at.motion.shape)
        rates[:, rate] = at.small_rate[:, column]
        return rates

    return FaultModel(Fault(FaultKind.ANTICIPATING_FIN, fin), "1/s", "", "", effect, reacts_to=f"disturbance_{moment}")


def _drift(kind: FaultKind, of: FaultModel) -> FaultModel:
    """Return the drift of a state that is estimated as a constant."""
    return of._replace(
        fault=Fault(kind, of.fault.component),
        unit=f"{of.unit}/s",
        effect=lambda model, at: at.time[:, None] * of.effect(model, at),
        is_drift=True,
    )


def _components(
    kind: FaultKind,
    components: str,
    unit: str,
    state: str,
    sensor: str,
    effect: Callable[[int], Effect],
    tolerance: str = "",
) -> Iterator[FaultModel]:
    """Yield a fault for each component."""
    for axis, component in enumerate(components.split()):
        fault = Fault(kind, component)
        yield FaultModel(fault, unit, state.format(component), sensor, effect(axis), tolerance=tolerance)


def _biases(kind: FaultKind, sensor: str) -> Iterator[FaultModel]:
    symbols = " ".join(quantity.symbol for quantity in SENSORS[sensor])
    return _components(kind, symbols, SENSORS[sensor][0].unit, "bias_{}", sensor, _constant)


# Parameters with a usual tolerance, except mass and buoyancy; those without effect on the equations are left out.
_TOLERANCES = {
    **dict.fromkeys(("Ixx", "Iyy", "Izz"), "inertia"),
    **dict.fromkeys((q.symbol for q in PARAMETERS if q.symbol.endswith("dot")), "added_mass"),
    "yG": "trim",
    "zG": "centre_of_gravity",
}
_LINEAR_DAMPING = "X_u", "M_q", "N_r"
_CURRENT = tuple(_components(FaultKind.CURRENT, "north east", "m/s", "current_{}", "dvl", _current))
_FIN_TRIM = tuple(_components(FaultKind.FIN_TRIM, "rudder elevator", "rad", "{}_trim", "", _offset))
# As constants these are confounded with other faults or with coefficients, so that only a drift is tested.
_ONLY_DRIFT = tuple(
    (kind, FaultModel(Fault(kind), unit, state, "", effect))
    for kind, unit, state, effect in (
        (FaultKind.THRUST_SCALE_DRIFT, "1", "thrust_scale", _scaled(2)),
        (FaultKind.EXCESS_BUOYANCY_DRIFT, "N", "excess_buoyancy", _ballast(0)),
        (FaultKind.TRIM_MOMENT_DRIFT, "N*m", "trim_moment", _ballast(1)),
    )
)


FAULTS: tuple[FaultModel, ...] = (
    *_biases(FaultKind.GYROSCOPE_BIAS, "gyroscope"),
    *_biases(FaultKind.ACCELEROMETER_BIAS, "accelerometer"),
    *_biases(FaultKind.MAGNETIC_FIELD_BIAS, "magnetic_field"),
    *_components(
        FaultKind.ACCELEROMETER_POSITION, "x y z", "m", "", "accelerometer", _force_at, "accelerometer_position"
    ),
    *(model._replace(tolerance="ahrs") for model in _biases(FaultKind.ATTITUDE_BIAS, "attitude")),
    *_components(FaultKind.GYROSCOPE_SCALE, "p q r", "1", "", "gyroscope", _gain, "gyroscope_scale"),
    *_components(FaultKind.GYROSCOPE_MOUNTING, "x y z", "rad", "", "gyroscope", _lever, "gyroscope_mounting"),
    _delay("gyroscope", lambda model, at: -at.rates[:, 3:6]),
    _delay("dvl", lambda model, at: -at.over_ground_rate),
    FaultModel(
        Fault(FaultKind.INPUT_DELAY),
        *("s", DELAYS["inputs"].symbol, ""),
        lambda model, at: -model.by_inputs(at, at.input_rate),
        tolerance="delay",
    ),
    FaultModel(
        Fault(FaultKind.DVL_SCALE),
        *("1", "dvl_scale", "dvl"),
        lambda model, at: at.over_ground,
        tolerance="dvl_scale",
    ),
    FaultModel(
        Fault(FaultKind.DVL_YAW),
        *("rad", "dvl_yaw", "dvl"),
        lambda model, at: at.over_ground[:, [1, 0, 2]] * [1.0, -1.0, 0.0],
        tolerance="dvl_yaw",
    ),
    *_components(FaultKind.DVL_LEVER_ARM, "x y z", "m", "dvl_{}", "dvl", _lever, "dvl_position"),
    *_CURRENT,
    *_FIN_TRIM,
    *(_drift(FaultKind.CURRENT_DRIFT, model) for model in _CURRENT),
    *(_drift(FaultKind.FIN_TRIM_DRIFT, model) for model in _FIN_TRIM),
    *(_drift(kind, model) for kind, model in _ONLY_DRIFT),
    *_components(FaultKind.FIN_SCALE, "rudder elevator", "1", "", "", _scaled, "fins"),
    FaultModel(Fault(FaultKind.THRUST_SCALE), "1", "thrust_scale", "", _scaled(_THRUST), tolerance="thrust"),
    FaultModel(Fault(FaultKind.THRUST_FADE), "s/m", "", "", _fading, tolerance="thrust_fade"),
    FaultModel(Fault(FaultKind.THRUST_OFFSET), "N", "", "", _offset(_THRUST)),
    _parameter("m", "mass", FaultKind.MASS),
    _parameter("B", "buoyancy", FaultKind.BUOYANCY, "excess_buoyancy"),
    # Not represented by the state `trim_moment`, which is only part of the effect.
    _parameter("xG", "trim", FaultKind.CENTRE_OF_GRAVITY),
    *(_parameter(symbol, tolerance) for symbol, tolerance in _TOLERANCES.items()),
    _anticipating("rudder", 0, 5, "N"),
    _anticipating("elevator", 1, 4, "M"),
    *(
        model._replace(tolerance="linear_damping" if model.fault.component in _LINEAR_DAMPING else "")
        for model in (missing_term(term(*row_and_factors)) for row_and_factors in TESTED_TERMS)
    ),
)


def stated_parameters(symbols: Collection[str]) -> tuple[FaultModel, ...]:
    """Return the faults of known parameters, by symbol, that are not among `FAULTS`."""
    present = {fault.parameter for fault in FAULTS}
    return tuple(_parameter(symbol, "") for symbol in symbols if symbol not in present)


# Delays that settings can estimate. Those beyond `FAULTS` are tested only on request: autocorrelated errors of an AHRS
# look like a delay.
DELAY_FAULTS: dict[str, FaultModel] = {fault.state: fault for fault in FAULTS if fault.unit == "s"} | {
    fault.state: fault
    for fault in (
        _delay("attitude", lambda model, at: -at.rates[:, 6:9]),
        _delay("accelerometer", _late_force),
        _delay("magnetometer", lambda model, at: -at.rates[:, 8:9]),
        _delay("magnetic_field", _late_field),
        _delay("depth", lambda model, at: -body_to_earth(at.motion[:, 6:9], at.motion[:, :3])[:, 2:]),
    )
}
