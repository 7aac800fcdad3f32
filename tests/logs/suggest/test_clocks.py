"""Clocks of several logs: the suggested map moves those that show how far, and asks for the others."""

import numpy as np
import pytest
import yaml

from auvid_cli.api.data import suggest_map
from tests.logs.suggest.test_evidence import TIME, TRUTH

EPOCH = 1_718_000_000.0  # s
MOTION = ("p", "q", "r", "phi", "theta", "psi")


def written(folder, name, times, symbols):
    columns = times | {symbol: TRUTH[symbol] for symbol in symbols}
    rows = zip(*(list(values) for values in columns.values()), strict=True)
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
    return folder / f"{name}.csv"


@pytest.fixture
def suggested(tmp_path):
    """Function: return the times of the gyroscope and the DVL in a map for two logs."""

    def run(imu, dvl):
        logs = [written(tmp_path, "imu", imu, MOTION), written(tmp_path, "dvl", dvl, ("u", "v", "w"))]
        text = suggest_map(logs, tmp_path)
        sensors = yaml.safe_load(text)["sensors"]
        return sensors["gyroscope"]["time"], sensors["dvl"]["time"], text

    return run


def clock(seconds, hours=True):
    return [f"{int(s // 3600):02}:" * hours + f"{int(s % 3600 // 60):02}:{s % 60:05.2f}" for s in seconds]


@pytest.mark.slow
def test_clock_without_hours_is_moved_by_whole_hours(suggested):
    gyroscope, dvl, _ = suggested({"t": clock(43_110.0 + TIME, hours=False)}, {"t": clock(43_110.0 + TIME)})
    assert gyroscope["offset"] == "39600 s"
    assert "offset" not in dvl


@pytest.mark.slow
def test_time_of_day_is_moved_by_whole_days(suggested):
    _, dvl, _ = suggested({"t": EPOCH + TIME}, {"t": clock(EPOCH % 86_400.0 + TIME)})
    assert dvl["offset"] == f"{EPOCH // 86_400.0 * 86_400.0:.0f} s"


@pytest.mark.slow
def test_clock_since_boot_asks_for_its_offset(suggested):
    gyroscope, dvl, text = suggested({"TimeUS": 93_200_000 + 1e6 * TIME}, {"utc": EPOCH + TIME})
    asked, other = (gyroscope, dvl) if "offset" in gyroscope else (dvl, gyroscope)
    assert asked["offset"] is None
    assert "offset" not in other
    assert f"{abs(EPOCH - 93.2):.3f} s if it begins with the others" in text


@pytest.mark.slow
def test_column_that_overlaps_the_other_log_is_the_clock(suggested):
    gyroscope, dvl, _ = suggested({"time": 93.2 + TIME, "utc": EPOCH + TIME}, {"t": EPOCH + TIME})
    assert gyroscope["column"] == "utc"
    assert "offset" not in gyroscope
    assert "offset" not in dvl


@pytest.mark.slow
def test_even_clock_is_preferred_to_uneven_one(suggested):
    late = EPOCH + TIME + np.random.default_rng(3).uniform(0.0, 0.09, TIME.size)
    gyroscope, *_ = suggested({"time": np.sort(late), "t_sensor": EPOCH + TIME}, {"t": EPOCH + TIME})
    assert gyroscope["column"] == "t_sensor"


@pytest.mark.slow
def test_offset_of_days_and_delay_are_added(tmp_path):
    # The MATLAB count of days, and a gyroscope that is half a second late.
    days = 739_413.0 + TIME / 86_400.0
    logs = [
        written(tmp_path, "imu", {"t": days + 0.5 / 86_400.0}, ("p", "q", "r")),
        written(tmp_path, "ahrs", {"t": days}, ("phi", "theta", "psi")),
    ]
    sensors = yaml.safe_load(suggest_map(logs, tmp_path))["sensors"]
    offsets = [str(sensors[name]["time"]["offset"]) for name in ("gyroscope", "attitude")]
    assert "-719529 day" in offsets
    moved = next(float(text.removesuffix(" s")) for text in offsets if text.endswith(" s"))
    assert abs(moved + 719_529 * 86_400.0) == pytest.approx(0.5, abs=0.06)
