"""All export formats; this module writes JSON, YAML and the files for PythonVehicleSimulator and HoloOcean itself."""

import json
import re
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import yaml

from auvid_cli.config.enums import FormatName
from auvid_cli.config.loading import given_settings
from auvid_cli.errors import ConfigError
from auvid_cli.export.functions import MSS_NOTES, inputs_of, matlab_text, mss_text, python_text
from auvid_cli.export.gazebo import gazebo_text, gazebo_unsupported
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel
from auvid_cli.export.unsupported_features import (
    UnsupportedFeatures,
    caveats,
    heading_lines,
    line_comments,
    unsupported_features,
)
from auvid_cli.text import printable
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETERS

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


def simulator_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
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
    return python_text(model, unsupported, name) + "\n".join(lines) + _ACTUATORS + body


def holoocean_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the Python module for HoloOcean; it needs only NumPy."""
    return python_text(model, unsupported, name) + _FUNCTION


SCHEMA_VERSION = 2
# Length of the vehicle in the name of a file, so that it is a valid name of a MATLAB function.
_MAX_VEHICLE_NAME = 32
# Python imports and MATLAB calls these files by name.
_CALLED_BY_NAME = {FormatName.PYTHON, FormatName.MATLAB, FormatName.HOLOOCEAN, FormatName.SIMULATOR, FormatName.MSS}


def json_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the JSON file; numbers in SI, angles in radians."""
    vehicle = model.experiment.vehicle
    parameters = vehicle.known_parameters()
    content = {
        "kind": "auvid model",
        "schema_version": SCHEMA_VERSION,
        "name": name,
        "vehicle": vehicle.name,
        "size": vehicle.size.model_dump(mode="json"),
        "filter": model.filter,
        "status": str(model.judgement.grade),
        "reason": model.judgement.reason,
        "doubts": caveats(model),
        "parameters": {
            q.symbol: {"value": parameters[q.symbol], "unit": q.unit, "meaning": q.meaning} for q in PARAMETERS
        },
        "coefficients": {
            estimated.symbol: {
                "value": estimated.value,
                "unit": estimated.unit,
                "standard_deviation": estimated.standard_deviation,
                "estimated": estimated.standard_deviation is not None,
                "identified": estimated.identified,
                "meaning": coefficient.meaning,
                "equation": coefficient.equation,
            }
            for estimated, coefficient in zip(model.coefficients, model.coefficient_set, strict=True)
        },
        "states": {
            state.symbol: {"value": state.value, "unit": state.unit, "standard_deviation": state.standard_deviation}
            for state in model.states
        },
        "covariance": {
            "order": [*model.estimated(), *(state.symbol for state in model.states)],
            "values": model.covariance.tolist(),
        },
        "thrust": {
            "value": model.actuation.thrust,
            "unit": "1",
            "meaning": "scale of the stated surge force",
            "rms_of_change": model.actuation.thrust_rms,
        },
        "actuators": {
            **model.actuation.actuators.model_dump(mode="json", exclude_none=True),
            "meaning": "dynamics of fins and propeller, SI; see the settings of a vehicle",
            "rms_of_change": model.actuation.changes,
        },
        "terms": [size._asdict() for size in model.term_sizes],
        "lost": {"terms": [size._asdict() for size in unsupported.terms], "notes": unsupported.notes},
        "provenance": model.origin._asdict() | {"settings": given_settings(model.experiment)},
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def yaml_text(model: IdentifiedModel, unsupported: UnsupportedFeatures, name: str) -> str:
    """Return the vehicle file; entries that were not estimated stay the same."""
    before = model.experiment.vehicle.model_dump(mode="json", by_alias=True, exclude_none=True)
    units = {quantity.symbol: quantity.unit for quantity in PARAMETERS}
    parameters = {symbol: _with_unit(entry, units[symbol]) for symbol, entry in before["parameters"].items()}
    stated = before["coefficients"] | {term["name"]: term for term in before["terms"]}
    entries = {
        coefficient.symbol: _with_unit(stated[coefficient.symbol], coefficient.unit)
        if coefficient.standard_deviation is None
        else _estimated(coefficient, model)
        for coefficient in model.coefficients
    }
    origin, experiment = model.origin, model.experiment
    provenance = (
        f"Coefficients estimated by {model.filter} ({model.judgement.grade}) with auvid {origin.auvid_version}; "
        f"{origin.estimate}, from {origin.dataset}, experiment {experiment.name}, seed {experiment.seed}."
    )
    notes = [*before["notes"], provenance]
    coefficients = {symbol: entry for symbol, entry in entries.items() if symbol in SYMBOLS}
    vehicle = before | {"notes": notes, "parameters": parameters, "coefficients": coefficients}
    # Leave out priors: they are older than the data that the estimate is made from.
    terms = [
        {key: term[key] for key in term if key != "prior"} | entries[term["name"]] for term in vehicle.pop("terms")
    ]
    if terms:
        vehicle["terms"] = terms
    if not any(vehicle["actuators"].values()):
        del vehicle["actuators"]
    text = yaml.safe_dump(vehicle, sort_keys=False, width=160, default_flow_style=None, allow_unicode=True)
    return line_comments("#", heading_lines(model, unsupported)) + text


def _estimated(coefficient: IdentifiedCoefficient, model: IdentifiedModel) -> dict[str, Any]:
    remark = "" if coefficient.identified else ", identified: false"
    return {
        "value": _quantity(coefficient.value, coefficient.unit),
        "standard_deviation": _quantity(coefficient.standard_deviation, coefficient.unit),
        "status": f"estimated by {model.filter}{remark}",
        "source": f"estimate {model.origin.estimate_sha256[:12] or 'in memory'}",
    }


def _with_unit(entry: dict[str, Any], unit: str) -> dict[str, Any]:
    quantities = {key: _quantity(entry[key], unit) for key in ("value", "standard_deviation") if key in entry}
    return entry | quantities


def _quantity(value: float | None, unit: str) -> str | float | None:
    """Return a value with its unit; a number if it is dimensionless."""
    return value if unit == "1" else f"{value!r} {unit}"


class Format(NamedTuple):
    """An export format."""

    suffix: str  # suffix of its files, unique
    unsupported: Callable[[IdentifiedModel], UnsupportedFeatures]  # returns the parts of a model that it cannot hold
    # Returns the file from the model, these features, and a printable file name without suffix
    text: Callable[[IdentifiedModel, UnsupportedFeatures, str], str]

    def file_text(self, model: IdentifiedModel, unsupported: UnsupportedFeatures, stem: str) -> str:
        """Return the text of a file; `stem` may contain any characters."""
        return self.text(model, unsupported, printable(stem))


FORMATS = {
    FormatName.YAML: Format(".yaml", partial(unsupported_features, holds_actuators=True), yaml_text),
    FormatName.JSON: Format(".json", lambda model: UnsupportedFeatures((), ()), json_text),
    FormatName.PYTHON: Format(".py", unsupported_features, python_text),
    FormatName.MATLAB: Format(".m", unsupported_features, matlab_text),
    FormatName.SDF: Format(".sdf", gazebo_unsupported, gazebo_text),
    FormatName.HOLOOCEAN: Format("_holoocean.py", partial(unsupported_features, notes=HOLOOCEAN_NOTES), holoocean_text),
    FormatName.SIMULATOR: Format(
        "_simulator.py",
        partial(unsupported_features, notes=SIMULATOR_NOTES, holds_gain=True, holds_actuators=True),
        simulator_text,
    ),
    FormatName.MSS: Format("_mss.m", partial(unsupported_features, notes=MSS_NOTES), mss_text),
}


def file_stem(vehicle: str, filter_name: str) -> str:
    """Return a file name without suffix from vehicle and filter, valid also as a name in Python and MATLAB."""
    words = re.sub(r"[^a-z0-9]+", "_", vehicle.lower())[:_MAX_VEHICLE_NAME].strip("_")
    return f"{words if words[:1].isalpha() else f'vehicle_{words}'}_{filter_name}"


def check_stem(target: FormatName, stem: str) -> None:
    """Raise a ConfigError if Python or MATLAB could not use a file of that name."""
    if target in _CALLED_BY_NAME and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", stem):
        raise ConfigError(
            f"{stem!r}: not a valid name of a {target} file; expected at most 63 letters, digits and _, a letter first"
        )
