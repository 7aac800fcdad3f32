"""An identified model as JSON, with everything that is known of it."""

import json

import yaml

from auvid_cli.config.load import dump_experiment
from auvid_cli.export.heading import reservations
from auvid_cli.export.losses import NOTHING, Losses
from auvid_cli.export.model import IdentifiedModel
from auvid_cli.vehicle.parameters import PARAMETERS

SCHEMA_VERSION = 2


def json_losses(model: IdentifiedModel) -> Losses:
    """Return no losses."""
    return NOTHING


def json_text(model: IdentifiedModel, losses: Losses, name: str) -> str:
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
        "doubts": reservations(model),
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
