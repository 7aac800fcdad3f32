"""An identified model as the six accelerations that HoloOcean's control scheme "custom dynamics" takes.

HoloOcean moves its agent's centre of mass by accelerations in its global frame, north, west, up, and says with its
DynamicsSensor how that moves. There the derivatives of velocities in turning axes are not enough: what turning adds to
them belongs to the acceleration.
"""

from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.export.python_function import python_text

_NOTES = (
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


def holoocean_losses(model: IdentifiedModel) -> Losses:
    """Name what lies outside the equations of motion, as in a bare function, and what HoloOcean adds."""
    return losses_of(model, notes=_NOTES)


def holoocean_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
    """Write the whole module, which needs only NumPy."""
    return python_text(model, losses, name) + _FUNCTION
