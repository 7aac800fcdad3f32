"""Inputs of the model from fins and propeller of a log."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from auvid_cli.config.log_map import InputsMap, LogMap
from auvid_cli.config.source_positions import KeyPath
from auvid_cli.data.dataset import InputRecord, SensorRecord
from auvid_cli.data.signals import gap_limit
from auvid_cli.logs.frames import interpolate
from auvid_cli.logs.measurements import ImportSummary, read_request, summary_of
from auvid_cli.logs.requests import ColumnReader, MapErrors, MapMismatchError, Request
from auvid_cli.logs.sensor_records import SensorRecords
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUT_SYMBOLS, PROPULSION

Array = NDArray[np.float64]
# What rudder and elevator, of one radian each, deflect a fin by. Positive rudder pushes the tail to starboard, positive
# elevator pushes it up. A fin of an X tail is positive if it pushes to starboard: two of them then push down.
_FINS = {
    "top": (1.0, 0.0),
    "bottom": (1.0, 0.0),
    "right": (0.0, 1.0),
    "left": (0.0, 1.0),
    "upper_right": (1.0, -1.0),
    "lower_right": (1.0, 1.0),
    "lower_left": (1.0, -1.0),
    "upper_left": (1.0, 1.0),
}
_LARGEST_FIN_ANGLE, _ROUNDING = 0.5 * np.pi, 1e-9
# A thruster that never gets more than so much is rather told fractions than percent.
_LARGEST_FRACTION = 1.5


class Channel(NamedTuple):
    """A signal that is constant from each of its times to the next."""

    time: Array
    values: Array


class Mixed(NamedTuple):
    """Rudder and elevator that the fins amount to, and what they do besides: roll control, or play.

    Attributes
    ----------
    rudder, elevator : ndarray
        rad.
    rest : float
        rad, root mean square over fins and time.
    """

    rudder: Array
    elevator: Array
    rest: float


def hold(channels: Mapping[str, Channel]) -> tuple[Array, dict[str, Array]]:
    """Put channels on the union of their times, each holding its last value, from when all have begun."""
    times = [channel.time for channel in channels.values()]
    if all(np.array_equal(times[0], other) for other in times[1:]):
        return times[0], {name: channel.values for name, channel in channels.items()}
    union = np.unique(np.concatenate(times))
    union = union[union >= max(time[0] for time in times)]
    return union, {
        name: channel.values[np.searchsorted(channel.time, union, side="right") - 1]
        for name, channel in channels.items()
    }


def mix(fins: Mapping[str, Array]) -> Mixed:
    """Mix single fins to rudder and elevator: their least-squares fit, which is the mean of the fins concerned."""
    design = np.array([_FINS[name] for name in fins])
    inverse = np.linalg.pinv(design)
    rudder, elevator = (sum(w * fin for w, fin in zip(row, fins.values(), strict=True)) for row in inverse)
    squares = [
        np.mean(np.square(fin - by_rudder * rudder - by_elevator * elevator))
        for (by_rudder, by_elevator), fin in zip(design, fins.values(), strict=True)
    ]
    return Mixed(np.asarray(rudder), np.asarray(elevator), float(np.sqrt(np.mean(squares))))


def moved_by(fins: Iterable[str]) -> set[str]:
    """Say which of rudder and elevator have a part in what fins do."""
    return {name for fin in fins for name, part in zip(("rudder", "elevator"), _FINS[fin], strict=True) if part}


def propeller_thrust(revolutions: Array, speed: Array, a: float, b: float) -> Array:
    """Return the thrust a n|n| + b |n| u, N, of n revolutions per second at u m/s ahead (Fossen 2011, section 9.3)."""
    return a * revolutions * np.abs(revolutions) + b * np.abs(revolutions) * speed


def thruster_force(percent: Array, full: float) -> Array:
    """Return the thrust full x|x|, N, of a command x from -100 to 100 percent."""
    share = 0.01 * percent
    return full * share * np.abs(share)


def read_inputs(
    settings: LogMap,
    requests: dict[KeyPath, Request],
    columns: ColumnReader,
    sensors: SensorRecords,
    refusals: MapErrors,
) -> tuple[InputRecord, list[ImportSummary], tuple[str, ...]]:
    """Read the inputs, mix what makes them up, and keep what holds while the sensors measure.

    Returns
    -------
    InputRecord
    list of ImportSummary
        Of each column that an input is made from.
    tuple of str
        What else is to be said of them.

    Raises
    ------
    ConfigError
        With every mistake found in a step.
    FileError
        If a log is damaged.
    """
    channels: dict[str, Channel] = {}
    summaries = []
    for key in settings.inputs.channels():
        with refusals.collecting():
            channel, summary = _read(settings.inputs, key, requests["inputs", *key], columns, sensors.origin)
            channels[".".join(key)] = channel
            summaries.append(summary)
    refusals.stop_if_any()
    begin = float(min(record.time[0] for record in sensors.records.values()))
    end = float(max(record.time[-1] for record in sensors.records.values()))
    time, held = hold(channels) if channels else (np.unique([begin, end]), {})
    held |= {".".join(key): np.full(time.size, value) for key, value in settings.inputs.constants().items()}
    remarks: tuple[str, ...] = ()
    early = tuple(
        f"{name} ends at t = {channel.time[-1]:.4g} s, {end - channel.time[-1]:.4g} s before the sensors: "
        f"unless its last value held, leave that time out with `use: [[0 s, {channel.time[-1]:.4g} s]]`"
        for name, channel in channels.items()
        if _ends_early(channel, end)
    )
    further = any(getattr(settings.inputs, quantity.symbol) is not None for quantity in PROPULSION)
    record = InputRecord(time, np.zeros((time.size, len(ALL_INPUTS if further else INPUT_SYMBOLS))))
    with refusals.collecting():
        if not time.size or time[0] > end or time[-1] < begin:
            message = f"no time in common with the sensors, which measure from {begin:.3f} to {end:.3f} s"
            spans = ", ".join(
                f"{name} {channel.time[0]:.3f} to {channel.time[-1]:.3f} s" for name, channel in channels.items()
            )
            raise MapMismatchError(("inputs",), f"{message}: {spans}; give one of them a time with an `offset`")
        remarks = _mix(settings, held, sensors.records, record)
    refusals.stop_if_any()
    known = np.isfinite(record.values).all(axis=1)
    return InputRecord(record.time[known], record.values[known]).between(begin, end), summaries, (*early, *remarks)


def _ends_early(channel: Channel, end: float) -> bool:
    """Say whether an input is silent before an end for longer than it ever was, and than a gap may last."""
    intervals = np.diff(channel.time)
    if not intervals.size:
        return False
    return end - channel.time[-1] > max(gap_limit(intervals), 2.0 * float(intervals.max()))


def _read(
    settings: InputsMap, key: tuple[str, ...], request: Request, columns: ColumnReader, origin: float
) -> tuple[Channel, ImportSummary]:
    signal = settings.channels()[key]
    if signal.si == "turn/s" and not request.values[key[-1]].has_unit:
        raise MapMismatchError(
            request.path, "has no unit: state the `unit` of the log's numbers, `unit: rpm` or `turn/s`"
        )
    rows = read_request(request, {key[-1]: signal}, None, columns)
    values = rows.values[key[-1]]
    known = np.isfinite(values)
    if not known.any():
        raise MapMismatchError(request.path, f"there is no number in the column {signal.column!r}")
    time, values = rows.time[known] - origin, values[known]
    largest = float(np.abs(values).max())
    if signal.si == "rad" and largest > _LARGEST_FIN_ANGLE:
        raise MapMismatchError(request.path, f"deflects {largest:.3g} rad: state the `unit`, or `centre` and `scale`")
    if signal.si == "percent" and not request.values[key[-1]].has_unit and 0.0 < largest <= _LARGEST_FRACTION:
        choice = "state `unit: '1'` where 1 is full thrust, or `unit: percent`"
        raise MapMismatchError(request.path, f"reaches only {largest:.3g} and has no unit: {choice}")
    lost = rows.values[key[-1]].size - values.size
    remarks = (f"{lost} missing values: the one before is held",) if lost else ()
    return Channel(time, values), summary_of(".".join(key), time, 0, rows, remarks)


def _mix(
    settings: LogMap, held: dict[str, Array], sensors: dict[str, SensorRecord], record: InputRecord
) -> tuple[str, ...]:
    """Fill in rudder, elevator, surge force and roll moment; returns what is to be said of them."""
    rudder, elevator, surge_force, roll_moment, *_ = record.values.T
    remarks = []
    for quantity, target in zip(record.quantities, record.values.T, strict=True):
        target[:] = held.get(quantity.symbol, 0.0)
    fins = {name.removeprefix("fins."): values for name, values in held.items() if name.startswith("fins.")}
    if fins:
        mixed = mix(fins)
        rudder[:], elevator[:] = mixed.rudder, mixed.elevator
        if mixed.rest > _ROUNDING:
            remarks.append(f"fins: {np.degrees(mixed.rest):.2g} deg RMS are neither rudder nor elevator: left out")
    thrust = settings.inputs.thrust
    if thrust is not None and thrust.full is not None:
        surge_force[:] = thruster_force(held["thrust.share"], thrust.full)
    elif thrust is not None and thrust.a is not None:
        speed = _speed(record.time, sensors) if thrust.b else np.zeros(record.time.size)
        surge_force[:] = propeller_thrust(held["thrust.revolutions"], speed, thrust.a, thrust.b)
    if settings.inputs.roll_moment == "propeller":
        known = settings.vehicle.known_parameters()
        if known["X_prop"] == 0.0:
            raise MapMismatchError(("inputs", "roll_moment"), "needs a vehicle whose X_prop is not 0")
        roll_moment[:] = surge_force * (known["K_prop"] / known["X_prop"])
    mapped = _mapped(settings.inputs)
    idle = [q.symbol for q, values in zip(record.quantities, record.values.T, strict=True) if not values.any()]
    for symbols, reason in (
        ([symbol for symbol in idle if symbol in mapped], "zero all the time"),
        ([symbol for symbol in idle if symbol not in mapped], "not in the map, so zero"),
    ):
        if symbols:
            remarks.append(f"{', '.join(symbols)}: {reason}")
    return tuple(remarks)


def _mapped(settings: InputsMap) -> set[str]:
    """Return the inputs that the map says anything of."""
    mapped = {quantity.symbol for quantity in ALL_INPUTS if getattr(settings, quantity.symbol) is not None}
    if settings.fins is not None:
        mapped |= moved_by(settings.fins.given())
    return mapped | ({"surge_force"} if settings.thrust is not None else set())


def _speed(time: Array, sensors: dict[str, SensorRecord]) -> Array:
    """Return the measured surge velocity; NaN where there is none."""
    if "dvl" not in sensors:
        raise MapMismatchError(("inputs", "thrust", "b"), "needs the speed, but no `dvl` is mapped")
    return interpolate(sensors["dvl"].time, sensors["dvl"].values[:, :1], time)[:, 0]
