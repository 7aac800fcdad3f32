"""The suggested map takes the clock that measured, and the import refuses clocks that no log has."""

import re

import numpy as np
import pytest
import yaml

import auvid_cli as auvid
from auvid_cli.api.data import suggest_map
from auvid_cli.config.enums import shipped_configs
from auvid_cli.errors import AuvidError
from tests.logs.suggest.test_evidence import TIME, TRUTH

EPOCH = 1_718_000_000.0  # s
SIGNALS = {name: TRUTH[name] for name in ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "down", "rudder")}


@pytest.fixture
def imported(tmp_path):
    """Function: suggest a map for columns, and import by it; returns the time in the map and the dataset."""

    def run(times, changes=(), signals=SIGNALS):
        columns = times | signals
        log = tmp_path / "dive.csv"
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        log.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]))
        text = suggest_map([log], tmp_path, shipped_configs() / "vehicles" / "vt690.yaml")
        time = yaml.safe_load(text)["sensors"]["gyroscope"]["time"]
        text = re.sub("standard_deviation: null", "standard_deviation: estimate", text)
        for old, new in changes:
            text = text.replace(old, new)
        path = tmp_path / "map.yaml"
        path.write_text(text)
        return time, lambda: auvid.import_logs(path)

    return run


def check(dataset, rows=slice(None)):
    record = dataset.sensors["gyroscope"]
    assert record.time == pytest.approx(TIME[rows] - TIME[rows][0], abs=1e-4)
    assert record.values[:, 2] == pytest.approx(TRUTH["r"][rows])


@pytest.mark.slow
def test_seconds_and_nanoseconds_are_joined(imported):
    whole = np.floor(TIME + 1e-9)
    stamps = {"stamp.sec": EPOCH + whole, "stamp.nanosec": np.round(1e9 * (TIME - whole))}
    time, run = imported(stamps)
    assert time == {"column": "stamp.sec", "nanoseconds": "stamp.nanosec"}
    check(run())


@pytest.mark.slow
def test_stamp_is_preferred_to_time_of_reception(imported):
    received = EPOCH + np.sort(TIME + 5.5 + 0.1 * np.random.default_rng(1).uniform(size=TIME.size))
    time, run = imported({"time": received, "header.stamp": EPOCH + TIME})
    assert time["column"] == "header.stamp"
    check(run())


@pytest.mark.slow
def test_interval_is_no_time(imported):
    time, run = imported({"time": np.full(TIME.size, 100.0), "time_of_validity": 1e6 * (EPOCH + TIME)})
    assert time == {"column": "time_of_validity", "unit": "us"}
    check(run())


@pytest.mark.slow
def test_days_of_matlab_are_recognised(imported):
    time, run = imported({"time": 739413.0 + TIME / 86400.0})
    assert time["unit"] == "day"
    check(run())


@pytest.mark.slow
def test_days_taken_as_seconds_are_refused(imported):
    _, run = imported({"time": 739413.0 + TIME / 86400.0}, [("unit: day", "unit: s"), (", offset: -719529 day", "")])
    with pytest.raises(AuvidError, match=r"rows every .* check its `unit`"):
        run()


@pytest.mark.slow
def test_rows_that_share_a_second_are_refused(imported):
    _, run = imported({"time": np.floor(TIME)})
    with pytest.raises(AuvidError, match="share a time stamp"):
        run()


@pytest.mark.slow
def test_restarted_clock_asks_for_a_run(imported):
    times = {"time": np.concatenate((TIME[:1200], TIME[:800]))}
    time, run = imported(times)
    assert time["run"] is None
    with pytest.raises(AuvidError, match=r"sensors\.gyroscope\.time\.run"):
        run()
    _, run = imported(times, [("run: null", "run: 2")])
    check(run(), slice(1200, None))
    _, run = imported(times, [(", run: null", "")])
    with pytest.raises(AuvidError, match="starts again in row 1201"):
        run()


@pytest.mark.slow
def test_repeated_header_is_skipped(imported, tmp_path):
    _, run = imported({"time": TIME})
    log = tmp_path / "dive.csv"
    lines = log.read_text().splitlines()
    log.write_text("\n".join([*lines[:500], lines[0], *lines[500:]]))
    dataset = run()
    check(dataset)


@pytest.mark.slow
@pytest.mark.parametrize("code", [-32.768, -9999.0, 999.0])
def test_codes_without_measurement_are_no_evidence(imported, code):
    lost = np.arange(TIME.size) % 50 == 7
    signals = SIGNALS | {name: np.where(lost, code, SIGNALS[name]) for name in "uvw"}
    _, run = imported({"time": TIME}, signals=signals)
    values = run().sensors["dvl"].values
    assert np.isnan(values[lost]).all()
    assert values[~lost, 0] == pytest.approx(TRUTH["u"][~lost])


@pytest.mark.slow
def test_zeros_in_all_beams_are_missing(imported):
    lost = np.arange(TIME.size) % 50 == 7
    _, run = imported({"time": TIME}, signals=SIGNALS | {name: np.where(lost, 0.0, SIGNALS[name]) for name in "uvw"})
    assert np.isnan(run().sensors["dvl"].values[lost]).all()
