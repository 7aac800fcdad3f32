"""Small logs in the form of public reports: each gives the true motion once its questions are answered, or advice.

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
from auvid_cli.api.data import suggest_map
from auvid_cli.arrays import wrap
from auvid_cli.config.enums import shipped_configs
from auvid_cli.errors import AuvidError
from auvid_cli.vehicle.parameters import SENSORS
from auvid_cli.vehicle.rigid_body import GRAVITY

SHARED = Path(os.environ.get("AUVID_SHARED", Path(__file__).parents[2].parent / "shared"))
CASES = SHARED / "cases"
SI = {"dvl": "m/s", "gyroscope": "rad/s", "attitude": "rad", "depth": "m", "accelerometer": "m/s^2"}
# Units of the logs that the log does not state, if they are not SI.
UNITS = {
    "gyro_in_degrees": SI | {"gyroscope": "deg/s", "attitude": "deg"},
    "imu_g_and_degrees": SI | {"gyroscope": "deg/s", "attitude": "deg", "accelerometer": "g"},
}
# Logs of another motion: only their units are known.
OTHER_MOTION = ("dvl_called_knots", "depth_called_feet", "gyro_in_degrees", "heading_to_two_pi")
# Logs from which no dataset follows: words of the advice. Some have no inputs, no names or a mixture of dates.
ADVICE = {
    "git_lfs_pointer": "git lfs pull",
    "whole_seconds": "fractions of a second",
    "european_csv/fahrt_us.csv": "state the `format`",
    "mat_datenum/run_rows.mat": "have no names",
    "mat_one_sample_short": "add the log with the commands",
    "ros2_echo_csv": "add the log with the commands",
    "ros_array_first_empty": "have no names",
}
# Where a heading counts from does not matter for the motion, and no log shows it.
HEADING_FROM = {"quat_nwu": 0.5 * np.pi}  # rad
# Logs without inputs whose sensors are compared; those of ros2_echo_csv contradict the axes of their messages.
NO_INPUTS = ("mat_one_sample_short",)
# Ends of logs that are cut, or of two runs, of which the first is taken, s.
ENDS = {"restarted_clock": 60.0, "restarted_clock2": 60.0, "restarted_logger": 60.0, "lsf/Data_cut.lsf.gz": 96.0}
# Logs without thrust, or with a share that belongs to no force.
NO_THRUST = ("clock_without_hours", "dataflash_text", "moos_thrust_and_turn_rate")
OFFSET = re.compile(r"offset: null(?P<rest>.*?)(?P<hint>-?[\d.]+ s) if it begins with the others")
# Folders in which each file is a log of its own.
SINGLE = ("bom_and_utf16", "dataflash_text", "european_csv", "lsf", "mat_datenum", "python_logging_time", "ros_bags")
MAX_ERROR = 0.3  # share of the spread of a signal
MIN_RATE = 4.0  # rows per second
# Answers that no log shows: noise, thrust of the propeller, and which run is wanted.
ANSWERS = {"standard_deviation": "estimate", "a": "0.1 N*s^2", "full": "300 N", "run": "1", "scale": "0.075 deg"}


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
    """Return times and values of the true motion, specific force and inputs by symbol."""
    dataset = auvid.simulate(auvid.load_experiment("spiral", "manoeuvre=manoeuvres/doublets.yaml", "seed=3"))
    record = dataset.truth
    symbols = "u", "v", "w", "p", "q", "r", "phi", "theta", "psi"
    motion = dict(zip(symbols, record.motion.T, strict=True)) | {"down": record.position[:, 2]}
    u, v, w, p, q, r, phi, theta, _ = record.motion.T
    rate = {symbol: np.gradient(motion[symbol], record.time) for symbol in "uvw"}
    # Acceleration in the turning body axes less gravity.
    motion |= {
        "fx": rate["u"] + q * w - r * v + GRAVITY * np.sin(theta),
        "fy": rate["v"] + r * u - p * w - GRAVITY * np.cos(theta) * np.sin(phi),
        "fz": rate["w"] + p * v - q * u - GRAVITY * np.cos(theta) * np.cos(phi),
    }
    inputs = dataset.inputs
    commands = {quantity.symbol: values for quantity, values in zip(inputs.quantities, inputs.values.T, strict=True)}
    return record.time, motion, inputs.time, commands


def answered(name, text):
    """Return a map with the answers of a user who knows the vehicle and the true units, and the open questions."""
    units = UNITS.get(name.split("/")[0], SI)
    text = re.sub(r"(?s)vehicle: ?#?.*?\nlogs:", f"vehicle: {shipped_configs()}/vehicles/vt690.yaml\nlogs:", text)
    lines, sensor, asks = [], "", []
    for line in text.splitlines():
        sensor = match[1] if (match := re.fullmatch(r"  (\w+):.*", line)) else sensor
        line = OFFSET.sub(r"offset: \g<hint>\g<rest>", line)
        line = re.sub(r"\bunit: null", f"unit: {units.get(sensor, 'null')}", line)
        for key, answer in ANSWERS.items():
            line = re.sub(rf"\b{key}: null", f"{key}: {answer}", line)
        if re.search(r"\w: null\b", line) or line.strip().startswith("# required"):
            asks.append(line.strip())
        lines.append(line)
    return "\n".join(lines), asks


def outcome(name, files):
    """Return ``right: ...``, ``refused: ...`` or ``WRONG: ...`` for a log whose questions are answered."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            suggested = suggest_map(list(files), Path(folder))
        except AuvidError as error:
            return f"refused: {str(error).splitlines()[0]}"
        text, asks = answered(name, suggested)
        questions = len(re.findall(r"# required", suggested.partition("\nlogs:")[2]))
        if asks:
            wrong = wrong_without_inputs(name, text, Path(folder)) if name in NO_INPUTS else []
            return f"WRONG: {', '.join(wrong)}" if wrong else f"asks: {', '.join(asks)}"
        path = Path(folder) / "map.yaml"
        path.write_text(text, encoding="utf-8")
        units = UNITS.get(name.split("/")[0], SI)
        stated = {sensor: entry.get("unit") for sensor, entry in yaml.safe_load(suggested)["sensors"].items()}
        wrong = [f"{sensor} {unit}" for sensor, unit in stated.items() if not same_unit(unit, units[sensor])]
        try:
            dataset = auvid.import_logs(path)
        except AuvidError as error:
            return f"refused: {' '.join(str(error).split())[:300]}"
        if name not in OTHER_MOTION:
            wrong += wrong_sensors(dataset, name) + wrong_inputs(dataset, name)
        if wrong:
            return f"WRONG: {', '.join(wrong)}"
        return f"right: {', '.join(dataset.sensors)}; {questions} questions"


def wrong_without_inputs(name, text, folder):
    """Return what is wrong with the sensors of a log that has no inputs."""
    path = folder / "map.yaml"
    path.write_text(re.sub("rudder: null[^\n]*", "rudder: {constant: 0 rad}", text), encoding="utf-8")
    return wrong_sensors(auvid.import_logs(path), name)


def same_unit(unit, expected):
    """Whether a unit is the expected one, or one that the log itself states; the values show whether it is right."""
    return unit in (None, expected) or expected in SI.values()


def wrong_sensors(dataset, name_of_log):
    """Return the signals that differ from the true motion, and sensors with too few rows."""
    time, motion, *_ = truth()
    wrong = []
    end = ENDS.get(name_of_log, time[-1])
    for name, record in dataset.sensors.items():
        inside = (record.time > 1.0) & (record.time < end - 1.0)
        for quantity, values in zip(SENSORS[name], record.values.T, strict=True):
            if not np.isfinite(values).any():
                continue
            expected = np.interp(record.time, time, motion[quantity.symbol])
            if quantity.symbol == "psi":
                expected = expected + HEADING_FROM.get(name_of_log, 0.0)
            error = wrap(values - expected) if quantity.unit == "rad" else values - expected
            if not np.sqrt(np.nanmean(np.square(error[inside]))) < MAX_ERROR * np.std(expected) + 0.01:
                wrong.append(f"{quantity.symbol} by {np.sqrt(np.nanmean(np.square(error[inside]))):.3g}")
        share = np.isfinite(record.values).any(axis=1).sum() / record.time.size
        if record.time[-1] < 0.98 * end - 1.0 or record.time.size < MIN_RATE * record.time[-1]:
            wrong.append(f"{name} has {record.time.size} rows up to {record.time[-1]:.4g} s")
        if share < 0.5:
            wrong.append(f"{name} has values in {share:.0%} of its rows")
    return wrong


def wrong_inputs(dataset, name):
    """Return the inputs that differ from the true ones; of thrust only its changes, because no log shows its size."""
    *_, time, commands = truth()
    record, wrong = dataset.inputs, []
    inside = (record.time > 1.0) & (record.time < record.time[-1] - 1.0)
    for quantity, values in zip(record.quantities, record.values.T, strict=True):
        expected, limit = np.interp(record.time, time, commands[quantity.symbol])[inside], 0.0
        if quantity.symbol in ("rudder", "elevator"):
            limit = MAX_ERROR * np.std(expected)
        elif quantity.symbol == "surge_force" and name.split("/")[0] not in NO_THRUST:
            expected, limit = expected * (np.mean(values[inside]) / np.mean(expected)), 0.05 * np.mean(values[inside])
        error = np.sqrt(np.mean(np.square(values[inside] - expected)))
        if limit and not (error < limit and np.any(values)):
            wrong.append(f"{quantity.symbol} by {error:.3g}")
    return wrong


@pytest.mark.recorded
@pytest.mark.skipif(not CASES.is_dir(), reason="the logs do not ship with auvid")
@pytest.mark.parametrize("name", logs())
def test_log_gives_true_motion_or_question_or_refusal(name):
    found = outcome(name, logs()[name])
    advice = ADVICE.get(name, ADVICE.get(name.split("/")[0]))
    assert found.startswith(("asks", "refused") if advice else "right"), found
    assert not advice or advice in found, found


if __name__ == "__main__":
    for case, paths in logs().items():
        if len(sys.argv) == 1 or case.split("/")[0] in sys.argv[1:]:
            print(f"{case}: {outcome(case, paths)}", flush=True)
