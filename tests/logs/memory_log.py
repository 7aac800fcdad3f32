"""Logs in memory for tests of the conversion: their tables, and lines of maps for them."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from auvid_cli.config.enums import shipped_configs
from auvid_cli.logs.formats.log import Log, LogColumn

TIME = np.arange(40) * 0.05
FLU = np.diag([1.0, -1.0, -1.0])
NED_OF_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
VEHICLE = shipped_configs() / "vehicles" / "vt690.yaml"


class MemoryLog(Log):
    """Tables of columns, each an array or an array with a unit."""

    def __init__(self, **tables):
        super().__init__(Path("memory"))
        self._tables = {
            table: {name: held if isinstance(held, tuple) else (held, "") for name, held in columns.items()}
            for table, columns in tables.items()
        }

    def tables(self):
        return {
            table: tuple(LogColumn(name, unit, values.dtype.kind == "U") for name, (values, unit) in columns.items())
            for table, columns in self._tables.items()
        }

    def read(self, table, columns):
        return {name: self._tables[table][name][0] for name in columns}


def motion(seed=1):
    """Velocity, rates and attitude of a body that turns about all axes, smooth and never near the vertical."""
    rng = np.random.default_rng(seed)
    phase, size = rng.uniform(0, 6, 9), rng.uniform(0.1, 0.5, 9)
    wave = size * np.sin(TIME[:, None] + phase)
    return wave[:, :3] + [2.0, 0.0, 0.0], wave[:, 3:6], wave[:, 6:]


def rotations(angles):
    return Rotation.from_euler("ZYX", angles[:, ::-1])


def imu(rates, angles, time=TIME):
    return {
        **{"t": time, "p": rates[:, 0], "q": rates[:, 1], "r": rates[:, 2]},
        **{"roll": angles[:, 0], "pitch": angles[:, 1], "yaw": angles[:, 2]},
    }


def dvl(velocity, time=TIME):
    return {"t": time, "u": velocity[:, 0], "v": velocity[:, 1], "w": velocity[:, 2]}


INPUTS = {"t": TIME, "dr": 0.1 * np.sin(TIME), "de": 0.1 * np.cos(TIME), "force": np.full(TIME.size, 5.0)}
GYROSCOPE = "gyroscope: {table: imu, columns: {p: p, q: q, r: r}, standard_deviation: 0.01%s}"
DVL = "dvl: {table: dvl, columns: {u: u, v: v, w: w}, standard_deviation: 0.01%s}"
ATTITUDE = "attitude: {table: imu, columns: {phi: roll, theta: pitch, psi: yaw}, standard_deviation: 0.01%s}"
DEPTH = "depth: {table: depth, columns: {down: {column: z%s}}, standard_deviation: 0.01%s}"
INPUT_MAP = "{table: in, rudder: dr, elevator: de, surge_force: force}"
