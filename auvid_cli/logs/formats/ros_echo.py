"""Names of the columns of `ros2 topic echo --csv`, which writes none."""

from collections.abc import Sequence

from auvid_cli.config.units import NUMBER

_HEADER = ("header.stamp.sec", "header.stamp.nanosec", "header.frame_id")
_NANOSECONDS = 10**9  # nanoseconds in 1 s


def _vector(name: str, axes: str = "xyz") -> list[str]:
    return [f"{name}.{axis}" for axis in axes]


def _covariance(name: str, size: int) -> list[str]:
    return [f"{name}[{k}]" for k in range(size)]


# Fields after the header, by the number of columns of sensor_msgs and geometry_msgs with a stamp.
_TWIST = [*_vector("twist.linear"), *_vector("twist.angular")]
_FIELDS = {
    5: ["fluid_pressure", "variance"],
    6: _vector("vector"),
    7: _vector("quaternion", "xyzw"),
    9: _TWIST,
    40: [
        *_vector("orientation", "xyzw"),
        *_covariance("orientation_covariance", 9),
        *_vector("angular_velocity"),
        *_covariance("angular_velocity_covariance", 9),
        *_vector("linear_acceleration"),
        *_covariance("linear_acceleration_covariance", 9),
    ],
    45: [*(f"twist.{name}" for name in _TWIST), *_covariance("twist.covariance", 36)],
}


def ros_names(row: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the columns of a first row with stamp, frame and numbers; empty for other rows."""
    if len(row) not in _FIELDS or not (row[0].isdecimal() and row[1].isdecimal()) or NUMBER.fullmatch(row[2]):
        return ()
    is_stamp = int(row[1]) < _NANOSECONDS and all(NUMBER.fullmatch(field) for field in row[3:])
    return (*_HEADER, *_FIELDS[len(row)]) if is_stamp else ()
