"""All export formats, with JSON and YAML written here."""

import json
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import yaml

from auvid_cli.config.enums import FormatName
from auvid_cli.config.loading import dump_experiment
from auvid_cli.errors import ConfigError
from auvid_cli.export.functions import matlab_text, mss_losses, mss_text, python_text
from auvid_cli.export.gazebo import gazebo_losses, gazebo_text
from auvid_cli.export.losses import (
    NOTHING,
    UnsupportedFeatures,
    caveats,
    heading_lines,
    line_comments,
    unsupported_features,
)
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel
from auvid_cli.export.simulators import holoocean_losses, holoocean_text, simulator_losses, simulator_text
from auvid_cli.text import printable
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETERS

SCHEMA_VERSION = 2
# Letters of a vehicle's name in that of a file: with the filter's, fewer than a function of MATLAB may have.
_LONGEST = 32
# Python imports and MATLAB calls such files by their names.
_CALLED_BY_NAME = {FormatName.PYTHON, FormatName.MATLAB, FormatName.HOLOOCEAN, FormatName.SIMULATOR, FormatName.MSS}


def json_losses(model: IdentifiedModel) -> UnsupportedFeatures:
    """Return no losses."""
    return NOTHING


def json_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Write the whole file; numbers in SI, angles in radians."""
    vehicle = model.experiment.vehicle
    parameters = vehicle.known_parameters()
    held = {
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
            "meaning": "how many times the stated surge force acts",
            "rms_of_change": model.actuation.thrust_rms,
        },
        "actuators": {
            **model.actuation.actuators.model_dump(mode="json", exclude_none=True),
            "meaning": "how fins and propeller follow their commands, SI; see the settings of a vehicle",
            "rms_of_change": model.actuation.changes,
        },
        "terms": [size._asdict() for size in model.term_sizes],
        "lost": {"terms": [size._asdict() for size in losses.terms], "notes": losses.notes},
        "provenance": model.origin._asdict() | {"settings": yaml.safe_load(dump_experiment(model.experiment))},
    }
    return json.dumps(held, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def yaml_losses(model: IdentifiedModel) -> UnsupportedFeatures:
    """Name what a vehicle file has no place for."""
    return unsupported_features(model, holds_actuators=True)


def yaml_text(model: IdentifiedModel, losses: UnsupportedFeatures, name: str) -> str:
    """Write the whole file; what was not estimated stands as in the vehicle file before."""
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
    notes = [*before["notes"], _provenance(model)]
    coefficients = {symbol: entry for symbol, entry in entries.items() if symbol in SYMBOLS}
    vehicle = before | {"notes": notes, "parameters": parameters, "coefficients": coefficients}
    terms = [_without_prior(term) | entries[term["name"]] for term in vehicle.pop("terms")]
    if terms:
        vehicle["terms"] = terms
    if not any(vehicle["actuators"].values()):
        del vehicle["actuators"]
    text = yaml.safe_dump(vehicle, sort_keys=False, width=160, default_flow_style=None, allow_unicode=True)
    return line_comments("#", heading_lines(model, losses)) + text


def _estimated(coefficient: IdentifiedCoefficient, model: IdentifiedModel) -> dict[str, Any]:
    doubt = "" if coefficient.identified else ", identified: false"
    return {
        "value": _quantity(coefficient.value, coefficient.unit),
        "standard_deviation": _quantity(coefficient.standard_deviation, coefficient.unit),
        "status": f"estimated by {model.filter}{doubt}",
        "source": f"estimate {model.origin.estimate_sha256[:12] or 'in memory'}",
    }


def _without_prior(term: dict[str, Any]) -> dict[str, Any]:
    """Return an entry without what was guessed before there were data."""
    return {key: value for key, value in term.items() if key != "prior"}


def _provenance(model: IdentifiedModel) -> str:
    origin, experiment = model.origin, model.experiment
    return (
        f"Coefficients estimated by {model.filter} ({model.judgement.grade}) with auvid {origin.auvid_version}; "
        f"{origin.estimate}, from {origin.dataset}, experiment {experiment.name}, seed {experiment.seed}."
    )


def _with_unit(entry: dict[str, Any], unit: str) -> dict[str, Any]:
    quantities = {key: _quantity(entry[key], unit) for key in ("value", "standard_deviation") if key in entry}
    return entry | quantities


def _quantity(value: float | None, unit: str) -> str | float | None:
    """Return a value as a vehicle file states it: bare where it has no dimension, as a share of the thrust."""
    return value if unit == "1" else f"{value!r} {unit}"


class Format(NamedTuple):
    """A form, and how to write it.

    Attributes
    ----------
    suffix : str
        Of its files, apart from those of the others.
    losses : callable
        What it cannot hold of a model.
    text : callable
        The file's text from the model, those losses, and the file's name without suffix, printable.
    """

    suffix: str
    losses: Callable[[IdentifiedModel], UnsupportedFeatures]
    text: Callable[[IdentifiedModel, UnsupportedFeatures, str], str]

    def file_text(self, model: IdentifiedModel, losses: UnsupportedFeatures, stem: str) -> str:
        """Return the text of a file that may be called what is no text."""
        return self.text(model, losses, printable(stem))


FORMATS = {
    FormatName.YAML: Format(".yaml", yaml_losses, yaml_text),
    FormatName.JSON: Format(".json", json_losses, json_text),
    FormatName.PYTHON: Format(".py", unsupported_features, python_text),
    FormatName.MATLAB: Format(".m", unsupported_features, matlab_text),
    FormatName.SDF: Format(".sdf", gazebo_losses, gazebo_text),
    FormatName.HOLOOCEAN: Format("_holoocean.py", holoocean_losses, holoocean_text),
    FormatName.SIMULATOR: Format("_simulator.py", simulator_losses, simulator_text),
    FormatName.MSS: Format("_mss.m", mss_losses, mss_text),
}


def file_stem(vehicle: str, filter_name: str) -> str:
    """Return a file name without suffix, from vehicle and filter; also a name for Python and MATLAB."""
    words = re.sub(r"[^a-z0-9]+", "_", vehicle.lower())[:_LONGEST].strip("_")
    return f"{words if words[:1].isalpha() else f'vehicle_{words}'}_{filter_name}"


def check_stem(target: FormatName, stem: str) -> None:
    """Raise ConfigError if a file of that name could not be used."""
    if target in _CALLED_BY_NAME and not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", stem):
        raise ConfigError(
            f"{stem!r} is no name for a {target} file, which is used by it: "
            "letters, digits and _ only, a letter first, 63 at most"
        )
