"""What may be wrong with a vehicle's model or its data, fault by fault: what each does along a motion, per unit of it.

A fault is no state of the model; see `auvid_cli.filters.fault_scores` for what the data say of it. One that is, because
settings ask for it to be estimated, is not tested.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.extra_states import DELAYS
from auvid_cli.filters.problem import ANOTHER_MINIMUM, SEGMENT
from auvid_cli.identification.faulted_vehicle import FaultedVehicle, Motion
from auvid_cli.vehicle.ballast import N_BALLAST
from auvid_cli.vehicle.coefficients import SIGNALS, Coefficient, Regressor
from auvid_cli.vehicle.kinematics import body_to_earth
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS
from auvid_cli.vehicle.term_library import term

Array = NDArray[np.float64]

_ROLL_MOMENT = INPUT_SYMBOLS.index("roll_moment")
# s; before and after an instant, to find how fast what is felt there changes.
_SHORT = 1e-4


class Fault(NamedTuple):
    """Something that may be wrong.

    Attributes
    ----------
    name, unit : str
        Unit of its size, SI.
    remedy : str
        What to do about it.
    state : str
        Symbol of the state, or of the delay, that stands for it where it is estimated; empty if none does.
    sensor : str
        Whose measurements it changes; empty if it acts on the motion.
    effect : callable
        ``effect(model, at)`` per unit: of a sensor's what is added, shape (n, c); of others by how much faster the
        motion changes, shape (n, 9).
    regressor : Regressor or None
        Of a term that the model lacks.
    is_drift : bool
        Whether it is how what the state stands for changes with time: it is tested where that is one constant.
    answers : str
        Symbol of the disturbance that a fin may answer before any sensor shows it: tested where that is estimated, and
        beside a delay of the inputs.
    """

    name: str
    unit: str
    remedy: str
    state: str
    sensor: str
    effect: Callable[[FaultedVehicle, Motion], Array]
    regressor: Regressor | None = None
    is_drift: bool = False
    answers: str = ""


def _constant(component: int) -> Callable[[FaultedVehicle, Motion], Array]:
    return lambda model, at: np.tile(np.eye(3)[component], (len(at.motion), 1))


def _lever(axis: int) -> Callable[[FaultedVehicle, Motion], Array]:
    return lambda model, at: np.asarray(np.cross(at.motion[:, 3:6], np.eye(3)[axis]), dtype=np.float64)


def _force_at(axis: int) -> Callable[[FaultedVehicle, Motion], Array]:
    def effect(model: FaultedVehicle, at: Motion) -> Array:
        arm, turning = np.eye(3)[axis], at.motion[:, 3:6]
        carried = np.cross(turning, np.cross(turning, arm))
        return np.asarray(np.cross(at.rates[:, 3:6], arm) + carried, dtype=np.float64)

    return effect


def _current(axis: int) -> Callable[[FaultedVehicle, Motion], Array]:
    return lambda model, at: at._replace(current=np.tile(np.eye(2)[axis], (len(at.motion), 1))).drift


def _offset(given: int) -> Callable[[FaultedVehicle, Motion], Array]:
    return lambda model, at: model.by_inputs(at, np.eye(at.inputs.shape[1])[given])


def _scaled(given: int) -> Callable[[FaultedVehicle, Motion], Array]:
    return lambda model, at: model.by_inputs(at, at.inputs * np.eye(at.inputs.shape[1])[given])


def _ballast(part: int) -> Callable[[FaultedVehicle, Motion], Array]:
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


def missing_term(term: Coefficient) -> Fault:
    """Return as a fault that a model lacks a term of velocities and fins."""

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        given = np.delete(at.inputs, _ROLL_MOMENT, axis=1)
        signals: dict[str, Array] = dict(zip(SIGNALS, (*at.motion[:, :6].T, *given.T), strict=False))
        pairs = zip(term.signals, term.moduli, strict=True)
        values = [np.abs(signals[signal]) if modulus else signals[signal] for signal, modulus in pairs]
        return model.by_force(at, term.row, np.asarray(np.prod(values, axis=0), dtype=np.float64))

    return Fault(term.symbol, term.unit, _TERM, "", "", effect, term.regressor)


def _answering(fin: str, given: int, turning: int, pushed: str) -> Fault:
    """Return as a fault that a fin answers pushes before a sensor shows them: then the rate is what its moves tell.

    That does not go by what a fin does to the rate: where its small moves are all there are, what is found of that may
    be of either sign.
    """

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        rates = np.zeros(at.motion.shape)
        rates[:, turning] = at.small_rate[:, given]
        return rates

    return Fault(f"{fin} that answers pushes", "1/s", _ANSWERS, "", "", effect, answers=f"disturbance_{pushed}")


def _drift_of(walk: str, fault: Fault) -> Fault:
    """Return as a fault that something drifts which is estimated as a constant; `walk` is the setting that lets it."""

    def effect(model: FaultedVehicle, at: Motion) -> Array:
        return at.time[:, None] * fault.effect(model, at)

    name, remedy = f"drift of the {fault.name}", _WALKS.format(walk)
    return Fault(name, f"{fault.unit}/s", remedy, fault.state, fault.sensor, effect, is_drift=True)


_GYRO = "estimate it (identification.estimate.biases: [gyro])"
_FORCE = "estimate it (identification.estimate.biases: [accelerometer])"
_IRON = "estimate the field of the vehicle (identification.estimate.biases: [magnetic_field])"
_PLACE = "state where it sits (`position` in the sensor's settings or map)"
_DVL = "estimate scale and mounting of the DVL (identification.estimate.biases: [dvl])"
_CURRENT = "estimate the current (identification.estimate.biases: [current])"
_LATE = (
    "subtract it from the times of the {} where they are recorded or imported, or state it (identification.delays.{})"
)
_EARLY = (
    "add it to the times of the inputs where they are recorded or imported, or state it (identification.delays.inputs);"
    " fins that lag: vehicle.actuators.fins.time_constant"
)
_LEVER = "move what the DVL measured to the origin, or estimate its arm (identification.estimate.biases: [dvl_arm])"
_TRIM = "add it to the recorded angle, or estimate it (identification.estimate.biases: [fin_trim])"
_THRUST = "add it to the recorded thrust, or estimate its scale (identification.estimate.biases: [thrust])"
_TERM = "the model lacks this term, and others make up for it: add it (vehicle.terms)"
_CHECK = "check vehicle.parameters.{}"
_ANSWERS = (
    "an autopilot moves this fin by more than the log has, so that it seems to do less: log what it steers by (its "
    "gyroscope), move fins by a plan, or hold the coefficients of this axis; or this fin alone is late"
)
_WALKS = (
    "it is estimated as one constant: let it walk (identification.estimate.{}), or identify parts of the run one by "
    "one (--use BEGIN:END)"
)
_BALLAST = f"{_CHECK}, or estimate {{}} (identification.estimate.biases: [ballast])"

_MAY_DRIFT: tuple[tuple[str, Fault], ...] = (
    ("current.walk", Fault("current, north", "m/s", _CURRENT, "current_north", "dvl", _current(0))),
    ("current.walk", Fault("current, east", "m/s", _CURRENT, "current_east", "dvl", _current(1))),
    ("fin_trim.walk", Fault("trim of the rudder", "rad", _TRIM, "rudder_trim", "", _offset(0))),
    ("fin_trim.walk", Fault("trim of the elevator", "rad", _TRIM, "elevator_trim", "", _offset(1))),
)
# As constants these are what other faults, or coefficients, are: only of what is estimated a drift is tested for.
_ONLY_DRIFT: tuple[tuple[str, Fault], ...] = (
    ("thrust.walk", Fault("scale of the thrust", "1", "", "thrust_scale", "", _scaled(2))),
    ("ballast.buoyancy_walk", Fault("excess buoyancy", "N", "", "excess_buoyancy", "", _ballast(0))),
    ("ballast.moment_walk", Fault("moment of trim", "N*m", "", "trim_moment", "", _ballast(1))),
)
FAULTS: tuple[Fault, ...] = (
    *(
        Fault(f"bias of {quantity.symbol}", "rad/s", _GYRO, f"bias_{quantity.symbol}", "gyroscope", _constant(i))
        for i, quantity in enumerate(SENSORS["gyroscope"])
    ),
    *(
        Fault(f"bias of {quantity.symbol}", "m/s^2", _FORCE, f"bias_{quantity.symbol}", "accelerometer", _constant(i))
        for i, quantity in enumerate(SENSORS["accelerometer"])
    ),
    *(
        Fault(f"bias of {quantity.symbol}", "T", _IRON, f"bias_{quantity.symbol}", "magnetic_field", _constant(i))
        for i, quantity in enumerate(SENSORS["magnetic_field"])
    ),
    *(
        Fault(f"position of the accelerometer, {axis}", "m", _PLACE, "", "accelerometer", _force_at(i))
        for i, axis in enumerate("xyz")
    ),
    Fault(
        "delay of the gyroscope",
        *("s", _LATE.format("gyroscope", "gyroscope"), DELAYS["gyroscope"].symbol, "gyroscope"),
        lambda model, at: -at.rates[:, 3:6],
    ),
    Fault(
        "delay of the DVL",
        *("s", _LATE.format("DVL", "dvl"), DELAYS["dvl"].symbol, "dvl"),
        lambda model, at: -at.over_ground_rate,
    ),
    Fault(
        "delay of the inputs",
        *("s", _EARLY, DELAYS["inputs"].symbol, ""),
        lambda model, at: -model.by_inputs(at, at.input_rate),
    ),
    Fault("scale of the DVL", "1", _DVL, "dvl_scale", "dvl", lambda model, at: at.over_ground),
    Fault(
        "mounting yaw of the DVL",
        *("rad", _DVL, "dvl_yaw", "dvl"),
        lambda model, at: at.over_ground[:, [1, 0, 2]] * [1.0, -1.0, 0.0],
    ),
    *(Fault(f"lever arm of the DVL, {a}", "m", _LEVER, f"dvl_{a}", "dvl", _lever(i)) for i, a in enumerate("xyz")),
    *(fault for _, fault in _MAY_DRIFT),
    *(_drift_of(walk, fault) for walk, fault in (*_MAY_DRIFT, *_ONLY_DRIFT)),
    Fault(
        "constant thrust",
        *("N", _THRUST, "", ""),
        _offset(2),
    ),
    Fault("mass", "kg", _CHECK.format("m"), "", "", lambda model, at: model.by_parameter(at, m=1.0)),
    Fault(
        "buoyancy",
        *("N", _BALLAST.format("B", "the excess buoyancy"), "excess_buoyancy", ""),
        lambda model, at: model.by_parameter(at, B=1.0),
    ),
    # Of which a moment of trim is no more than a part: where that is estimated, the rest is still tested for.
    Fault(
        "xG",
        *("m", _BALLAST.format("xG", "the moment of trim"), "", ""),
        lambda model, at: model.by_parameter(at, xG=1e-3) / 1e-3,
    ),
    _answering("rudder", 0, 5, "N"),
    _answering("elevator", 1, 4, "M"),
    *(missing_term(term(row, ("|v|", "r"))) for row in (1, 5)),
)

# Delays that are looked for where settings ask for it; those of an angle or a depth are not tested for unasked, since
# errors of an AHRS, which last, look like them, nor those of the sensors that an AHRS hears.
DELAY_FAULTS: dict[str, Fault] = {fault.state: fault for fault in FAULTS if fault.unit == "s"} | {
    DELAYS[sensor].symbol: Fault(
        f"delay of the {sensor.replace('_', ' ')}", "s", "", DELAYS[sensor].symbol, sensor, effect
    )
    for sensor, effect in (
        ("attitude", lambda model, at: -at.rates[:, 6:9]),
        ("accelerometer", _late_force),
        ("magnetometer", lambda model, at: -at.rates[:, 8:9]),
        ("magnetic_field", _late_field),
        ("depth", lambda model, at: -body_to_earth(at.motion[:, 6:9], at.motion[:, :3])[:, 2:]),
    )
}

ANSWERING = frozenset(fault.name for fault in FAULTS if fault.answers)
"""Names of those that are tested beside a delay of the inputs, which they look like."""

_REMEDIES = {fault.name: fault.remedy for fault in FAULTS}


def remedy_of_fault(name: str) -> str:
    """Say what to do about what a test of an estimate is named for."""
    if name.startswith(ANOTHER_MINIMUM):
        return "it is nearly as probable, so these data decide nothing: use more of them, or a narrower prior"
    if name.startswith(SEGMENT):
        return (
            "one model does not hold for all: look at what changed (current, trim, load), and identify the segments "
            "one by one (--use BEGIN:END)"
        )
    return _REMEDIES.get(name, "")
