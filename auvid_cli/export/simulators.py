"""Vehicles for PythonVehicleSimulator and HoloOcean."""

from auvid_cli.export.functions import inputs_of, python_text
from auvid_cli.export.losses import UnsupportedFeatures
from auvid_cli.export.model import IdentifiedModel

SIMULATOR_NOTES = (
    "Integration is by Euler's method, like in the simulator.",
    "There is no autopilot: write your commands in stepInput. ACTUATORS are the only limits of fins and thrust.",
)
_PLOT_UNITS = {"rad": "deg", "N*m": "N m"}
_ACTUATORS = '''

def demanded(actuator, command):
    """Position that a command demands, after saturation and dead band."""
    return np.copysign(max(min(abs(command), actuator["saturation"]) - actuator["dead_band"], 0.0), command)


def position(actuator, before, command):
    """Current position: that of the command without lag and rate limit."""
    at_once = actuator["time_constant"] == 0.0 and actuator["rate_limit"] == np.inf
    return demanded(actuator, command) if at_once else before


def moved(actuator, before, command, duration):
    """Position after a short time, s."""
    lag, distance = actuator["time_constant"], demanded(actuator, command) - before
    change = distance * (1.0 - np.exp(-duration / lag)) if lag else distance
    return before + np.clip(change, -duration * actuator["rate_limit"], duration * actuator["rate_limit"])


def effective(actuator, angle):
    """Deflection without stall that has the same force as a stalled fin."""
    excess = abs(angle) - actuator["stall"]
    if excess <= 0.0:
        return angle
    return np.copysign(max(actuator["stall"] + actuator["stall_slope"] * excess, 0.0), angle)
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
        self.controlDescription = "Straight ahead; replace stepInput for other commands"
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
            Inputs of `motion_derivative`, actual and commanded.
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
        # In rotating axes the current rotates in the opposite direction.
        slope[:3] -= np.cross(nu[3:], current)
        for k, actuator in enumerate(ACTUATORS):
            acting[k] = moved(actuator, acting[k], commanded[k], sampleTime)
        return nu + sampleTime * slope, acting

    def stepInput(self, t):
        """Commands at a time (s): fins at zero, and the thrust of the reference speed."""
        return np.array([0.0, 0.0, {thrust!r}, {torque!r}, *np.zeros(self.dimU - 4)])
'''
HOLOOCEAN_NOTES = (
    "HoloOcean holds an acceleration for a whole tick, so that the length of the tick is the step of the integration.",
    "HoloOcean's own ocean current has no effect, because its sensor gives the velocity over ground.",
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
        Output of that sensor in the global frame: linear acceleration, velocity, position, angular acceleration,
        angular velocity, quaternion x, y, z, w; SI.
    inputs : array_like
        Inputs of `motion_derivative`.

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


def _number(value: float) -> str:
    return "np.inf" if value == float("inf") else repr(value)


def simulator_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Return the Python module of a vehicle with this name; it needs only NumPy."""
    vehicle, actuation = model.experiment.vehicle, model.actuation
    parameters = vehicle.known_parameters()
    entries = (
        ", ".join(f"{key!r}: {_number(value)}" for key, value in actuator._asdict().items())
        for actuator in actuation.actuators.actuators()
    )
    lines = [
        "\n\n# Scale of the surge force; dynamics of rudder, elevator and surge force, SI.",
        f"THRUST_GAIN = {actuation.thrust!r}",
        "ACTUATORS = (",
        *(f"    {{{entry}}}," for entry in entries),
        ")\n",
    ]
    # Plots of the simulator are in degrees.
    controls = [
        f"{q.symbol.replace('_', ' ').capitalize()} ({_PLOT_UNITS.get(q.unit, q.unit)})" for q in inputs_of(model)
    ]
    propulsion = {"thrust": parameters["X_prop"], "torque": parameters["K_prop"]}
    body = _CLASS.format(name=name, length=vehicle.size.length, controls=controls, **propulsion)
    return python_text(model, losses, name) + "\n".join(lines) + _ACTUATORS + body


def holoocean_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Return the Python module for HoloOcean; it needs only NumPy."""
    return python_text(model, losses, name) + _FUNCTION
