"""Tables of known parameters, motion states, inputs and sensors; parameters of actuators and errors of inputs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Quantity(NamedTuple):
    """A named physical quantity."""

    symbol: str  # SNAME symbol, with ``dot`` for a time derivative
    unit: str  # SI unit in the syntax of pint
    meaning: str  # one phrase for tables, files and documentation
    equation: str  # matrix or vector of Sabet et al. 2018 that it enters


PARAMETERS: tuple[Quantity, ...] = (
    Quantity("m", "kg", "mass", "M_RB, eq. (12)"),
    Quantity("W", "N", "weight", "g(eta), eq. (13)"),
    Quantity("B", "N", "buoyancy", "g(eta), eq. (13)"),
    Quantity("Ixx", "kg*m^2", "moment of inertia about x", "M_RB, eq. (12)"),
    Quantity("Iyy", "kg*m^2", "moment of inertia about y", "M_RB, eq. (12)"),
    Quantity("Izz", "kg*m^2", "moment of inertia about z", "M_RB, eq. (12)"),
    Quantity("xG", "m", "centre of gravity, forward", "M_RB and g(eta)"),
    Quantity("yG", "m", "centre of gravity, starboard", "M_RB and g(eta)"),
    Quantity("zG", "m", "centre of gravity, down", "M_RB and g(eta)"),
    Quantity("xB", "m", "centre of buoyancy, forward", "g(eta), eq. (13)"),
    Quantity("yB", "m", "centre of buoyancy, starboard", "g(eta), eq. (13)"),
    Quantity("zB", "m", "centre of buoyancy, down", "g(eta), eq. (13)"),
    Quantity("X_udot", "kg", "added mass in surge", "M_A, eq. (12)"),
    Quantity("Y_vdot", "kg", "added mass in sway", "M_A, eq. (12)"),
    Quantity("Z_wdot", "kg", "added mass in heave", "M_A, eq. (12)"),
    Quantity("Y_rdot", "kg*m/rad", "added mass, sway by yaw (equals N_vdot)", "M_A, eq. (12)"),
    Quantity("Z_qdot", "kg*m/rad", "added mass, heave by pitch (equals M_wdot)", "M_A, eq. (12)"),
    Quantity("K_pdot", "kg*m^2/rad", "added inertia in roll", "M_A, eq. (12)"),
    Quantity("M_qdot", "kg*m^2/rad", "added inertia in pitch", "M_A, eq. (12)"),
    Quantity("N_rdot", "kg*m^2/rad", "added inertia in yaw", "M_A, eq. (12)"),
    Quantity("M_wdot", "kg*m", "added mass, pitch by heave", "M_A, eq. (12)"),
    Quantity("N_vdot", "kg*m", "added mass, yaw by sway", "M_A, eq. (12)"),
    Quantity("X_prop", "N", "propeller thrust at the reference speed", "tau, eq. (13)"),
    Quantity("K_prop", "N*m", "propeller torque at that thrust", "tau, eq. (13)"),
)
PARAMETER_SYMBOLS: tuple[str, ...] = tuple(q.symbol for q in PARAMETERS)

MOTION: tuple[Quantity, ...] = (
    Quantity("u", "m/s", "surge velocity", "nu"),
    Quantity("v", "m/s", "sway velocity", "nu"),
    Quantity("w", "m/s", "heave velocity", "nu"),
    Quantity("p", "rad/s", "roll rate", "nu"),
    Quantity("q", "rad/s", "pitch rate", "nu"),
    Quantity("r", "rad/s", "yaw rate", "nu"),
    Quantity("phi", "rad", "roll", "eta, eq. (3)"),
    Quantity("theta", "rad", "pitch", "eta, eq. (3)"),
    Quantity("psi", "rad", "yaw", "eta, eq. (3)"),
)
MOTION_SYMBOLS: tuple[str, ...] = tuple(q.symbol for q in MOTION)
N_MOTION = len(MOTION)

POSITION: tuple[Quantity, ...] = (
    Quantity("north", "m", "position north", "eta, eq. (2)"),
    Quantity("east", "m", "position east", "eta, eq. (2)"),
    Quantity("down", "m", "position down (depth)", "eta, eq. (2)"),
)
DEPTH = POSITION[2]
# Predicted quantities that are compared with measurements.
MOTION_AND_DEPTH: tuple[Quantity, ...] = (*MOTION, DEPTH)
MOTION_AND_DEPTH_SYMBOLS: tuple[str, ...] = tuple(q.symbol for q in MOTION_AND_DEPTH)

INPUTS: tuple[Quantity, ...] = (
    Quantity("rudder", "rad", "rudder deflection", "tau_control"),
    Quantity("elevator", "rad", "elevator deflection", "tau_control"),
    Quantity("surge_force", "N", "propeller thrust", "tau_propulsion"),
    Quantity("roll_moment", "N*m", "propeller torque and roll excitation", "tau_propulsion"),
)
INPUT_SYMBOLS: tuple[str, ...] = tuple(q.symbol for q in INPUTS)
# Further inputs, for the vehicle's own terms; recorded after the others if known.
PROPULSION: tuple[Quantity, ...] = (
    Quantity("revolutions", "turn/s", "revolutions of the propeller", "terms of the vehicle's own"),
    Quantity("voltage", "V", "voltage of the battery", "terms of the vehicle's own"),
)
ALL_INPUTS: tuple[Quantity, ...] = (*INPUTS, *PROPULSION)

# Force and moment in addition to the model, in the order of the equations of motion.
DISTURBANCE: tuple[Quantity, ...] = (
    Quantity("disturbance_X", "N", "disturbing force, forward", "tau"),
    Quantity("disturbance_Y", "N", "disturbing force, starboard", "tau"),
    Quantity("disturbance_Z", "N", "disturbing force, down", "tau"),
    Quantity("disturbance_K", "N*m", "disturbing moment, roll", "tau"),
    Quantity("disturbance_M", "N*m", "disturbing moment, pitch", "tau"),
    Quantity("disturbance_N", "N*m", "disturbing moment, yaw", "tau"),
)

HEADING = Quantity("heading", "rad", "heading", "AHRS")

_MOTION = {quantity.symbol: quantity for quantity in MOTION}

# Components of each sensor.
SENSORS: dict[str, tuple[Quantity, ...]] = {
    "gyroscope": (_MOTION["p"], _MOTION["q"], _MOTION["r"]),
    "accelerometer": (
        Quantity("fx", "m/s^2", "specific force, forward", "AHRS"),
        Quantity("fy", "m/s^2", "specific force, starboard", "AHRS"),
        Quantity("fz", "m/s^2", "specific force, down", "AHRS"),
    ),
    "magnetometer": (HEADING,),
    "magnetic_field": (
        Quantity("mx", "T", "magnetic field, forward", "R(eta)' m"),
        Quantity("my", "T", "magnetic field, starboard", "R(eta)' m"),
        Quantity("mz", "T", "magnetic field, down", "R(eta)' m"),
    ),
    "dvl": (_MOTION["u"], _MOTION["v"], _MOTION["w"]),
    "attitude": (_MOTION["phi"], _MOTION["theta"], _MOTION["psi"]),
    "depth": (DEPTH,),
}


# Sensors of the heading, and those that replace an attitude reference.
COMPASSES = "magnetometer", "magnetic_field"
INERTIAL = "accelerometer", *COMPASSES


def state_of(measured: Quantity) -> str:
    """Return the symbol of the state that a component of a sensor measures; a heading measures yaw."""
    return "psi" if measured == HEADING else measured.symbol


class ActuatorErrors(NamedTuple):
    """Errors of the recorded inputs."""

    thrust: float = 1.0  # ratio of the acting to the recorded surge force
    rudder_trim: float = 0.0  # actual minus recorded deflection, constant, rad
    elevator_trim: float = 0.0  # actual minus recorded deflection, constant, rad

    def acting(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acting inputs for recorded ones, shape (..., 4) or (..., 6)."""
        rudder, elevator, surge_force, *others = np.moveaxis(inputs, -1, 0)
        acting = rudder + self.rudder_trim, elevator + self.elevator_trim, self.thrust * surge_force, *others
        return np.stack(acting, axis=-1)


AS_STATED = ActuatorErrors()


class Actuator(NamedTuple):
    """Dynamics of a fin or the propeller; by default it follows its command at once and exactly."""

    dead_band: float = 0.0  # largest command without effect, rad or N
    saturation: float = np.inf  # largest effective command, rad or N
    rate_limit: float = np.inf  # rad/s or N/s
    time_constant: float = 0.0  # time constant of a first-order lag, s
    stall: float = np.inf  # largest deflection with a proportional force, rad
    stall_slope: float = 0.0  # slope of the force beyond stall over the slope below


IDEAL = Actuator()


class Actuators(NamedTuple):
    """Actuators in the order of the inputs; the roll moment has none."""

    rudder: Actuator = IDEAL
    elevator: Actuator = IDEAL
    thrust: Actuator = IDEAL


N_ACTUATORS = len(Actuators._fields)
