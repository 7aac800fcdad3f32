"""An identified model as a vehicle file, which an experiment can name."""

from typing import Any

import yaml

from auvid_cli.export.comment import line_comments
from auvid_cli.export.heading import heading_lines
from auvid_cli.export.losses import Losses, losses_of
from auvid_cli.export.model import IdentifiedCoefficient, IdentifiedModel
from auvid_cli.vehicle.coefficients import SYMBOLS
from auvid_cli.vehicle.parameters import PARAMETERS


def yaml_losses(model: IdentifiedModel) -> Losses:
    """Name what a vehicle file has no place for."""
    return losses_of(model, holds_actuators=True)


def yaml_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
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
