"""Maps that do not fit their log."""

import numpy as np
import pytest

from auvid_cli.errors import ConfigError
from tests.logs.memory_log import (
    ATTITUDE,
    DEPTH,
    DVL,
    GYROSCOPE,
    INPUT_MAP,
    INPUTS,
    TIME,
    MemoryLog,
    dvl,
    imu,
    motion,
)


@pytest.mark.parametrize(
    ("sensors", "inputs", "message"),
    [
        ([DVL % ", frame: NED"], INPUT_MAP, "sensors.dvl.frame: NED velocities need an `attitude`"),
        ([DVL % ", position: [1, 0, 0]"], INPUT_MAP, "sensors.dvl.position: a lever arm needs a `gyroscope` or"),
        ([DEPTH % ("", ", position: [1, 0, 0]")], INPUT_MAP, "sensors.depth.position: a lever arm needs an `attitude`"),
        (
            [(ATTITUDE % "").replace("theta: pitch, ", ""), DEPTH % ("", ", position: [1, 0, 0]")],
            INPUT_MAP,
            "sensors.depth.position: a lever arm needs an `attitude` with pitch",
        ),
        ([DEPTH % ("", ", position: [1, 0]")], INPUT_MAP, "expected [forward, starboard, down]"),
        (
            [(GYROSCOPE % "").replace("p: p, ", ""), DVL % ", position: [1, 0, 0]"],
            INPUT_MAP,
            "sensors.dvl.position: a lever arm needs a `gyroscope` or an `attitude` of pitch and heading",
        ),
        (
            [(GYROSCOPE % "").replace("p: p", "p: pp")],
            INPUT_MAP,
            "columns.p: memory: no column in imu named 'pp'",
        ),
        (
            [(GYROSCOPE % "").replace("imu", "imo")],
            INPUT_MAP,
            "table: memory: no table named 'imo'; expected 'imu'",
        ),
        ([(GYROSCOPE % "").replace("p: p", "p: flag")], INPUT_MAP, "has text; expected numbers"),
        ([(GYROSCOPE % ", log: b")], INPUT_MAP, "sensors.gyroscope.log: no log named 'b'"),
        ([GYROSCOPE % ", time: zero"], INPUT_MAP, "sensors.gyroscope.time: 'zero' never changes"),
        ([GYROSCOPE % ", time: flag"], INPUT_MAP, "sensors.gyroscope.time: 'x' is not a time"),
        ([GYROSCOPE % ", time: {column: t, offset: 1 h}", DVL % ""], INPUT_MAP, "no time in common: gyroscope is from"),
        ([GYROSCOPE % ", exclude: [0, 1 h]"], INPUT_MAP, "no valid samples"),
        ([GYROSCOPE % ", unit: turn/ms"], INPUT_MAP, "sensors.gyroscope: reaches"),
        ([(ATTITUDE % ", mount: backward").replace("phi: roll, ", "")], INPUT_MAP, "all three angles"),
        ([(GYROSCOPE % "").replace("0.01", "estimate").replace("p: p", "p: zero")], INPUT_MAP, "repeat the one before"),
        ([(GYROSCOPE % "").replace("p: p", "p: inches")], INPUT_MAP, "the log states the unit 'inch' of 'inches'"),
        ([GYROSCOPE % ""], "{table: in, rudder: {column: dr, scale: 100}}", "inputs.rudder: deflects"),
        (
            [GYROSCOPE % ""],
            "{table: in, rudder: {column: dr, time: {column: t, offset: 1 h}}}",
            "no time in common with",
        ),
        (
            [GYROSCOPE % ""],
            "{rudder: dr}",
            "inputs.rudder: missing key 'table': one of those in memory: imu, dvl, depth, in",
        ),
        (
            [GYROSCOPE % ""],
            "{table: in, thrust: {revolutions: {column: dr, unit: rpm}, a: 1, b: -1}}",
            "needs the speed",
        ),
    ],
)
def test_map_that_does_not_fit_log_raises_config_error(converted, sensors, inputs, message):
    velocity, rates, angles = motion()
    table = imu(rates, angles) | {"zero": 0 * TIME, "flag": np.full(TIME.size, "x"), "inches": (TIME, "inch")}
    log = MemoryLog(**{"imu": table, "dvl": dvl(velocity), "depth": {"t": TIME, "z": TIME}, "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, *sensors, inputs=inputs)
    assert message in str(caught.value)


def test_same_error_is_reported_once(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, GYROSCOPE % "", inputs=INPUT_MAP.replace("table: in", "table: in, time: tt"))
    assert str(caught.value).count("no column in in named 'tt'") == 1


def test_log_without_rows_is_reported_once(converted):
    empty = {name: values[:0] for name, values in (imu(TIME[:, None] * np.ones(3), TIME[:, None] * np.ones(3))).items()}
    with pytest.raises(ConfigError) as caught:
        converted(MemoryLog(**{"imu": empty, "in": INPUTS}), GYROSCOPE % "", ATTITUDE % "")
    assert str(caught.value).count("logs.log: imu has no rows") == 1


def test_all_errors_are_reported_with_positions(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "in": INPUTS})
    with pytest.raises(ConfigError) as caught:
        converted(log, (GYROSCOPE % "").replace("q: q", "q: qq"), (ATTITUDE % "").replace("pitch", "pich"), DVL % "")
    message = str(caught.value)
    assert "map.yaml:7:46: sensors.gyroscope.columns.q: memory: no column in imu named 'qq'" in message
    assert "no column in imu named 'pich'; expected 'pitch'" in message
    assert "sensors.dvl.table: memory: no table named 'dvl'" in message
