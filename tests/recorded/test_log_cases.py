"""Small logs in the form of public reports: each gives the true motion, a map that asks, or a refusal.

`python tests/recorded/test_log_cases.py [FOLDER...]` prints the outcome of each.
"""

import os
import re
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import auvid_cli as auvid
from auvid_cli.angles import wrap
from auvid_cli.api.data import suggest_map
from auvid_cli.config.shipped import shipped_configs
from auvid_cli.errors import AuvidError
from auvid_cli.vehicle.parameters import SENSORS

SHARED = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[2].parent / "shared"))
CASES = SHARED / "cases"
# Units of the logs of another motion, by sensor; all other logs are compared with the true motion.
UNITS = {
    "dvl_called_knots": {"dvl": "m/s", "gyroscope": "rad/s", "attitude": "rad", "depth": "m"},
    "depth_called_feet": {"gyroscope": "rad/s", "attitude": "rad", "depth": "m"},
    "gyro_in_degrees": {"gyroscope": "deg/s", "attitude": "deg"},
    "heading_to_two_pi": {"gyroscope": "rad/s", "attitude": "rad", "depth": "m"},
}
# Folders in which each file is a log of its own.
SINGLE = ("bom_and_utf16", "dataflash_text", "european_csv", "lsf", "mat_datenum", "python_logging_time", "ros_bags")
MAX_ERROR = 0.3  # share of the spread of a signal


def logs():
    """Return the files of each log by its name."""
    found = {}
    for folder in sorted(path for path in CASES.glob("*") if path.is_dir()):
        files = sorted(path for path in folder.iterdir() if path.suffix != ".yaml")
        if not files:
            continue
        if folder.name in SINGLE:
            found |= {f"{folder.name}/{file.name}": (file,) for file in files}
        elif folder.name == "imu_g_and_degrees":
            rest = tuple(file for file in files if not file.name.startswith("imu"))
            found |= {f"{folder.name}/{file.name}": (file, *rest) for file in files if file not in rest}
        else:
            found[folder.name] = tuple(files)
    return found


@cache
def truth():
    """Return times and values of the true motion by symbol."""
    dataset = auvid.simulate(auvid.load_experiment("spiral", "manoeuvre=manoeuvres/doublets.yaml", "seed=3"))
    record = dataset.truth
    symbols = "u", "v", "w", "p", "q", "r", "phi", "theta", "psi"
    motion = dict(zip(symbols, record.motion.T, strict=True)) | {"down": record.position[:, 2]}
    return record.time, motion


def outcome(name, files):
    """Return ``right``, ``asks: ...``, ``refused: ...`` or ``WRONG: ...`` for a log."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            text = suggest_map(list(files), Path(folder))
        except AuvidError as error:
            return f"refused: {str(error).splitlines()[0]}"
        found = yaml.safe_load(text)
        wrong = []
        for sensor, unit in UNITS.get(name.split("/")[0], {}).items():
            stated = (found["sensors"] or {}).get(sensor, {}).get("unit")
            if stated not in (None, unit):
                wrong.append(f"{sensor} {stated}")
        if wrong:
            return f"WRONG: {', '.join(wrong)}"
        asks = open_questions(text)
        if asks:
            return f"asks: {', '.join(asks)}"
        text = re.sub(r"(?s)vehicle: ?#?.*?\nlogs:", f"vehicle: {shipped_configs()}/vehicles/vt690.yaml\nlogs:", text)
        text = re.sub(r"standard_deviation: null[^\n]*", "standard_deviation: estimate", text)
        text = re.sub(r"a: null[^\n]*", "a: 0.05 N*s^2", text)
        text = re.sub(r"full: null[^\n]*", "full: 20 N", text)
        path = Path(folder) / "map.yaml"
        path.write_text(text, encoding="utf-8")
        try:
            dataset = auvid.import_logs(path)
        except AuvidError as error:
            return f"refused: {' '.join(str(error).split())[:300]}"
        if name.split("/")[0] in UNITS:
            return "right"
        errors = wrong_signals(dataset)
        return f"WRONG: {', '.join(errors)}" if errors else f"right: {', '.join(dataset.sensors)}"


def open_questions(text):
    """Return the open keys of a suggested map, except for the vehicle, noise and thrust, which no log shows."""
    asks, path = [], []
    for line in text.partition("\nlogs:")[2].splitlines():
        match = re.match(r"( *)([\w.]+): ?(.*)", line)
        if match is None:
            if "required:" in line:
                asks.append(line.strip())
            continue
        path = [*path[: len(match[1]) // 2], match[2]]
        if re.match(r"null #|.*: null[,}]", match[3]) and match[2] not in ("standard_deviation", "a", "full"):
            asks.append(".".join(path))
    return asks


def wrong_signals(dataset):
    """Return the signals that differ from the true motion."""
    (time, motion), wrong = truth(), []
    for name, record in dataset.sensors.items():
        for quantity, values in zip(SENSORS[name], record.values.T, strict=True):
            if name not in ("gyroscope", "dvl", "attitude", "depth") or not np.isfinite(values).any():
                continue
            expected = np.interp(record.time, time, motion[quantity.symbol])
            error = values - expected
            if quantity.unit == "rad":
                error = wrap(error)
            if quantity.symbol == "psi":
                # Where a heading counts from does not matter for the motion, and no log shows it.
                error = error - np.nanmedian(error)
            inside = (record.time > 1.0) & (record.time < time[-1] - 1.0)
            if not np.sqrt(np.nanmean(np.square(error[inside]))) < MAX_ERROR * np.std(expected) + 0.01:
                wrong.append(quantity.symbol)
        share = np.isfinite(record.values).any(axis=1).sum() / record.time.size
        if record.time[-1] < 0.9 * time[-1]:
            wrong.append(f"{name} ends at {record.time[-1]:.4g} s")
        if share < 0.5:
            wrong.append(f"{name} has values in {share:.0%} of its rows")
    return wrong


@pytest.mark.recorded
@pytest.mark.skipif(not CASES.is_dir(), reason="the logs do not ship with auvid")
@pytest.mark.parametrize("name", logs())
def test_log_gives_true_motion_or_question_or_refusal(name):
    assert not outcome(name, logs()[name]).startswith("WRONG")


if __name__ == "__main__":
    for case, paths in logs().items():
        if len(sys.argv) == 1 or case.split("/")[0] in sys.argv[1:]:
            print(f"{case}: {outcome(case, paths)}", flush=True)
