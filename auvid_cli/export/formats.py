"""All export formats; this module writes JSON and YAML itself."""

import json
import re
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import yaml

from auvid_cli.config.enums import FormatName
from auvid_cli.config.loading import dump_experiment
from auvid_cli.errors import ConfigError
from auvid_cli.export.functions import MSS_NOTES, matlab_text, mss_text, python_text
from auvid_cli.export.gazebo import gazebo_losses, gazebo_text
from auvid_cli.export.losses import (
    UnsupportedFeatures,
    caveats,
    heading_lines,
    line_comments,
    unsupported_features,
)
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel
from auvid_cli.export.simulators import HOLOOCEAN_NOTES, SIMULATOR_NOTES, holoocean_text, simulator_text
from auvid_cli.text import printable
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETERS

SCHEMA_VERSION = 2
# Length of the vehicle in the name of a file, so that it is a valid name of a MATLAB function.
_MAX_VEHICLE_NAME = 32
# Python imports and MATLAB calls these files by name.
_CALLED_BY_NAME = {FormatName.PYTHON, FormatName.MATLAB, FormatName.HOLOOCEAN, FormatName.SIMULATOR, FormatName.MSS}


def json_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
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
        "lost": {"terms": [size._asdict() for size in losses.terms], "notes": losses.notes},
        "provenance": model.origin._asdict() | {"settings": yaml.safe_load(dump_experiment(model.experiment))},
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def yaml_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
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
    return line_comments("#", heading_lines(model, losses)) + text


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
    losses: Callable[[IdentifiedModel], UnsupportedFeatures]  # returns the parts of a model that it cannot hold
    # Returns the file from the model, these losses, and a printable file name without suffix
    text: Callable[[IdentifiedModel, UnsupportedFeatures, str], str]

    def file_text(self, model: IdentifiedModel, losses: UnsupportedFeatures, stem: str) -> str:
        """Return the text of a file; `stem` may contain any characters."""
        return self.text(model, losses, printable(stem))


FORMATS = {
    FormatName.YAML: Format(".yaml", partial(unsupported_features, holds_actuators=True), yaml_text),
    FormatName.JSON: Format(".json", lambda model: UnsupportedFeatures((), ()), json_text),
    FormatName.PYTHON: Format(".py", unsupported_features, python_text),
    FormatName.MATLAB: Format(".m", unsupported_features, matlab_text),
    FormatName.SDF: Format(".sdf", gazebo_losses, gazebo_text),
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
