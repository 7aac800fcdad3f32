"""Effect of each fault of a vehicle's model or data along a motion, per unit of its size.

Names and remedies are in `auvid_cli.data.faults`, the tests in `auvid_cli.filters.fault_scores`. A fault that is a
state, because settings ask for its estimate, is not tested.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import DELAYS
from auvid_cli.data.faults import Fault, FaultKind
from auvid_cli.identification.faulted_vehicle import FaultedVehicle, Motion
from auvid_cli.vehicle.ballast import N_BALLAST
from auvid_cli.vehicle.coefficients import SIGNALS, Coefficient, Regressor
from auvid_cli.vehicle.kinematics import body_to_earth
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS
from auvid_cli.vehicle.term_library import term

Array = NDArray[np.float64]
Effect = Callable[[FaultedVehicle, Motion], Array]

_ROLL_MOMENT = INPUT_SYMBOLS.index("roll_moment")
# s; step of the difference quotient of the specific force.
_SHORT = 1e-4


class FaultModel(NamedTuple):
    """Effect of a fault on the data.

    Attributes
    ----------
    fault : Fault
    unit : str
        SI unit of its size.
    state : str
        Symbol of the state, or of the delay, that represents it where it is estimated; empty if there is none.
    sensor : str
        Sensor whose measurements it changes; empty if it acts on the motion.
    effect : callable
        ``effect(model, at)`` per unit: the addition to the measurements of its sensor, shape (n, c); without a sensor
        the addition to the rates of the motion, shape (n, 9).
    regressor : Regressor or None
        Regressor of a missing term.
    is_drift : bool
        Whether it is the drift of its state: tested where that is one constant.
    answers : str
        Symbol of the disturbance to which a fin reacts before any sensor shows it: tested where that is estimated, in
        addition to a delay of the inputs.
    """

    fault: Fault
    unit: str
    state: str
    sensor: str
    effect: Effect
    regressor: Regressor | None = None
    is_drift: bool = False
    answers: str = ""


def _constant(component: int) -> Effect:
    return lambda model, at: np.tile(np.eye(3)[component], (len(at.motion), 1))


def _lever(axis: int) -> Effect:
    return lambda model, at: np.asarray(np.cross(at.motion[:, 3:6], np.eye(3)[axis]), dtype=np.float64)


def _force_at(axis: int) -> Effect:
    def effect(model: FaultedVehicle, at: Motion) -> Array:
        arm, turning = np.eye(3)[axis], at.motion[:, 3:6]
        carried = np.cross(turning, np.cross(turning, arm))
        return np.asarray(np.cross(at.rates[:, 3:6], arm) + carried, dtype=np.float64)

    return effect


def _current(axis: int) -> Effect:
    return lambda model, at: at._replace(current=np.tile(np.eye(2)[axis], (len(at.motion), 1))).drift


def _offset(given: int) -> Effect:
    return lambda model, at: model.by_inputs(at, np.eye(at.inputs.shape[1])[given])


def _scaled(given: int) -> Effect:
    return lambda model, at: model.by_inputs(at, at.inputs * np.eye(at.inputs.shape[1])[given])


def _ballast(part: int) -> Effect:
    return lambda model, at: model.by_ballast(at, np.eye(N_BALLAST)[part])


def _late_force(model: FaultedVehicle, at: Motion) -> Array:
    before, after = (
        model.specific_force(at.motion + by * at.rates, at.inputs + by * at.input_rate, at.ballast)
        for by in (-_SHORT, _SHORT)
    )
    return (before - after) / (2.0 * _SHORT)


def _late_field(model: FaultedVehicle, at: Motion) -> Array:
    # In a vehicle that turns what stands still in the earth turns back.
    return np.asarray(np.cross(at.motion[:, 3:6], model.magnetic_field(at.motion)), dtype=np.float64)


def missing_term(term: Coefficient) -> FaultModel:
    """Return the fault that the model lacks a term of velocities and fins."""

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        given = np.delete(at.inputs, _ROLL_MOMENT, axis=1)
        signals: dict[str, Array] = dict(zip(SIGNALS, (*at.motion[:, :6].T, *given.T), strict=False))
        pairs = zip(term.signals, term.moduli, strict=True)
        values = [np.abs(signals[signal]) if modulus else signals[signal] for signal, modulus in pairs]
        return model.by_force(at, term.row, np.asarray(np.prod(values, axis=0), dtype=np.float64))

    return FaultModel(Fault(FaultKind.MISSING_TERM, term.symbol), term.unit, "", "", effect, term.regressor)


def _delay(sensor: str, effect: Effect) -> FaultModel:
    component = "DVL" if sensor == "dvl" else sensor.replace("_", " ")
    return FaultModel(Fault(FaultKind.SENSOR_DELAY, component), "s", DELAYS[sensor].symbol, sensor, effect)


def _anticipating(fin: str, given: int, turning: int, pushed: str) -> FaultModel:
    """Return the fault that a fin reacts to disturbances before a sensor shows them: the rate follows its small moves.

    The effectiveness of the fin is not used, because its sign is uncertain where all its moves are small.
    """

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        rates = np.zeros(at.motion.shape)
        rates[:, turning] = at.small_rate[:, given]
        return rates

    return FaultModel(Fault(FaultKind.ANTICIPATING_FIN, fin), "1/s", "", "", effect, answers=f"disturbance_{pushed}")


def _drift(kind: FaultKind, of: FaultModel) -> FaultModel:
    """Return the fault that a state drifts that is estimated as a constant."""
    return of._replace(
        fault=Fault(kind, of.fault.component),
        unit=f"{of.unit}/s",
        effect=lambda model, at: at.time[:, None] * of.effect(model, at),
        is_drift=True,
    )


def _components(
    kind: FaultKind, components: str, unit: str, state: str, sensor: str, effect: Callable[[int], Effect]
) -> Iterator[FaultModel]:
    """Yield a fault for each component."""
    for axis, component in enumerate(components.split()):
        yield FaultModel(Fault(kind, component), unit, state.format(component), sensor, effect(axis))


def _biases(kind: FaultKind, sensor: str) -> Iterator[FaultModel]:
    symbols = " ".join(quantity.symbol for quantity in SENSORS[sensor])
    return _components(kind, symbols, SENSORS[sensor][0].unit, "bias_{}", sensor, _constant)


_CURRENT = tuple(_components(FaultKind.CURRENT, "north east", "m/s", "current_{}", "dvl", _current))
_FIN_TRIM = tuple(_components(FaultKind.FIN_TRIM, "rudder elevator", "rad", "{}_trim", "", _offset))
# As constants these look like other faults or like coefficients: only the drift of an estimated one is tested.
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
    *_components(FaultKind.ACCELEROMETER_POSITION, "x y z", "m", "", "accelerometer", _force_at),
    _delay("gyroscope", lambda model, at: -at.rates[:, 3:6]),
    _delay("dvl", lambda model, at: -at.over_ground_rate),
    FaultModel(
        Fault(FaultKind.INPUT_DELAY),
        *("s", DELAYS["inputs"].symbol, ""),
        lambda model, at: -model.by_inputs(at, at.input_rate),
    ),
    FaultModel(Fault(FaultKind.DVL_SCALE), "1", "dvl_scale", "dvl", lambda model, at: at.over_ground),
    FaultModel(
        Fault(FaultKind.DVL_YAW),
        *("rad", "dvl_yaw", "dvl"),
        lambda model, at: at.over_ground[:, [1, 0, 2]] * [1.0, -1.0, 0.0],
    ),
    *_components(FaultKind.DVL_LEVER_ARM, "x y z", "m", "dvl_{}", "dvl", _lever),
    *_CURRENT,
    *_FIN_TRIM,
    *(_drift(FaultKind.CURRENT_DRIFT, model) for model in _CURRENT),
    *(_drift(FaultKind.FIN_TRIM_DRIFT, model) for model in _FIN_TRIM),
    *(_drift(kind, model) for kind, model in _ONLY_DRIFT),
    FaultModel(Fault(FaultKind.THRUST_OFFSET), "N", "", "", _offset(2)),
    FaultModel(Fault(FaultKind.MASS), "kg", "", "", lambda model, at: model.by_parameter(at, m=1.0)),
    FaultModel(Fault(FaultKind.BUOYANCY), "N", "excess_buoyancy", "", lambda model, at: model.by_parameter(at, B=1.0)),
    # A moment of trim is a part of its effect: where that moment is estimated, the rest is still tested.
    FaultModel(
        Fault(FaultKind.CENTRE_OF_GRAVITY), "m", "", "", lambda model, at: model.by_parameter(at, xG=1e-3) / 1e-3
    ),
    _anticipating("rudder", 0, 5, "N"),
    _anticipating("elevator", 1, 4, "M"),
    *(missing_term(term(row, ("|v|", "r"))) for row in (1, 5)),
)

# Delays that settings can estimate. Those of an angle, a depth, or a sensor that an AHRS reads are not tested unasked,
# because the autocorrelated errors of an AHRS look like them.
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
