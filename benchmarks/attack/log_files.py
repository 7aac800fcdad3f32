"""One dive as a log of every kind that auvid reads, each with a map that imports it."""

import gzip
import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore
from scipy.io import savemat

EPOCH = 1_743_805_382
_TICKS = np.arange(80) * 50_000_000
_SECONDS = _TICKS * 1e-9
_NAMES = "p", "q", "r", "phi", "theta", "psi", "u", "v", "w", "rudder", "elevator", "surge_force"
_TURNING, _ANGLES, _MOVING, _FINS = _NAMES[:3], _NAMES[3:6], _NAMES[6:9], _NAMES[9:]
_FINS_MESSAGE = "LOCAL_POSITION_NED_SYSTEM_GLOBAL_OFFSET"


def _columns() -> dict[str, NDArray[np.float64]]:
    wave = 0.2 * np.sin(_SECONDS[:, None] * np.linspace(0.5, 2.0, len(_NAMES)) + np.arange(len(_NAMES)))
    columns = dict(zip(_NAMES, wave.T, strict=True))
    columns["u"] = columns["u"] + 2.0
    columns["surge_force"] = 20.0 + 50.0 * columns["surge_force"]
    return columns


def _map(name: str, log: str, vehicle: Path, time: str, tables: dict[str, str], pick: dict[str, str]) -> str:
    """Write a map; `tables` by sensor, `pick` the names of columns in the log where they differ."""

    def columns(names: tuple[str, ...]) -> str:
        return ", ".join(f"{name}: '{pick.get(name, name)}'" for name in names)

    def table(part: str) -> str:
        return f"    table: {tables[part]}\n" if part in tables else ""

    return (
        f"name: {name}\nvehicle: {vehicle}\nlogs: {{main: {log}}}\ntime: {time}\nsensors:\n"
        f"  gyroscope:\n{table('gyroscope')}    columns: {{{columns(_TURNING)}}}\n    unit: rad/s\n"
        "    standard_deviation: 0.1 deg/s\n"
        f"  attitude:\n{table('attitude')}    columns: {{{columns(_ANGLES)}}}\n    unit: rad\n"
        "    standard_deviation: 1 deg\n"
        f"  dvl:\n{table('dvl')}    columns: {{{columns(_MOVING)}}}\n    unit: m/s\n    standard_deviation: 1 cm/s\n"
        f"inputs:\n{table('inputs')[2:]}  rudder: {{column: '{pick.get('rudder', 'rudder')}', unit: rad}}\n"
        f"  elevator: {{column: '{pick.get('elevator', 'elevator')}', unit: rad}}\n"
        f"  surge_force: {{column: '{pick.get('surge_force', 'surge_force')}', unit: N}}\n"
    )


def write_logs(folder: Path, vehicle: Path) -> None:
    """Write them all: `NAME.*` or a folder, and `NAME.yaml`."""
    folder.mkdir()
    columns = _columns()
    # With all that a recorded manoeuvre needs.
    timed = {"time": _SECONDS, **columns, "roll_moment": 0.0 * _SECONDS}
    plain = np.column_stack(list(timed.values()))
    header = ",".join(timed)
    np.savetxt(folder / "csv.csv", plain, delimiter=",", header=header, comments="", fmt="%.9g")
    (folder / "gz.csv.gz").write_bytes(gzip.compress((folder / "csv.csv").read_bytes(), mtime=0))
    np.savez(folder / "npz.npz", **timed)
    savemat(folder / "mat.mat", timed)
    _write_hdf5_mat(folder / "mat73.mat", timed)
    flat = {"csv": "csv.csv", "gz": "gz.csv.gz", "npz": "npz.npz", "mat": "mat.mat", "mat73": "mat73.mat"}
    for name, log in flat.items():
        (folder / f"{name}.yaml").write_text(_map(name, log, vehicle, "time", {}, {}))
    _write_bags(folder, vehicle, columns)
    _write_dataflash(folder / "bin.bin", columns)
    tables = {"gyroscope": "ATT", "attitude": "ATT", "dvl": "VEL", "inputs": "OUT"}
    (folder / "bin.yaml").write_text(_map("bin", "bin.bin", vehicle, "'@log_time'", tables, {}))
    _write_telemetry(folder / "tlog.tlog", columns)
    tables = {"gyroscope": "ATTITUDE", "attitude": "ATTITUDE", "dvl": "LOCAL_POSITION_NED", "inputs": _FINS_MESSAGE}
    names = ["rollspeed", "pitchspeed", "yawspeed", "roll", "pitch", "yaw", "vx", "vy", "vz", "x", "y", "z"]
    pick = dict(zip(_NAMES, names, strict=True))
    (folder / "tlog.yaml").write_text(_map("tlog", "tlog.tlog", vehicle, "'@log_time'", tables, pick))


def _write_hdf5_mat(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    """Write as MATLAB does in version 7.3: HDF5 behind 512 bytes of its own."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM"
    with path.open("r+b") as raw:
        raw.write(head)


def _write_bags(folder: Path, vehicle: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    tables = {"gyroscope": "/turning", "attitude": "/angles", "dvl": "/moving", "inputs": "/fins"}
    groups = {"/turning": _TURNING, "/angles": _ANGLES, "/moving": _MOVING, "/fins": _FINS}
    pick = {name: f"vector.{axis}" for group in groups.values() for name, axis in zip(group, "xyz", strict=True)}
    kind = "geometry_msgs/msg/Vector3Stamped"
    makers = {
        "bag1": (rosbag1.Writer(folder / "bag1.bag"), Stores.ROS1_NOETIC, "bag1.bag"),
        "mcap": (
            rosbag2.Writer(folder / "mcap", version=9, storage_plugin=rosbag2.StoragePlugin.MCAP),
            Stores.ROS2_HUMBLE,
            "mcap",
        ),
        "db3": (
            rosbag2.Writer(folder / "db3", version=9, storage_plugin=rosbag2.StoragePlugin.SQLITE3),
            Stores.ROS2_HUMBLE,
            "db3",
        ),
    }
    for name, (writer, stores, log) in makers.items():
        store = get_typestore(stores)
        first = {} if stores is not Stores.ROS1_NOETIC else {"seq": 0}
        serialize = store.serialize_cdr if not first else store.serialize_ros1
        with writer:
            topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic in groups}
            for k, tick in enumerate(_TICKS.tolist()):
                for topic, group in groups.items():
                    message = _stamped(store.types, kind, first, tick, [float(columns[each][k]) for each in group])
                    writer.write(topics[topic], EPOCH * 10**9 + tick, serialize(message, kind))
        (folder / f"{name}.yaml").write_text(_map(name, log, vehicle, "'@header_stamp'", tables, pick))


def _stamped(types: Any, kind: str, first: dict[str, int], tick: int, vector: list[float]) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](EPOCH + tick // 10**9, tick % 10**9)
    header = types["std_msgs/msg/Header"](**first, stamp=stamp, frame_id="base_link")
    return types[kind](header, types["geometry_msgs/msg/Vector3"](*vector))


def _write_dataflash(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    def message(number: int, layout: str, *values: object) -> bytes:
        return b"\xa3\x95" + bytes([number]) + struct.pack("<" + layout, *values)

    groups = {140: ("ATT", _TURNING + _ANGLES), 141: ("VEL", _MOVING), 142: ("OUT", _FINS)}
    parts = [message(128, "BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    for number, (name, names) in groups.items():
        layout, listed = "Q" + "f" * len(names), ",".join(("TimeUS", *names))
        length = 3 + struct.calcsize("<" + layout)
        parts.append(message(128, "BB4s16s64s", number, length, name.encode(), layout.encode(), listed.encode()))
    for k, tick in enumerate(_TICKS.tolist()):
        for number, (_, names) in groups.items():
            values = [float(columns[name][k]) for name in names]
            parts.append(message(number, "Q" + "f" * len(names), 1_000_000 + tick // 1000, *values))
    path.write_bytes(b"".join(parts))


def _write_telemetry(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    sender = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    parts = []
    for k, tick in enumerate(_TICKS.tolist()):
        now = {name: float(values[k]) for name, values in columns.items()}
        turning, angles, moving, fins = ([now[name] for name in g] for g in (_TURNING, _ANGLES, _MOVING, _FINS))
        micro = EPOCH * 10**6 + tick // 1000
        sent = (
            ardupilotmega.MAVLink_attitude_message(tick // 10**6, *angles, *turning),
            ardupilotmega.MAVLink_local_position_ned_message(tick // 10**6, 0.0, 0.0, 0.0, *moving),
            ardupilotmega.MAVLink_local_position_ned_system_global_offset_message(tick // 10**6, *fins, 0.0, 0.0, 0.0),
        )
        parts += [struct.pack(">Q", micro) + message.pack(sender) for message in sent]
    path.write_bytes(b"".join(parts))
