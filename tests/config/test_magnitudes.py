import pytest

from auvid_cli.config.loading import find_experiment, load_experiment
from auvid_cli.config.units import check_amount, magnitude_of
from auvid_cli.errors import ConfigError


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("identification.integration_step=1e-30", "must be at least 1e-05 s"),
        ("sensors.dvl.noise=1e-200", "must be at least 1e-12 m/s if it is not 0"),
        ("sensors.dvl.bias=1e155", "must be at most 1e.06 m/s in size"),
        ("sensors.gyroscope.drift=[0, 0, 1e99]", "component 3: must be at most 1e.06 rad/s/s.0.5"),
        ("vehicle.size.length=1e5", "must be at most 1000 m"),
        ("identification.ukf.alpha=1e-200", "must be at least 0.0001"),
        ("identification.estimate.gyro.spread=1e300", "must be at most 1e.06 rad/s in size"),
        ("identification.process_noise.rate=1e-200", "must be at least 1e-12 rad/s.2/Hz.0.5"),
        ("identification.prior.standard_deviation={Y_url: 1e30}", "must be at most 1e.20 kg/rad"),
        ("identification.prior.factor=1e9", "must be at most 1e.06"),
        ("manoeuvre.current_north=1e9", "must be at most 1e.06 m/s in size"),
        ("manoeuvre.speed=500", "must be at most 100 m/s"),
        ("manoeuvre.excitation.rudder.amplitude=1e-100", "must be at least 1e-12 rad"),
        ("vehicle.coefficients.Y_url=1e30", "must be at most 1e.20 kg/rad"),
    ],
)
def test_implausible_size_raises_with_limit(override, message):
    with pytest.raises(ConfigError, match=message):
        load_experiment(find_experiment(None), [override])


def test_zero_amount_is_valid():
    assert check_amount(0.0, "m") == 0.0
    assert check_amount(magnitude_of("m").smallest, "m") == 1e-12
    assert load_experiment(find_experiment(None), ["sensors.dvl.drift=0"]).sensors.dvl.drift == (0.0,)
