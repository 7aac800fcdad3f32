import json

import numpy as np

from auvid_cli.config.enums import FormatName
from auvid_cli.config.loading import parse_experiment
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.export.formats import FORMATS, json_text
from auvid_cli.export.model import Actuation, EstimatedState
from auvid_cli.export.unsupported_features import unsupported_lines

LAGGING = ActuatorSettings.model_validate({"fins": {"time_constant": "0.1 s"}})


def written(model):
    return json.loads(json_text(model, FORMATS[FormatName.JSON].unsupported(model), "identified"))


def test_json_is_complete(model_with):
    model = model_with(held=("N_uudr",), not_identified=("Y_r|r|",))
    held = written(model)
    assert {symbol: entry["value"] for symbol, entry in held["coefficients"].items()} == {
        each.symbol: each.value for each in model.coefficients
    }
    known = model.experiment.vehicle.known_parameters()
    assert {symbol: entry["value"] for symbol, entry in held["parameters"].items()} == known
    assert held["parameters"]["m"]["unit"] == "kg"
    drag, rudder = held["coefficients"]["X_u|u|"], held["coefficients"]["N_uudr"]
    assert (drag["unit"], drag["estimated"], drag["identified"]) == ("kg/m", True, True)
    assert (rudder["standard_deviation"], rudder["estimated"], rudder["identified"]) == (None, False, None)
    assert held["coefficients"]["Y_r|r|"]["identified"] is False
    assert "Y_r|r|" in held["doubts"][0]
    assert (held["filter"], held["status"]) == ("tukf", "sound")


def test_covariance_is_in_the_order_of_the_estimate(model_with):
    model = model_with(held=("X_u|u|", "N_uudr"))
    covariance = written(model)["covariance"]
    assert tuple(covariance["order"]) == tuple(c.symbol for c in model.coefficients)[1:-1]
    assert np.array_equal(covariance["values"], model.covariance)


def test_json_has_states_gain_and_lag(model_with):
    states = EstimatedState("thrust_scale", "1", 0.2, 0.01), EstimatedState("bias_q", "rad/s", -3e-3, 1e-4)
    model = model_with(held=("X_u|u|",), states=states, actuation=Actuation(1.2, 14.5, LAGGING, {"N_uudr": 2.5}))
    held = written(model)
    assert held["states"]["thrust_scale"] == {"value": 0.2, "unit": "1", "standard_deviation": 0.01}
    assert held["states"]["bias_q"] == {"value": -3e-3, "unit": "rad/s", "standard_deviation": 1e-4}
    assert (held["thrust"]["value"], held["thrust"]["rms_of_change"]) == (1.2, 14.5)
    assert held["actuators"]["fins"] == {"time_constant": 0.1}
    assert held["actuators"]["rms_of_change"] == {"N_uudr": 2.5}
    assert held["covariance"]["order"][-3:] == ["N_uudr", "thrust_scale", "bias_q"]
    assert np.shape(held["covariance"]["values"]) == (23, 23)
    assert unsupported_lines(FORMATS[FormatName.JSON].unsupported(model)) == ["Nothing is lost."]


def test_settings_are_those_of_the_estimate(model_with):
    model = model_with()
    provenance = written(model)["provenance"]
    assert parse_experiment(json.dumps(provenance["settings"]), "test") == model.experiment
    assert provenance["dataset_sha256"] == "d" * 64
    assert provenance["estimate_sha256"] == "e" * 64


def test_json_loses_nothing(model_with):
    model = model_with()
    assert written(model)["lost"] == {"terms": [], "notes": []}
    assert unsupported_lines(FORMATS[FormatName.JSON].unsupported(model)) == ["Nothing is lost."]
