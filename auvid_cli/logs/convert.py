"""Convert logs to a dataset by a map: sensors, then the inputs of the model from fins and propeller."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from auvid_cli.arrays import Array
from auvid_cli.config.experiment import ImportedRun, RecordedFile, Recording
from auvid_cli.config.log_map import InputsMap, LogMap
from auvid_cli.config.source_positions import KeyPath, Tree
from auvid_cli.data.dataset import Dataset, InputRecord, SensorRecord
from auvid_cli.data.netcdf import digest
from auvid_cli.data.signals import gap_limit
from auvid_cli.logs.formats.log import JoinedLog, Log
from auvid_cli.logs.formats.open_log import open_log
from auvid_cli.logs.frames import interpolate
from auvid_cli.logs.measurements import ImportSummary, read_request, summary_of
from auvid_cli.logs.requests import ColumnReader, MapErrors, MapMismatchError, Request, find_requests
from auvid_cli.logs.sensor_records import SensorRecords, read_sensors
from auvid_cli.vehicle.parameters import ALL_INPUTS, INPUT_SYMBOLS, PROPULSION

# Files of each log by its name, in their order.
LogFiles = Mapping[str, Sequence[Path]]
# Deflection of each fin per radian of rudder and of elevator. A positive rudder pushes the tail to starboard, a
# positive elevator pushes it up. A positive fin of an x tail pushes to starboard; two of these fins also push down.
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
_MAX_FIN_ANGLE = 0.5 * np.pi  # rad
_ROUNDING = 1e-9  # rad, of rudder and elevator mixed from fins
_MAX_FRACTION = 1.5  # largest command of a thruster that is probably a fraction, not percent


class Conversion(NamedTuple):
    """Dataset records from logs, and the report of the conversion."""

    inputs: InputRecord
    sensors: dict[str, SensorRecord]
    origin: float  # time of the log, s, at t = 0, which is the first sample of the earliest sensor
    summaries: tuple[ImportSummary, ...]
    remarks: tuple[str, ...]


def convert(settings: LogMap, tree: Tree, logs: Mapping[str, Log]) -> Conversion:
    """Convert logs.

    Parameters
    ----------
    settings : LogMap
    tree : Tree
        Source of the map, for the positions of errors.
    logs : mapping of str to Log
        Opened logs by their names in the map.

    Raises
    ------
    ConfigError
        With all settings of the map that do not fit the logs.
    FileError
        If a log is damaged.
    """
    errors = MapErrors(tree)
    requests = find_requests(settings, tree, logs, errors)
    errors.stop_if_any()
    columns = ColumnReader(logs, requests.values())
    sensors = read_sensors(settings, requests, columns, errors)
    inputs, summaries, remarks = _read_inputs(settings, requests, columns, sensors, errors)
    of_logs = tuple(f"{name}: {remark}" for name, log in logs.items() for remark in log.remarks())
    return Conversion(inputs, sensors.records, sensors.origin, (*sensors.summaries, *summaries), (*of_logs, *remarks))


def dataset_from_logs(settings: LogMap, tree: Tree, files: LogFiles) -> tuple[Dataset, Conversion]:
    """Open and convert log files; the dataset names them in its settings. Errors are those of `convert`."""
    logs = dict[str, Log]()
    folder = tree.at.source.path.parent if tree.at.source.path is not None else Path()
    for name, paths in files.items():
        layout = settings.logs[name]
        definitions = [folder / file for file in layout.messages]
        opened = [open_log(path, layout, definitions=definitions) for path in paths]
        logs[name] = opened[0] if len(opened) == 1 else JoinedLog(opened)
    conversion = convert(settings, tree, logs)
    recorded = tuple(RecordedFile(name=file.name, sha256=digest(file)) for file in recorded_files(files))
    remarks = {summary.name: summary.remarks for summary in conversion.summaries if summary.remarks}
    run = ImportedRun(
        name=settings.name,
        vehicle=settings.vehicle,
        identification=settings.identification,
        recording=Recording(files=recorded, map=tree.at.source.text, origin=conversion.origin, remarks=remarks),
    )
    return Dataset(conversion.inputs, conversion.sensors, run), conversion


def recorded_files(files: LogFiles) -> list[Path]:
    """Return all files of logs, including those in the folder of a bag."""
    return [
        part
        for log in files.values()
        for path in log
        for part in (sorted(path.rglob("*")) if path.is_dir() else [path])
        if not part.is_dir()
    ]


class Channel(NamedTuple):
    """A signal that is constant from each of its times, s, to the next."""

    time: Array
    values: Array


class Mixed(NamedTuple):
    """Rudder and elevator, rad, that fit the fins, and the RMS of the remaining deflections, rad."""

    rudder: Array
    elevator: Array
    rest: float


def hold(channels: Mapping[str, Channel]) -> tuple[Array, dict[str, Array]]:
    """Return the times of all channels from the latest start on, and the values that hold at these times."""
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
    """Return the least-squares fit of rudder and elevator to fin angles, rad."""
    design = np.array([_FINS[name] for name in fins])
    inverse = np.linalg.pinv(design)
    rudder, elevator = (sum(w * fin for w, fin in zip(row, fins.values(), strict=True)) for row in inverse)
    squares = [
        np.mean(np.square(fin - by_rudder * rudder - by_elevator * elevator))
        for (by_rudder, by_elevator), fin in zip(design, fins.values(), strict=True)
    ]
    return Mixed(np.asarray(rudder), np.asarray(elevator), float(np.sqrt(np.mean(squares))))


def moved_by(fins: Iterable[str]) -> set[str]:
    """Return which of rudder and elevator the fins act as."""
    return {name for fin in fins for name, share in zip(("rudder", "elevator"), _FINS[fin], strict=True) if share}


def propeller_thrust(revolutions: Array, speed: Array, a: float, b: float) -> Array:
    """Return the thrust a n|n| + b |n| u, N, at n revolutions per second and u m/s ahead (Fossen 2011, section 9.3)."""
    return a * revolutions * np.abs(revolutions) + b * np.abs(revolutions) * speed


def thruster_force(percent: Array, full: float) -> Array:
    """Return the thrust full x|x|, N, of a command x from -100 to 100 percent."""
    share = 0.01 * percent
    return full * share * np.abs(share)


def _read_inputs(
    settings: LogMap, requests: dict[KeyPath, Request], columns: ColumnReader, sensors: SensorRecords, errors: MapErrors
) -> tuple[InputRecord, list[ImportSummary], tuple[str, ...]]:
    """Return the inputs while the sensors measure, a summary of each column, and remarks on the inputs."""
    channels: dict[str, Channel] = {}
    summaries = []
    for key in settings.inputs.channels():
        with errors.collecting():
            channel, summary = _read_channel(settings.inputs, key, requests["inputs", *key], columns, sensors.origin)
            channels[".".join(key)] = channel
            summaries.append(summary)
    errors.stop_if_any()
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
    if not time.size or time[0] > end or time[-1] < begin:
        spans = ", ".join(
            f"{name} {channel.time[0]:.3f} to {channel.time[-1]:.3f} s" for name, channel in channels.items()
        )
        message = f"no time in common with the sensors ({begin:.3f} to {end:.3f} s): {spans}"
        errors.add(("inputs",), f"{message}; give one of them a time with an `offset`")
        errors.stop_if_any()
    has_propulsion = any(getattr(settings.inputs, quantity.symbol) is not None for quantity in PROPULSION)
    record = InputRecord(time, np.zeros((time.size, len(ALL_INPUTS if has_propulsion else INPUT_SYMBOLS))))
    with errors.collecting():
        remarks = _fill_inputs(settings, held, sensors.records, record)
    errors.stop_if_any()
    complete = np.isfinite(record.values).all(axis=1)
    inputs = InputRecord(record.time[complete], record.values[complete]).between(begin, end)
    return inputs, summaries, (*early, *remarks)


def _ends_early(channel: Channel, end: float) -> bool:
    """Whether an input ends before the sensors by more than a gap and twice its longest interval."""
    intervals = np.diff(channel.time)
    if not intervals.size:
        return False
    return end - channel.time[-1] > max(gap_limit(intervals), 2.0 * float(intervals.max()))


def _read_channel(
    settings: InputsMap, key: tuple[str, ...], request: Request, columns: ColumnReader, origin: float
) -> tuple[Channel, ImportSummary]:
    signal, has_unit = settings.channels()[key], request.values[key[-1]].has_unit
    if signal.si == "turn/s" and not has_unit:
        raise MapMismatchError(request.path, "has no unit; expected the `unit` of the log's numbers, rpm or turn/s")
    rows = read_request(request, {key[-1]: signal}, columns)
    values = rows.values[key[-1]]
    finite = np.isfinite(values)
    n_missing = int(np.count_nonzero(~finite))
    if not finite.any():
        raise MapMismatchError(request.path, f"no numbers in the column {signal.column!r}")
    time, values = rows.time[finite] - origin, values[finite]
    largest = float(np.abs(values).max())
    if signal.si == "rad" and largest > _MAX_FIN_ANGLE:
        raise MapMismatchError(request.path, f"deflects {largest:.3g} rad: state the `unit`, or `centre` and `scale`")
    if signal.si == "percent" and not has_unit and 0.0 < largest <= _MAX_FRACTION:
        choice = "state `unit: '1'` if 1 is full thrust, or `unit: percent`"
        raise MapMismatchError(request.path, f"reaches only {largest:.3g} and has no unit: {choice}")
    remarks = (f"{n_missing} missing values replaced by the previous ones",) if n_missing else ()
    return Channel(time, values), summary_of(".".join(key), time, 0, rows, remarks)


def _fill_inputs(
    settings: LogMap, held: dict[str, Array], sensors: dict[str, SensorRecord], record: InputRecord
) -> tuple[str, ...]:
    """Fill in the inputs of a record, and return remarks on them."""
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
        speed = _surge_speed(record.time, sensors) if thrust.b else np.zeros(record.time.size)
        surge_force[:] = propeller_thrust(held["thrust.revolutions"], speed, thrust.a, thrust.b)
    if settings.inputs.roll_moment == "propeller":
        parameters = settings.vehicle.known_parameters()
        if parameters["X_prop"] == 0.0:
            raise MapMismatchError(("inputs", "roll_moment"), "X_prop of the vehicle is 0; expected another value")
        roll_moment[:] = surge_force * (parameters["K_prop"] / parameters["X_prop"])
    mapped = {quantity.symbol for quantity in ALL_INPUTS if getattr(settings.inputs, quantity.symbol) is not None}
    if settings.inputs.fins is not None:
        mapped |= moved_by(settings.inputs.fins.given())
    if thrust is not None:
        mapped.add("surge_force")
    zero = [q.symbol for q, values in zip(record.quantities, record.values.T, strict=True) if not values.any()]
    for symbols, reason in (
        ([symbol for symbol in zero if symbol in mapped], "zero all the time"),
        ([symbol for symbol in zero if symbol not in mapped], "not in the map, so zero"),
    ):
        if symbols:
            remarks.append(f"{', '.join(symbols)}: {reason}")
    if "surge_force" in zero and "surge_force" not in mapped:
        remarks.append("surge_force: state the thrust, even a constant guess; without it the drag will be wrong")
    return tuple(remarks)


def _surge_speed(time: Array, sensors: dict[str, SensorRecord]) -> Array:
    """Return the measured surge velocity, m/s; NaN if missing."""
    if "dvl" not in sensors:
        raise MapMismatchError(("inputs", "thrust", "b"), "needs the speed; expected a `dvl` in the map")
    return interpolate(sensors["dvl"].time, sensors["dvl"].values[:, :1], time)[:, 0]
