"""An identified model as a vehicle of Fossen's Python Vehicle Simulator.

Its vehicles have no common base class: a vehicle is what its main loop can simulate and its plots can label. It takes
Euler steps, and so does this one.
"""

from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.python_function import python_text

_NOTES = (
    "Steps are Euler's, as the simulator takes them.",
    "It has no autopilot: commands are those of stepInput, which you write. Fins and thrust have no limits.",
)
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
        self.controls = ["Rudder (deg)", "Elevator (deg)", "Surge force (N)", "Roll moment (N m)"]
        self.dimU = len(self.controls)
        self.u_actual = np.zeros(self.dimU)

    def dynamics(self, eta, nu, u_actual, u_control, sampleTime):
        """Velocities and actual inputs after one more step.

        Parameters
        ----------
        eta, nu : array_like, shape (6,)
            North, east, down (m), roll, pitch, yaw (rad); u, v, w over ground (m/s), p, q, r (rad/s).
        u_actual, u_control : array_like, shape (4,)
            Rudder, elevator (rad), surge force (N), roll moment (N m), as they are and as commanded.
        sampleTime : float
            s.

        Returns
        -------
        nu, u_actual : ndarray
        """
        nu, acting, commanded = (np.asarray(each, dtype=float) for each in (nu, u_actual, u_control))
        phi, theta, psi = eta[3:6]
        # A fin without lag is where it is commanded to be; so is the propeller.
        acting = np.array([*(acting[:2] if FIN_TIME_CONSTANT else commanded[:2]), *commanded[2:]])
        north, east = self.V_c * cos(self.beta_c - psi), self.V_c * sin(self.beta_c - psi)
        below = sin(theta) * north
        current = np.array([cos(theta) * north, cos(phi) * east + sin(phi) * below, cos(phi) * below - sin(phi) * east])
        relative = [*(nu[:3] - current), *nu[3:], phi, theta, psi]
        slope = motion_derivative(relative, acting * [1.0, 1.0, THRUST_GAIN, 1.0])[:6]
        # In turning axes the current turns the other way.
        slope[:3] -= np.cross(nu[3:], current)
        if FIN_TIME_CONSTANT:
            acting[:2] += (1.0 - np.exp(-sampleTime / FIN_TIME_CONSTANT)) * (commanded[:2] - acting[:2])
        return nu + sampleTime * slope, acting

    def stepInput(self, t):
        """Commands at a time (s): fins amidships, and the thrust of the reference speed."""
        return np.array([0.0, 0.0, {thrust!r}, {torque!r}])
'''


def simulator_losses(model: IdentifiedModel) -> Losses:
    """Name what lies outside the equations of motion and the actuators."""
    return losses_of(model, notes=_NOTES, holds_actuators=True)


def simulator_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole module, which needs only NumPy; `name` is the vehicle's there."""
    vehicle, actuation = model.experiment.vehicle, model.actuation
    known = vehicle.known_parameters()
    actuators = (
        "\n\n# How many times the commanded surge force acts, and the first-order lag of the fins, s.\n"
        f"THRUST_GAIN = {actuation.thrust!r}\nFIN_TIME_CONSTANT = {actuation.fin_time_constant!r}\n"
    )
    body = _CLASS.format(name=name, length=vehicle.size.length, thrust=known["X_prop"], torque=known["K_prop"])
    return python_text(model, losses, name) + actuators + body
