"""Messages of known formats: quantity of each field, frame, unit, flag, and whether it is measured.

A suggested map takes from a known message only the fields listed here, without a guess by names or numbers. Fields that
are left out on purpose: accelerations without gravity, the turn rate of the MOOS helm, a DVL's time between reports.

Sources, by the word in `KnownMessage.source`:

- PX4: ``PX4/px4_msgs`` (VehicleAttitude, VehicleLocalPosition); docs.px4.io/main/en/msg_docs (VehicleAngularVelocity,
  SensorGyro, SensorAccel).
- Water Linked: ``waterlinked/waterlinked.github.io``, ``docs/dvl/dvl-protocol.md`` (SI, times in microseconds) and
  ``axes.md`` (x forward, y right, z down). Its ``time`` is the interval since the last report.
- marine_acoustic_msgs: docs.ros.org/en/jazzy/p/marine_acoustic_msgs/msg/Dvl.html (x forward, z along the beams).
- uuv_simulator: ``DVL.msg`` as in cola2_msgs, which states no axes.
- Nortek: ``nortek_dvl/Dvl.msg`` in ``osu-uwrt/riptide_setup``, which states no axes.
- ArduPilot: ``AP_AHRS/LogStructure.h`` (ATT), ``AP_InertialSensor/LogStructure.h`` (IMU, ACC, GYR: rad/s and m/s^2),
  ``AP_Baro/LogStructure.h`` (BARO: altitude, m).
- IMC: ``IMC.xml`` of ``LSTS/imc``. EulerAngles has the axes of SNAME (1950); the axes of AngularVelocity, Acceleration
  and GroundVelocity are those of the device, so that the data decide. ServoPosition is measured.
- MOOS: ``uSimMarine`` takes DESIRED_RUDDER, DESIRED_ELEVATOR and DESIRED_THRUST from -100 to 100. Vehicles take angles
  in degrees, so that the unit of rudder and elevator is open.
- RDI: Pathfinder DVL Guide (2018), page 206: a PD0 velocity is that of the bottom, with all signs reversed, along axes
  to starboard, ahead and up, in mm/s, where -32768 means a missing measurement.

Not checked against a source: the axes of sensor_combined of PX4, NAV_PITCH and NAV_ROLL of MOOS, and set-points of
ArduPilot.
"""

import re
from collections.abc import Iterable, Mapping
from enum import Enum
from functools import cache
from typing import NamedTuple

from auvid_cli.logs.formats.log import LogColumn


class Role(Enum):
    """Origin of a message."""

    MEASURED = "measured"
    FILTER_OUTPUT = "output of a navigation filter"
    SET_POINT = "set-points"
    COMMAND = "command of an actuator"


class KnownMessage(NamedTuple):
    """A message of a known format."""

    source: str
    table: str  # pattern of the table's name; empty for any table with the fields
    fields: dict[str, str]  # field of each component; of a quaternion quaternion.w and so on
    role: Role = Role.MEASURED
    frame: str = ""  # axes; empty if the format does not fix them
    units: tuple[str, ...] = ()  # unit of each dimension, such as rad/s
    flag: str = ""  # field that marks valid rows
    valid: int = 1  # its value in valid rows
    marks: tuple[str, ...] = ()  # further fields that a table without a fixed name must have
    is_of_bottom: bool = False  # whether a velocity is that of the bottom, so that its axes seem to be a mirror image


def _vector(symbols: str, fields: str) -> dict[str, str]:
    return dict(zip(symbols.split(), fields.split(), strict=True))


_QUATERNION = "quaternion.w quaternion.x quaternion.y quaternion.z"
_INSTANCE = r"(\[[\d.]+\])?"
_VELOCITY = _vector("u v w", "velocity.x velocity.y velocity.z")
_WATER_LINKED = ("fom", "altitude")
_DEG = ("deg", "rad/s", "m/s", "m/s^2", "m")
_SI = ("rad", "rad/s", "m/s", "m/s^2", "m")
KNOWN_MESSAGES = (
    KnownMessage("PX4", r"\w+_setpoint", {}, Role.SET_POINT),
    KnownMessage(
        "PX4", "vehicle_attitude", _vector(_QUATERNION, "q[0] q[1] q[2] q[3]"), Role.FILTER_OUTPUT, "FRD", _SI
    ),
    KnownMessage(
        "PX4", "vehicle_local_position", _vector("u v w", "vx vy vz"), Role.FILTER_OUTPUT, "NED", _SI, "v_xy_valid"
    ),
    KnownMessage("PX4", "vehicle_angular_velocity", _vector("p q r", "xyz[0] xyz[1] xyz[2]"), frame="FRD", units=_SI),
    KnownMessage("PX4", "sensor_gyro", _vector("p q r", "x y z"), frame="FRD", units=_SI),
    KnownMessage("PX4", "sensor_accel", _vector("fx fy fz", "x y z"), frame="FRD", units=_SI),
    KnownMessage(
        "PX4",
        "sensor_combined",
        _vector("p q r", "gyro_rad[0] gyro_rad[1] gyro_rad[2]")
        | _vector("fx fy fz", "accelerometer_m_s2[0] accelerometer_m_s2[1] accelerometer_m_s2[2]"),
        frame="FRD",
        units=_SI,
    ),
    KnownMessage("IMC", "EulerAngles", _vector("phi theta psi", "phi theta psi"), frame="FRD", units=_SI),
    KnownMessage("IMC", "AngularVelocity", _vector("p q r", "x y z"), units=_SI),
    KnownMessage("IMC", "Acceleration", _vector("fx fy fz", "x y z"), units=_SI),
    KnownMessage("IMC", "GroundVelocity", _vector("u v w", "x y z"), units=_SI, flag="validity", valid=7),
    KnownMessage("IMC", "WaterVelocity", {}),
    KnownMessage("IMC", "Depth", {"down": "value"}, units=_SI),
    KnownMessage("IMC", "Rpm", {"thrust.revolutions": "value"}, Role.MEASURED, units=("rpm",)),
    KnownMessage("IMC", "ServoPosition", {"fins": "value"}, units=("rad",), marks=("id",)),
    KnownMessage("IMC", "SetServoPosition", {"fins": "value"}, Role.SET_POINT, units=("rad",), marks=("id",)),
    KnownMessage("IMC", "SetThrusterActuation", {"thrust.share": "value"}, Role.SET_POINT, units=("1",)),
    KnownMessage("IMC", r"Desired\w+", {}, Role.SET_POINT),
    KnownMessage(
        "IMC",
        "EstimatedState",
        _vector("phi theta psi p q r u v w down", "phi theta psi p q r u v w depth"),
        Role.FILTER_OUTPUT,
        "FRD",
        _SI,
    ),
    KnownMessage(
        "ArduPilot",
        "ATT",
        _vector("phi theta psi", "Roll Pitch Yaw"),
        Role.FILTER_OUTPUT,
        "FRD",
        _DEG,
        marks=("DesRoll",),
    ),
    KnownMessage(
        "ArduPilot", "IMU", _vector("p q r fx fy fz", "GyrX GyrY GyrZ AccX AccY AccZ"), frame="FRD", units=_SI
    ),
    KnownMessage("ArduPilot", "GYR", _vector("p q r", "GyrX GyrY GyrZ"), frame="FRD", units=_SI),
    KnownMessage("ArduPilot", "ACC", _vector("fx fy fz", "AccX AccY AccZ"), frame="FRD", units=_SI),
    KnownMessage("ArduPilot", "BARO", {"down": "Alt"}, units=_SI, marks=("Press",)),
    KnownMessage("ArduPilot", "PS[CO][NEDUZ]|RATE|SIDD", {}, Role.SET_POINT),
    KnownMessage("MOOS", "DESIRED_THRUST", {"thrust.share": "value"}, Role.COMMAND, units=("percent",)),
    KnownMessage("MOOS", "DESIRED_RUDDER", {"rudder": "value"}, Role.COMMAND),
    KnownMessage("MOOS", "DESIRED_ELEVATOR", {"elevator": "value"}, Role.COMMAND),
    KnownMessage("MOOS", "DESIRED_(HEADING|SPEED|DEPTH)|TURN_RATE", {}, Role.SET_POINT),
    KnownMessage("MOOS", "NAV_DEPTH", {"down": "value"}, Role.FILTER_OUTPUT, units=_SI),
    KnownMessage("MOOS", "NAV_HEADING", {"psi": "value"}, Role.FILTER_OUTPUT, "FRD", _DEG),
    KnownMessage("MOOS", "NAV_PITCH", {"theta": "value"}, Role.FILTER_OUTPUT),
    KnownMessage("MOOS", "NAV_ROLL", {"phi": "value"}, Role.FILTER_OUTPUT),
    KnownMessage("Water Linked", "position_local", {}, Role.FILTER_OUTPUT, marks=("std", "ts")),
    *(
        KnownMessage("Water Linked", "", fields, frame="FRD", units=_SI, flag="velocity_valid", marks=_WATER_LINKED)
        for fields in (_VELOCITY, _vector("u v w", "vx vy vz"))
    ),
    KnownMessage("marine_acoustic_msgs", "", _VELOCITY, frame="FRD", units=_SI, marks=("velocity_mode", "dvl_type")),
    KnownMessage("uuv_simulator", "", _VELOCITY, units=_SI, marks=("velocity_covariance[0]", "altitude")),
    KnownMessage("Nortek", "", _VELOCITY, units=_SI, marks=("figureOfMerit", "dt1")),
    KnownMessage(
        "RDI", "", _vector("u v w", "BT_vel_x_mms BT_vel_y_mms BT_vel_z_mms"), units=("mm/s",), is_of_bottom=True
    ),
)


def known_message(table: str, columns: Iterable[LogColumn], file: str = "") -> KnownMessage | None:
    """Return the message of a table; None if it is of no known format.

    A table without a name is that of a text log, whose `file` may have the name of a message: log_7_sensor_gyro_0.
    """
    return _known(table, "" if table else file, frozenset(column.name for column in columns))


@cache
def _known(table: str, file: str, names: frozenset[str]) -> KnownMessage | None:
    for message in KNOWN_MESSAGES:
        # A table with the name of a message may lack its flag.
        needed = {*message.fields.values(), *message.marks, "" if message.table else message.flag} - {""}
        if message.table and not (
            re.fullmatch(message.table + _INSTANCE, table)
            or re.fullmatch(rf"(.*[_. -])?({message.table})(_\d+)?", file)
        ):
            continue
        # A topic may have the name of a message by chance; one whose fields are all missing is another.
        if needed <= names:
            return message
    return None


def known_columns(
    message: KnownMessage, wanted: Mapping[str, str], columns: Iterable[LogColumn], is_quaternion: bool
) -> dict[str, LogColumn]:
    """Return the columns of a known message for the wanted components."""
    by_name = {column.name: column for column in columns}
    prefix = "quaternion." if is_quaternion else ""
    fields = {component: message.fields.get(f"{prefix}{component}") for component in wanted}
    return {component: by_name[field] for component, field in fields.items() if field is not None}
