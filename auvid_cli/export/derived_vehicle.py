"""A vehicle file from size, shape and mass; numbers have standard deviation, formula and source."""

from typing import Any, get_args

import yaml

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Unit
from auvid_cli.config.vehicle import Drawing
from auvid_cli.vehicle.coefficients import COEFFICIENTS, EQUATION_ROWS, Coefficient
from auvid_cli.vehicle.geometry import DERIVED_TERMS, DerivedValue, coefficients_from_geometry
from auvid_cli.vehicle.kinematics import GRAVITY
from auvid_cli.vehicle.parameters import PARAMETERS

# Distance of the centre of gravity below that of buoyancy, as a share of the diameter: mean of four published vehicles.
_BOTTOM_HEAVINESS = 0.06
_HEAVINESS_DEVIATION = 0.03
# Standard deviation of the buoyancy of a vehicle that is ballasted to float just so, as a share of the weight.
_BUOYANCY_DEVIATION = 0.005
_UNITS = {quantity.symbol: quantity.unit for quantity in (*PARAMETERS, *COEFFICIENTS)}


def derived_vehicle_yaml(drawing: Drawing) -> str:
    """Return the vehicle file of a drawing; the vehicle is assumed to be neutrally buoyant and in trim."""
    mass, size, geometry = drawing.mass, drawing.size, drawing.geometry
    shape = geometry.shape(size.length, size.diameter, size.density)
    derived = {each.name: each for each in coefficients_from_geometry(shape, mass, geometry.speed)}
    drag, weight = -derived["X_u|u|"].mean, mass * GRAVITY
    heaviness, heaviness_deviation = (share * size.diameter for share in (_BOTTOM_HEAVINESS, _HEAVINESS_DEVIATION))
    assumed = {
        "m": _entry("m", mass, "read"),
        "W": _entry("W", weight, "derived: m times gravity"),
        "B": _entry("B", weight, "assumed: as W", _BUOYANCY_DEVIATION * weight),
        "zG": _entry("zG", heaviness, f"assumed: {_BOTTOM_HEAVINESS:g} of the diameter", heaviness_deviation),
        "X_prop": _entry("X_prop", drag * geometry.speed**2, f"derived: -X_u|u| u^2 at {geometry.speed:g} m/s"),
    }
    zeros = {quantity.symbol: _entry(quantity.symbol, 0.0, "assumed") for quantity in PARAMETERS}
    entries = zeros | assumed | {symbol: _derived_entry(each) for symbol, each in derived.items()}
    vehicle = {
        "name": drawing.name,
        "source": "hull, fins and mass alone; formulas by their numbers in auvid's theory",
        "size": _with_units(size),
        "geometry": _with_units(geometry),
        "parameters": {quantity.symbol: entries[quantity.symbol] for quantity in PARAMETERS},
        "coefficients": {coefficient.symbol: entries[coefficient.symbol] for coefficient in COEFFICIENTS},
        "terms": [_term(each) | _derived_entry(derived[each.symbol]) for each in DERIVED_TERMS],
    }
    # One line for each entry.
    return yaml.safe_dump(vehicle, sort_keys=False, width=10**6, default_flow_style=None, allow_unicode=True)


def _with_units(settings: Settings) -> dict[str, Any]:
    """Return settings with the unit of each number."""
    units = {name: _unit_in(field.rebuild_annotation()) for name, field in type(settings).model_fields.items()}
    return {name: _written(value, units[name]) for name, value in settings if value is not None}


def _written(value: Any, unit: str) -> Any:
    if isinstance(value, Settings):
        return _with_units(value)
    if isinstance(value, tuple):
        return [_written(each, unit) for each in value]
    return f"{value!r} {unit}" if unit else value


def _unit_in(annotation: Any) -> str:
    """Return the unit in a type at any depth, otherwise an empty text."""
    if isinstance(annotation, Unit):
        return annotation.unit
    return next(filter(None, map(_unit_in, get_args(annotation))), "")


def _entry(symbol: str, value: float, status: str, deviation: float | None = None) -> dict[str, Any]:
    stated = {} if deviation is None else {"standard_deviation": f"{deviation:.3g} {_UNITS[symbol]}"}
    return {"value": f"{value:.6g} {_UNITS[symbol]}", **stated, "status": status}


def _derived_entry(value: DerivedValue) -> dict[str, Any]:
    return {
        "value": f"{value.mean!r} {value.unit}",
        "standard_deviation": f"{value.standard_deviation!r} {value.unit}",
        "status": f"derived: {value.formula}",
        "source": value.source,
    }


def _term(coefficient: Coefficient) -> dict[str, Any]:
    row = EQUATION_ROWS[coefficient.row]
    return {"name": coefficient.symbol, "row": row, "factors": list(coefficient.factors)}
