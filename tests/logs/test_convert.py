"""Conversion by a map, from tables in memory to records: columns, times, units and noise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from auvid_cli.errors import ConfigError
from tests.logs.memory_log import (
    ATTITUDE,
    DEPTH,
    DVL,
    GYROSCOPE,
    INPUTS,
    TIME,
    MemoryLog,
    dvl,
    imu,
    motion,
)


def test_si_numbers_are_unchanged(converted):
    velocity, rates, angles = motion()
    velocity[3] = np.nan
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity), "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DVL % "", ATTITUDE % "")
    assert np.array_equal(found.sensors["gyroscope"].values, rates)
    assert np.array_equal(found.sensors["dvl"].values, velocity, equal_nan=True)
    assert np.array_equal(found.sensors["attitude"].values, angles)
    assert np.array_equal(found.sensors["dvl"].time, TIME)
    assert found.sensors["dvl"].standard_deviation.tolist() == [0.01] * 3
    assert found.inputs.values[:, 3].tolist() == [0.0] * TIME.size
    assert np.array_equal(found.inputs.values[:, 0], INPUTS["dr"])
    assert next(own for own in found.summaries if own.name == "dvl").missing == 1


def test_needed_columns_of_each_table_are_read_once(converted):
    velocity, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity), "in": INPUTS, "other": INPUTS})
    reads = []
    read_all = log.read
    log.read = lambda table, columns: reads.append((table, sorted(columns))) or read_all(table, columns)
    converted(log, GYROSCOPE % "", (DVL % "").replace(", w: w", ""), (ATTITUDE % "").replace("phi: roll, ", ""))
    assert reads == [
        ("imu", ["p", "pitch", "q", "r", "t", "yaw"]),
        ("dvl", ["t", "u", "v"]),
        ("in", ["de", "dr", "force", "t"]),
    ]


def test_components_from_several_tables_are_merged(converted):
    velocity, rates, angles = motion()
    pitch = {"t": TIME[1:-1:3] + 0.01, "pitch": np.degrees(angles[1:-1:3, 1])}
    heading = {"stamp": 1e3 * TIME, "yaw": angles[:, 2]}
    log = MemoryLog(
        **{"imu": imu(rates, angles), "ahrs": pitch, "compass": heading, "dvl": dvl(velocity), "in": INPUTS}
    )
    places = (
        "theta: {column: pitch, table: ahrs, unit: deg}, "
        "psi: {column: yaw, table: compass, time: {column: stamp, unit: ms}}"
    )
    apart = (ATTITUDE % "").replace("theta: pitch, psi: yaw", places)
    found = converted(log, apart, DVL % ", position: [0.3, 0, 0]").sensors
    attitude = found["attitude"]
    assert_allclose(attitude.time, np.union1d(TIME, pitch["t"]), atol=1e-12)
    for component, of in enumerate((TIME, pitch["t"], TIME)):
        measured = np.isfinite(attitude.values[:, component])
        assert_allclose(attitude.time[measured], of, atol=1e-12)
    assert_allclose(attitude.values[np.isin(attitude.time, pitch["t"]), 1], angles[1:-1:3, 1], atol=1e-12)
    # Its own motion, by angles that are never measured at once, is taken off as by those that are.
    whole = converted(log, ATTITUDE % "", DVL % ", position: [0.3, 0, 0]").sensors["dvl"].values
    inside = np.isfinite(found["dvl"].values).all(axis=1)
    assert inside.sum() > 30
    assert_allclose(found["dvl"].values[inside], whole[inside], atol=0.02)


@pytest.mark.parametrize(("unit", "said"), [("", True), (", unit: deg", False)])
def test_probable_heading_in_degrees_is_reported(converted, unit, said):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles) | {"yaw": 180.0 + 100.0 * angles[:, 2]}, "in": INPUTS})
    found = converted(log, f"attitude: {{table: imu, columns: {{psi: yaw}}, standard_deviation: 1 deg{unit}}}")
    assert any("or degrees without a unit?" in remark for remark in found.summaries[0].remarks) == said


def test_pressure_gives_the_depth(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, angles), "depth": {"t": TIME, "z": 101325.0 + 9.81e3 * TIME}, "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DEPTH % (f", centre: 101325, scale: {1 / 9.81e3!r}", ""))
    assert found.sensors["depth"].values[:, 0] == pytest.approx(TIME, abs=1e-9)


def test_times_from_another_table_row_by_row(converted):
    _, rates, angles = motion()
    stamps = {"stamp": 5.0 + 2.0 * TIME}
    log = MemoryLog(**{"imu": imu(rates, angles, 0 * TIME), "status": stamps, "in": INPUTS | {"t": 5.0 + 2.0 * TIME}})
    found = converted(log, GYROSCOPE % ", time: {table: status, column: stamp}")
    assert found.sensors["gyroscope"].time == pytest.approx(2.0 * TIME)
    log = MemoryLog(**{"imu": imu(rates, angles), "status": {"stamp": TIME[:-1]}, "in": INPUTS})
    with pytest.raises(ConfigError, match=r"status has 39 rows.*40 rows"):
        converted(log, GYROSCOPE % ", time: {table: status, column: stamp}")


def test_noise_below_resolution_is_reported(converted):
    _, rates, angles = motion()
    log = MemoryLog(**{"imu": imu(rates, np.round(angles, 1)), "in": INPUTS})
    found = converted(log, (ATTITUDE % "").replace("0.01", "estimate"))
    assert found.sensors["attitude"].standard_deviation == pytest.approx([0.0288675] * 3, rel=1e-5)
    said = "noise smaller than the resolution, assumed to be step / sqrt(12): phi 0.1, theta 0.1, psi 0.1 rad"
    assert said in found.summaries[0].remarks


def test_one_clock_for_logs_that_begin_apart(converted):
    velocity, rates, angles = motion()
    log = MemoryLog(
        **{"imu": imu(rates, angles, TIME + 100.3), "dvl": dvl(velocity, 1e3 * (TIME + 99.0)), "in": INPUTS}
    )
    found = converted(
        log,
        GYROSCOPE % "",
        DVL % ", time: {column: t, unit: ms, offset: 1 s}",
        inputs="{table: in, time: {column: t, offset: 99.5 s}, rudder: dr}",
    )
    assert found.origin == pytest.approx(100.0)
    assert found.sensors["gyroscope"].time[0] == pytest.approx(0.3)
    assert found.sensors["dvl"].time[0] == pytest.approx(0.0)
    # The inputs begin half a second before, and what they hold then they hold at t = 0.
    assert found.inputs.time[0] == 0.0
    assert found.inputs.values[0, 0] == pytest.approx(0.1 * np.sin(0.5))


def test_disorder_is_sorted_and_reported(converted):
    _, rates, angles = motion()
    time, order = TIME.copy(), np.arange(TIME.size)
    order[[4, 5]] = 5, 4
    doubled = np.append(order, 7)
    log = MemoryLog(**{"imu": imu(rates[doubled], angles[doubled], time[doubled]), "in": INPUTS})
    found = converted(log, GYROSCOPE % "")
    assert np.array_equal(found.sensors["gyroscope"].values, rates)
    summary = found.summaries[0]
    assert summary.duplicates == 1
    assert "time went back in 2 rows, by up to 1.6 s: sorted" in summary.remarks


def test_validity_limits_and_spans(converted):
    velocity, rates, angles = motion()
    velocity[10, 1] = 9.0
    flags = np.where(np.arange(TIME.size) == 20, "False", "True")
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(velocity) | {"ok": flags}, "in": INPUTS})
    sensor = (
        "dvl: {table: dvl, columns: {u: u, v: {column: v, limits: [-5, 5 m/s]}, w: w}, standard_deviation: 0.01, "
        "valid: {column: ok}, exclude: [1.5 s, 1.6 s]}"
    )
    found = converted(log, sensor, GYROSCOPE % "", more="use: [[0.2, 1.0], [1.2, 3.0]]\nexclude: [0.3, 0.4]")
    values = dict(zip(np.round(found.sensors["dvl"].time, 3), found.sensors["dvl"].values, strict=True))
    assert min(values) == 0.2
    assert 1.1 not in values
    assert np.isnan(values[0.5]).tolist() == [False, True, False]
    assert np.isnan(values[1.0]).all()
    assert [time for time, row in values.items() if np.isnan(row).all()] == [0.3, 0.35, 0.4, 1.0, 1.5, 1.55, 1.6]
    assert found.sensors["gyroscope"].time[[0, -1]] == pytest.approx([0.2, 1.95])


def test_repeats_of_a_slower_sensor_are_dropped(converted):
    velocity, rates, angles = motion()
    held = velocity[(np.arange(TIME.size) // 4) * 4]
    log = MemoryLog(**{"imu": imu(rates, angles), "dvl": dvl(held), "in": INPUTS})
    found = converted(log, DVL % ", repeats: drop")
    assert found.sensors["dvl"].time == pytest.approx(TIME[::4])
    assert np.array_equal(found.sensors["dvl"].values, velocity[::4])


def test_unit_of_map_overrides_header(converted):
    _, rates, angles = motion()
    table = imu(np.degrees(rates), angles)
    stated = table | {name: (table[name], "Deg/s") for name in "pqr"} | {"t": (1e3 * TIME, "ms")}
    found = converted(MemoryLog(**{"imu": stated, "in": INPUTS}), GYROSCOPE % "")
    assert found.sensors["gyroscope"].values == pytest.approx(rates, abs=1e-14)
    assert found.sensors["gyroscope"].time == pytest.approx(TIME)


@pytest.mark.parametrize(("time", "said"), [("'@log_time'", True), ("'@header_stamp'", False)])
def test_worse_clock_is_reported(converted, rng, time, said):
    _, rates, angles = motion()
    clocks = {"@log_time": 1e9 + TIME + rng.uniform(0, 0.045, TIME.size), "@header_stamp": 1e9 + TIME}
    log = MemoryLog(**{"imu": imu(rates, angles) | clocks, "in": INPUTS | clocks})
    inputs = f"{{table: in, rudder: dr, time: {time}}}"
    found = converted(log, GYROSCOPE % f", time: {time}", inputs=inputs)
    for summary in found.summaries:
        remarks = [text for text in summary.remarks if "drifts from" in text]
        assert len(remarks) == said
        assert all(text.endswith("`time: '@header_stamp'` would be better") for text in remarks)


def test_gap_of_sensor_is_reported(converted):
    velocity, rates, angles = motion()
    time = np.where(TIME < 1.0, TIME, TIME + 4.0)
    log = MemoryLog(**{"imu": imu(rates, angles, time), "dvl": dvl(velocity, 0.15 * TIME / TIME[1]), "in": INPUTS})
    found = converted(log, GYROSCOPE % "", DVL % "")
    remarks = {summary.name: [text for text in summary.remarks if "gap" in text] for summary in found.summaries}
    assert remarks["gyroscope"][0].startswith("1 gap, the longest of 4.05 s from t = 0.95 s: ")
    assert remarks["dvl"] == []
