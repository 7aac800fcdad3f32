from dataclasses import replace

import pytest
import yaml

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.export.formats import yaml_text
from auvid_cli.export.unsupported_features import unsupported_features


@pytest.fixture(scope="module")
def load_as_vehicle(tmp_path_factory):
    """Function: the settings of an experiment that names the written file as its vehicle."""

    def load(text):
        path = tmp_path_factory.mktemp("vehicle") / "identified.yaml"
        path.write_text(text, encoding="utf-8")
        return load_experiment(find_experiment(None), (f"vehicle={path}",)).vehicle

    return load


def written(model):
    return yaml_text(model, unsupported_features(model), "identified")


def test_vehicle_file_is_read_back(vehicle_file, model_with, load_as_vehicle):
    model = model_with(vehicle_file=vehicle_file)
    vehicle, before = load_as_vehicle(written(model)), model.experiment.vehicle
    assert vehicle.all_coefficients() == {each.symbol: each.value for each in model.coefficients}
    assert vehicle.parameters == before.parameters
    assert (vehicle.name, vehicle.source, vehicle.size) == (before.name, before.source, before.size)


def test_vehicle_file_has_deviations_and_origin(model_with, load_as_vehicle):
    model = model_with(held=("N_uudr",), not_identified=("Y_r|r|",))
    vehicle, before = load_as_vehicle(written(model)), model.experiment.vehicle
    entries = vehicle.coefficients
    drag = entries.X_u_u_
    assert drag.standard_deviation == model.coefficients[0].standard_deviation
    assert (drag.status, drag.source) == ("estimated by tukf", f"estimate {'e' * 12}")
    assert entries.Y_r_r_.status == "estimated by tukf, identified: false"
    assert entries.N_uudr == before.coefficients.N_uudr
    assert vehicle.notes[:-1] == before.notes
    for part in ("d" * 64, "e" * 64, "auvid 1.2.3", "experiment spiral", "seed 1"):
        assert part in vehicle.notes[-1]


def test_second_export_is_equal(model_with, load_as_vehicle):
    model = model_with(held=("N_uudr",))
    vehicle = load_as_vehicle(written(model))
    later = replace(model, experiment=model.experiment.model_copy(update={"vehicle": vehicle}))
    text = yaml_text(later, unsupported_features(later), "again")
    assert load_as_vehicle(text).coefficients == vehicle.coefficients


def test_additional_terms_are_read_back(skewed, load_as_vehicle):
    vehicle = load_as_vehicle(written(skewed))
    assert vehicle.coefficient_set == skewed.coefficient_set
    assert vehicle.all_coefficients() == {each.symbol: each.value for each in skewed.coefficients}
    deviations = {each.symbol: each.standard_deviation for each in skewed.coefficients}
    assert vehicle.stated_deviations() == deviations
    assert vehicle.terms[0].status == "estimated by tukf"


@pytest.mark.parametrize("held", [(), ("X_T",)])
def test_dimensionless_term_is_read_back(held, model_with, load_as_vehicle):
    model = model_with("vehicle.terms=[{name: X_T, row: X, factors: [thrust], value: -0.1}]", held=held)
    assert model.coefficients[-1].unit == "1"
    vehicle = load_as_vehicle(written(model))
    assert vehicle.all_coefficients() == {each.symbol: each.value for each in model.coefficients}
    assert vehicle.terms[0].standard_deviation == model.coefficients[-1].standard_deviation


def test_heading_states_losses(skewed):
    heading = [line for line in written(skewed).splitlines() if line.startswith("#")]
    assert "# No term of the equations of motion is lost." in heading
    assert any("covariances" in line for line in heading)
    keys = "name", "source", "notes", "size", "geometry", "parameters", "coefficients", "terms"
    assert tuple(yaml.safe_load(written(skewed))) == keys
