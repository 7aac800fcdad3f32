"""Vehicles for PythonVehicleSimulator and HoloOcean."""

from auvid_cli.export.functions import inputs_of, python_text
from auvid_cli.export.losses import UnsupportedFeatures, unsupported_features
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.vehicle.actuators import Actuators

_SIMULATOR_NOTES = (
    "Steps are Euler's, as the simulator takes them.",
    "It has no autopilot: commands are those of stepInput, which you write. ACTUATORS are all the limits "
    "of fins and thrust.",
)
_SHOWN = {"rad": "deg", "N*m": "N m"}
_ACTUATORS = '''

def demanded(actuator, command):
    """Where a command sends an actuator."""
    return np.copysign(max(min(abs(command), actuator["saturation"]) - actuator["dead_band"], 0.0), command)


def position(actuator, before, command):
    """Where an actuator is: what neither lags nor is limited is where it is sent to."""
    at_once = actuator["time_constant"] == 0.0 and actuator["rate_limit"] == np.inf
    return demanded(actuator, command) if at_once else before


def moved(actuator, before, command, duration):
    """Where it is a short while later, s."""
    lag, left = actuator["time_constant"], demanded(actuator, command) - before
    way = left * (1.0 - np.exp(-duration / lag)) if lag else left
    return before + np.clip(way, -duration * actuator["rate_limit"], duration * actuator["rate_limit"])


def effective(actuator, at):
    """Deflection that would make the force of a stalled fin if it had not stalled."""
    beyond = abs(at) - actuator["stall"]
    return at if beyond <= 0.0 else np.copysign(max(actuator["stall"] + actuator["stall_slope"] * beyond, 0.0), at)
'''
_CLASS = '''

class Vehicle:
    """For `simulate(N, sampleTime, vehicle)` of the Python Vehicle Simulator.

    Parameters
    ----------
    controlSystem : str
        Only "stepInput".
    V_current, beta_current : float
        Speed (m/s) and direction (deg) of an ocean current.
    """

    def __init__(self, controlSystem="stepInput", V_current=0.0, beta_current=0.0):
        if controlSystem != "stepInput":
            raise ValueError(f"{{controlSystem!r}}: this vehicle has only stepInput")
        self.name = {name!r}
        self.controlMode = controlSystem
        self.controlDescription = "Straight on, until you write another stepInput"
        self.L = {length!r}
        self.V_c = V_current
        self.beta_c = np.radians(beta_current)
        self.nu = np.zeros(6)
        self.controls = {controls!r}
        self.dimU = len(self.controls)
        self.u_actual = np.zeros(self.dimU)

    def dynamics(self, eta, nu, u_actual, u_control, sampleTime):
        """Velocities and actual inputs after one more step.

        Parameters
        ----------
        eta, nu : array_like, shape (6,)
            North, east, down (m), roll, pitch, yaw (rad); u, v, w over ground (m/s), p, q, r (rad/s).
        u_actual, u_control : array_like, shape (dimU,)
            As of `motion_derivative`, as they are and as commanded.
        sampleTime : float
            s.

        Returns
        -------
        nu, u_actual : ndarray
        """
        nu, acting, commanded = (np.asarray(each, dtype=float) for each in (nu, u_actual, u_control))
        phi, theta, psi = eta[3:6]
        acting = np.array([*map(position, ACTUATORS, acting, commanded), *commanded[len(ACTUATORS):]])
        north, east = self.V_c * cos(self.beta_c - psi), self.V_c * sin(self.beta_c - psi)
        below = sin(theta) * north
        current = np.array([cos(theta) * north, cos(phi) * east + sin(phi) * below, cos(phi) * below - sin(phi) * east])
        relative = [*(nu[:3] - current), *nu[3:], phi, theta, psi]
        forces = np.array([*map(effective, ACTUATORS, acting), *acting[len(ACTUATORS):]])
        forces[2] *= THRUST_GAIN
        slope = motion_derivative(relative, forces)[:6]
        # In turning axes the current turns the other way.
        slope[:3] -= np.cross(nu[3:], current)
        for k, actuator in enumerate(ACTUATORS):
            acting[k] = moved(actuator, acting[k], commanded[k], sampleTime)
        return nu + sampleTime * slope, acting

    def stepInput(self, t):
        """Commands at a time (s): fins amidships, and the thrust of the reference speed."""
        return np.array([0.0, 0.0, {thrust!r}, {torque!r}, *np.zeros(self.dimU - 4)])
'''
_HOLOOCEAN_NOTES = (
    "HoloOcean holds an acceleration for a whole tick, so that the length of the tick is the step of the integration.",
    "HoloOcean's own ocean current does not act: it is the velocity over ground that the sensor gives.",
)
_FUNCTION = '''

# Forward, port, up to forward, starboard, down; north, west, up to north, east, down.
TURN = np.array([1.0, -1.0, -1.0])
CENTRE_OF_GRAVITY = np.array([xG, yG, zG])


def accelerations(state, inputs):
    """Six accelerations for an agent of HoloOcean whose control scheme is "custom dynamics".

    For example, with an agent of the type TorpedoAUV, "control_scheme": 1, and a DynamicsSensor with
    "configuration": {"UseCOM": True, "UseRPY": False}:

        state = env.step(np.zeros(6))
        while True:
            state = env.step(accelerations(state["DynamicsSensor"], [0.0, 0.0, 50.0, 0.0]))

    Parameters
    ----------
    state : array_like, shape (19,)
        What that sensor gives, in the global frame: linear acceleration, velocity, position, angular acceleration,
        angular velocity, quaternion x, y, z, w; SI.
    inputs : array_like
        As of `motion_derivative`.

    Returns
    -------
    ndarray, shape (6,)
        Linear (m/s^2), of the centre of gravity, and angular (rad/s^2), in the global frame.
    """
    state = np.asarray(state, dtype=float)
    x, y, z, w = state[15:19] / np.linalg.norm(state[15:19])
    rotation = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    rates = TURN * (rotation.T @ state[12:15])
    velocity = TURN * (rotation.T @ state[3:6]) - np.cross(rates, CENTRE_OF_GRAVITY)
    down = TURN * -rotation[2]
    roll, pitch = np.arctan2(down[1], down[2]), np.arctan2(-down[0], np.hypot(down[1], down[2]))
    slope = motion_derivative([*velocity, *rates, roll, pitch, 0.0], inputs)
    angular = slope[3:6]
    linear = slope[:3] + np.cross(rates, velocity)
    linear = linear + np.cross(angular, CENTRE_OF_GRAVITY) + np.cross(rates, np.cross(rates, CENTRE_OF_GRAVITY))
    return np.concatenate([rotation @ (TURN * linear), rotation @ (TURN * angular)])
'''


def simulator_losses(model: IdentifiedModel) -> UnsupportedFeatures:
    """Name what lies outside the equations of motion and the actuators."""
    return unsupported_features(model, notes=_SIMULATOR_NOTES, holds_gain=True, holds_actuators=True)


def _written(actuators: Actuators) -> str:
    entries = (", ".join(f"{name!r}: {_number(value)}" for name, value in a._asdict().items()) for a in actuators)
    return "".join(["ACTUATORS = (\n", *(f"    {{{entry}}},\n" for entry in entries), ")\n"])


def _number(value: float) -> str:
    return "np.inf" if value == float("inf") else repr(value)


def simulator_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Write the whole module, which needs only NumPy; `name` is the vehicle's there."""
    vehicle, actuation = model.experiment.vehicle, model.actuation
    known = vehicle.known_parameters()
    actuators = (
        "\n\n# How many times the surge force acts; how rudder, elevator and surge force follow their commands, SI.\n"
        f"THRUST_GAIN = {actuation.thrust!r}\n{_written(actuation.actuators.actuators())}{_ACTUATORS}"
    )
    # The simulator's plots are in degrees.
    shown = (f"{q.symbol.replace('_', ' ').capitalize()} ({_SHOWN.get(q.unit, q.unit)})" for q in inputs_of(model))
    propulsion = {"thrust": known["X_prop"], "torque": known["K_prop"]}
    body = _CLASS.format(name=name, length=vehicle.size.length, controls=[*shown], **propulsion)
    return python_text(model, losses, name) + actuators + body


def holoocean_losses(model: IdentifiedModel) -> UnsupportedFeatures:
    """Name what lies outside the equations of motion, as in a bare function, and what HoloOcean adds."""
    return unsupported_features(model, notes=_HOLOOCEAN_NOTES)


def holoocean_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Write the whole module, which needs only NumPy."""
    return python_text(model, losses, name) + _FUNCTION
