"""Sound runs, and what changes them."""

from dataclasses import replace

import pytest

# Jumps of the attitude are judged by how much it moves between samples.
ATTITUDE = "sensors.attitude.rate=50 Hz"
SLOW = ATTITUDE, "sensors.accelerometer.rate=25 Hz"
MANOEUVRES = {
    "spiral": ("manoeuvre.duration=120 s", *SLOW),
    "long_spiral": ("sensors.gyroscope.rate=100 Hz", "sensors.attitude.rate=100 Hz"),
    "zigzag_20_20": (
        "manoeuvre={type: zigzag, duration: 120 s, speed: 3.9 m/s, rudder: 20 deg, heading: 20 deg, "
        "approach: 10 s, input_rate: 25 Hz}",
        *SLOW,
    ),
}


@pytest.fixture(scope="session")
def sound_run(simulated_with):
    """Function: a simulated run without any fault, from the shipped manoeuvre of that name; made once."""
    made = {}

    def run(manoeuvre="spiral", source="direct", seed=1):
        key = manoeuvre, source, seed
        if key not in made:
            made[key] = simulated_with(
                *MANOEUVRES[manoeuvre], f"sensors.attitude.source={source}", f"seed={seed}"
            ).without_truth()
        return made[key]

    return run


@pytest.fixture(scope="session")
def changed():
    """Function: the dataset with the measurements of a sensor changed by a function of times and values, in place."""

    def change(dataset, name, function):
        record = dataset.sensors[name]
        time, values = record.time.copy(), record.values.copy()
        function(time, values)
        return replace(dataset, sensors=dataset.sensors | {name: replace(record, time=time, values=values)})

    return change
