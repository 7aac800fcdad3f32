import pytest

from auvid_cli.config.enums import FormatName
from auvid_cli.config.vehicle import ActuatorSettings
from auvid_cli.export.formats import FORMATS
from auvid_cli.export.model import Actuation, EstimatedState
from auvid_cli.export.unsupported_features import unsupported_lines

STATES = (
    EstimatedState("thrust_scale", "1", 0.2, 0.0123),
    EstimatedState("current_north", "m/s", -0.25, 0.011),
    EstimatedState("bias_p", "rad/s", 3.5e-3, 1e-4),
    EstimatedState("excess_buoyancy", "N", 3.6373304, 0.02),
    EstimatedState("trim_moment", "N*m", -4.7, 0.01),
)
ACTUATORS = ActuatorSettings.model_validate(
    {"fins": {"dead_band": "0.01 rad", "time_constant": "0.1 s"}, "propeller": {"saturation": "80 N"}}
)
FOUND = Actuation(
    1.2, 14.52, ACTUATORS, {"surge_force": 0.2, "Y_uudr": 3.14, "Z_uude": 2.72, "M_uude": 1.62, "N_uudr": 0.58}
)
POOR = [name for name in FORMATS if name != FormatName.JSON]
# The others hold the actuators, or the gain as well.
WITHOUT_ACTUATORS = [name for name in POOR if name not in (FormatName.YAML, FormatName.SIMULATOR)]


@pytest.fixture(scope="module")
def model(model_with):
    return model_with(states=STATES, actuation=FOUND)


@pytest.mark.parametrize("target", WITHOUT_ACTUATORS)
def test_lossy_format_states_its_losses(target, model):
    unsupported = FORMATS[target].unsupported(model)
    text = FORMATS[target].text(model, unsupported, "model")
    expected = (
        "multiply the stated surge force by 1.2; this changes it by 14.5 N RMS along the estimated motion.",
        "put fins of dead band 0.01, time constant 0.1 and a propeller of saturation 80 between the commands and the",
        "changes surge_force by 0.2 N, Y_uudr by 3.14 N,",
        "Z_uude by 2.72 N, M_uude by 1.62 N*m, N_uudr by 0.58 N*m RMS along the estimated motion.",
        "  thrust_scale: 0.2, standard deviation 0.012",
        "  current_north: -0.25 m/s, standard deviation 0.011 m/s",
        "  bias_p: 0.0035 rad/s, standard deviation 0.0001 rad/s",
        "with it the buoyancy is B = 470 N at xB = -0.01 m, yB = 0 m, zB = 0 m.",
        "  trim_moment: -4.7 N*m, standard deviation 0.01 N*m",
    )
    for sentence in expected:
        assert sentence in "\n".join(unsupported_lines(unsupported))
        assert sentence in text


@pytest.mark.parametrize("target", POOR)
def test_losses_name_only_estimated_parts(target, model_with):
    lines = unsupported_lines(FORMATS[target].unsupported(model_with()))
    assert not [
        line
        for line in lines
        if any(word in line for word in ("propeller", "actuators", "ballast", "next to the coefficients"))
    ]


@pytest.mark.parametrize("target", POOR)
def test_covariances_are_mentioned_once(target, model):
    form = FORMATS[target]
    assert form.text(model, form.unsupported(model), "model").count("covariances") == 1


def test_vehicle_file_loses_gain_but_not_actuators(model):
    lines = " ".join(unsupported_lines(FORMATS[FormatName.YAML].unsupported(model)))
    assert "gain" in lines
    assert "actuators" not in lines
