"""An identified model as a vehicle of Fossen's Python Vehicle Simulator.

Its vehicles have no common base class: a vehicle is what its main loop can simulate and its plots can label. It takes
Euler steps, and so does this one.
"""

from auvid_cli.export.equations import inputs_of
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.python_function import python_text
from auvid_cli.vehicle.actuators import Actuators

_NOTES = (
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


def simulator_losses(model: IdentifiedModel) -> Losses:
    """Name what lies outside the equations of motion and the actuators."""
    return losses_of(model, notes=_NOTES, holds_gain=True, holds_actuators=True)


def _written(actuators: Actuators) -> str:
    entries = (", ".join(f"{name!r}: {_number(value)}" for name, value in a._asdict().items()) for a in actuators)
    return "".join(["ACTUATORS = (\n", *(f"    {{{entry}}},\n" for entry in entries), ")\n"])


def _number(value: float) -> str:
    return "np.inf" if value == float("inf") else repr(value)


def simulator_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
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
