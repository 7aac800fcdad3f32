import pytest

from auvid_cli.config.loading import dump_experiment, parse_experiment
from auvid_cli.errors import ConfigError

ENTRY = "vehicle.coefficients.M_w|w|="


def test_standard_deviation_has_unit_of_value(text):
    experiment = parse_experiment(text, "test", (f"{ENTRY}{{value: -3.2 kg, standard_deviation: 250 g}}",))
    entry = experiment.vehicle.coefficients.M_w_w_
    assert (entry.value, entry.standard_deviation) == (-3.2, 0.25)
    assert parse_experiment(dump_experiment(experiment), "test") == experiment


@pytest.mark.parametrize("wrong", ["0 kg", "-1 kg", "1 m"])
def test_invalid_standard_deviation_raises(wrong, text):
    with pytest.raises(ConfigError, match="standard_deviation"):
        parse_experiment(text, "test", (f"{ENTRY}{{value: -3.2 kg, standard_deviation: {wrong}}}",))


def test_parameter_may_have_standard_deviation(text):
    override = "vehicle.parameters.Ixx={value: 0.177 kg*m^2, standard_deviation: 0.01 kg*m^2}"
    parameters = parse_experiment(text, "test", (override,)).vehicle.parameters
    assert parameters.Ixx.standard_deviation == 0.01
    assert parameters.Iyy.standard_deviation is None
