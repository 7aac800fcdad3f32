"""Files for the crew of a vehicle: inputs, track, timeline and checklist of a manoeuvre."""

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import yaml

from auvid_cli.arrays import Array
from auvid_cli.config.geometry import FinSettings
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope, Zigzag
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.trials import measure_extent
from auvid_cli.errors import DataError
from auvid_cli.simulation.manoeuvres import ManoeuvrePlan, make_plan
from auvid_cli.simulation.motion import Truth

_INPUT_RATE = 20.0  # Hz
_TIMELINE_ROWS = 12
_BOX_STEP = 5  # s between two boxes of the band
_RADIUS = 6378137.0  # m, equatorial radius of WGS 84
_ECCENTRICITY = 6.69437999014e-3  # eccentricity of WGS 84, squared
# Percentiles of the drawn vehicles.
LOW = 5.0
HIGH = 95.0


class Band(NamedTuple):
    """Range of a run over the drawn vehicles; the last axis is the 5th, 50th and 95th percentile."""

    time: Array  # shape (n,); s, one a second
    position: Array  # shape (n, 3, 3); north, east, down, m, from the start
    turned: Array  # shape (n, 3); change of the heading, rad
    turn_rate: Array  # shape (n, 3); rad/s
    pitch: Array  # shape (n, 3); rad
    roll: Array  # shape (n, 3); rad
    speed: Array  # shape (n, 3); m/s
    box: tuple[float, float]  # extent north and east, m, of 95 of 100 vehicles
    depths: tuple[float, float]  # shallowest and deepest point of 95 of 100 vehicles, m below the start
    length: tuple[float, float]  # distance through the water, 5th and 95th percentile, m
    energy: tuple[float, float]  # work of the thrust, 5th and 95th percentile, J
    number: int  # number of vehicles


def summarise_runs(runs: Sequence[Truth]) -> Band:
    """Return the band of runs of one manoeuvre.

    Raises
    ------
    DataError
        If `runs` is empty.
    """
    if not runs:
        raise DataError("every trial vehicle went out of control in this manoeuvre; use a smaller --spread")
    time = np.arange(0.0, runs[0].time[-1] + 1e-9, 1.0)
    ticks = np.searchsorted(runs[0].time, time - 1e-9)
    motion, position = np.array([run.motion[ticks] for run in runs]), np.array([run.position[ticks] for run in runs])
    extent = np.array([np.ptp(run.position[:, :2], axis=0) for run in runs])
    depths = np.array([(run.position[:, 2].min(), run.position[:, 2].max()) for run in runs])
    lengths = [float(np.linalg.norm(np.diff(run.position, axis=0), axis=1).sum()) for run in runs]
    energies = [measure_extent(run, 0.0).energy for run in runs]

    def percentiles(values: Array) -> Array:
        return np.moveaxis(np.percentile(values, [LOW, 50.0, HIGH], axis=0), 0, -1)

    def outer(values: Sequence[float]) -> tuple[float, float]:
        low, high = np.percentile(values, [LOW, HIGH])
        return float(low), float(high)

    columns = {"turned": 8, "turn_rate": 5, "pitch": 7, "roll": 6, "speed": 0}
    north, east = np.percentile(extent, HIGH, axis=0)
    shallowest, deepest = np.percentile(depths[:, 0], LOW), np.percentile(depths[:, 1], HIGH)
    return Band(
        time,
        percentiles(position),
        **{name: percentiles(motion[:, :, column]) for name, column in columns.items()},
        box=(float(north), float(east)),
        depths=(float(shallowest), float(deepest)),
        length=outer(lengths),
        energy=outer(energies),
        number=len(runs),
    )


def manoeuvre_yaml(manoeuvre: AnyManoeuvre, comment: str) -> str:
    """Return the settings of a manoeuvre, SI, as YAML for an experiment."""
    settings = manoeuvre.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    ordered = {"name": manoeuvre.name, "type": manoeuvre.type, **settings}
    return f"# {comment}\n{yaml.safe_dump(ordered, sort_keys=False, default_flow_style=None, width=100)}"


def inputs_csv(manoeuvre: AnyManoeuvre, fins: FinSettings | None) -> str:
    """Return a table over time of the signals to add to the autopilot's commands, and of its set-points.

    Positive fin angles are those of the vehicle file's rudder and elevator; on an x tail, trailing edge to port.
    """
    plan = make_plan(manoeuvre.model_copy(update={"input_rate": _INPUT_RATE}))
    # Added signals, steps too, begin and end at zero.
    plan.feedforward[[0, -1]] = 0.0
    columns = {
        "time [s]": plan.time,
        **_added_signals(plan, fins, manoeuvre.limits.fin_angle),
        **_set_points(manoeuvre, plan),
    }
    table = np.column_stack(list(columns.values()))
    lines = [",".join(columns), *(",".join(f"{value + 0.0:.5g}" for value in row) for row in table)]
    return "\n".join(lines) + "\n"


def _added_signals(plan: ManoeuvrePlan, fins: FinSettings | None, limit: float) -> dict[str, Array]:
    """Return the added signals by column, cut at `limit`, rad."""
    signals = np.where(np.abs(plan.feedforward) < 1e-9, 0.0, plan.feedforward)
    bound, (rudder, elevator) = np.rad2deg(limit), np.rad2deg(signals[:, :2]).T
    if fins is not None and fins.tail == "x":
        falling, rising = np.clip(rudder - elevator, -bound, bound), np.clip(rudder + elevator, -bound, bound)
        named = {"rudder [deg]": 0.5 * (rising + falling), "elevator [deg]": 0.5 * (rising - falling)}
        named |= {"upper starboard fin [deg]": falling, "lower port fin [deg]": falling}
        named |= {"lower starboard fin [deg]": rising, "upper port fin [deg]": rising}
    else:
        rudder, elevator = np.clip(rudder, -bound, bound), np.clip(elevator, -bound, bound)
        named = {"rudder [deg]": rudder, "elevator [deg]": elevator}
        if fins is not None and fins.number == 4:
            named |= {"upper fin [deg]": rudder, "lower fin [deg]": rudder}
            named |= {"port fin [deg]": elevator, "starboard fin [deg]": elevator}
    return named | {"thrust [N]": signals[:, 2], "roll moment [N m]": signals[:, 3]}


def _set_points(manoeuvre: AnyManoeuvre, plan: ManoeuvrePlan) -> dict[str, Array]:
    """Return the set-points of the closed loops by column."""
    columns, autopilot = dict[str, Array](), manoeuvre.autopilot
    if autopilot.horizontal == "turn_rate":
        columns["held turn rate [deg/s]"] = np.rad2deg(plan.turn_rate)
    if autopilot.vertical == "depth":
        columns["held change of depth [m]"] = np.zeros(plan.time.size)
    else:
        columns["held pitch [deg]"] = np.full(plan.time.size, np.rad2deg(plan.pitch))
    return columns | {"held speed [m/s]": plan.speed}


def track_geojson(band: Band, origin: tuple[float, float]) -> str:
    """Return the median track, and boxes of the 5 to 95 % band every few seconds.

    Parameters
    ----------
    origin : tuple of float
        Latitude and longitude of the start, deg.
    """

    def coordinates(north: float, east: float) -> list[float]:
        latitude = np.deg2rad(origin[0])
        curvature = 1.0 - _ECCENTRICITY * np.sin(latitude) ** 2
        north_radius = _RADIUS * (1.0 - _ECCENTRICITY) / curvature**1.5
        east_radius = _RADIUS * np.cos(latitude) / np.sqrt(curvature)
        return [
            round(origin[1] + float(np.rad2deg(east / east_radius)), 8),
            round(origin[0] + float(np.rad2deg(north / north_radius)), 8),
        ]

    middle = [[*coordinates(*row[:2, 1]), round(-float(row[2, 1]), 2)] for row in band.position]
    boxes = []
    for (south, _, north), (west, _, east), _ in band.position[::_BOX_STEP]:
        corners = ((south, west), (south, east), (north, east), (north, west), (south, west))
        boxes.append([[coordinates(*corner) for corner in corners]])
    features = [
        _feature("LineString", middle, name="track", seconds_between_points=1, height="m above the start"),
        _feature("MultiPolygon", boxes, name="5 to 95 % band", seconds_between_boxes=_BOX_STEP),
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}) + "\n"


def _feature(kind: str, coordinates: list[Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def timeline_markdown(band: Band, envelope: Envelope, slowest: float, begun: float) -> str:
    """Return the expected course of the run, 5 to 95 of 100 vehicles, and the limits at which to abort it.

    Parameters
    ----------
    slowest : float
        Least speed, m/s.
    begun : float
        Time from which the speed counts, s.
    """
    every = max((band.time.size - 1) // _TIMELINE_ROWS, 1)
    columns = ("time (s)", "heading changed (deg)", "turn rate (deg/s)", "depth changed (m)", "pitch (deg)")
    header = (*columns, "roll (deg)", "speed (m/s)", "abort at a depth change of (m)")
    lines = [
        "# Timeline",
        "",
        f"Range of {band.number} probable vehicles (5 to 95 %). Heading and depth count from the start of the run.",
        "",
        f"| {' | '.join(header)} |",
        f"|{' ---: |' * len(header)}",
    ]
    depth = band.position[:, 2]
    for k in range(0, band.time.size, every):
        low, _, high = depth[k]
        margin = 0.25 * envelope.depth
        cells = (
            f"{band.time[k]:.0f}",
            *(_range(np.rad2deg(values[k])) for values in (band.turned, band.turn_rate)),
            _range(depth[k]),
            *(_range(np.rad2deg(values[k])) for values in (band.pitch, band.roll)),
            _range(band.speed[k]),
            f"{low - margin:.1f} or {high + margin:.1f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    limits = (
        f"roll beyond {np.rad2deg(envelope.roll):.0f} deg, pitch beyond {np.rad2deg(envelope.pitch):.0f} deg, "
        f"slower than {slowest:.2g} m/s for more than 5 s after the first {begun:.0f} s, more than "
        f"{envelope.box:.0f} m from the start of the run, or a depth outside the last column"
    )
    low, high = (np.array([length, 1e-3 * energy]) for length, energy in zip(band.length, band.energy, strict=True))
    total = (
        f"In all: {band.time[-1]:.0f} s, {low[0]:.0f} to {high[0]:.0f} m through the water, {low[1]:.3g} to "
        f"{high[1]:.3g} kJ of work by the thrust, without losses"
    )
    return "\n".join([*lines, "", f"{total}.", "", f"Abort at any time: {limits}."]) + "\n"


def _range(values: Array) -> str:
    return f"{values[0] + 0.0:.1f} to {values[-1] + 0.0:.1f}"


def checklist_markdown(manoeuvre: AnyManoeuvre, vehicle: VehicleSettings, band: Band) -> str:
    """Return the checklist of a run: before, during and after it."""
    shallowest, deepest = band.depths
    return f"""# Checklist: {vehicle.name}, {manoeuvre.duration:g} s

Before
- [ ] Water calm and deep enough: 95 of 100 vehicles stay within {band.box[0]:.0f} m north by {band.box[1]:.0f} m east,
      from {abs(min(shallowest, 0.0)):.1f} m above to {max(deepest, 0.0):.1f} m below the depth at which the run begins.
- [ ] Begin at least {abs(min(shallowest, 0.0)) + 2.0:.0f} m deep, heading north on the chart of track.geojson, at \
{manoeuvre.speed if manoeuvre.initial_speed is None else manoeuvre.initial_speed:g} m/s.
- [ ] Fins free, within {np.rad2deg(manoeuvre.limits.fin_angle):.0f} deg and \
{np.rad2deg(manoeuvre.limits.fin_rate):.0f} deg/s; their zero checked by eye.
- [ ] inputs.csv added to the autopilot's commands; the autopilot holds the values of the last columns.\
{_by_heading(manoeuvre)}
- [ ] Abort limits of timeline.md set in the vehicle.

Log, with one clock
- [ ] Gyroscope and accelerometer at 50 Hz or more, raw.
- [ ] DVL at every ping, in its own axes, and whether it had bottom lock.
- [ ] Attitude and depth at 10 Hz or more.
- [ ] Measured fin angles, not commands, and propeller speed, at 20 Hz or more.

Run
- [ ] A straight, level run of 30 s one way and back, to measure the current.
- [ ] The run of inputs.csv.
- [ ] A coast-down: straight, level, propeller off, for 20 s, to measure the drag without thrust.
- [ ] The run of inputs.csv once more: `auvid validate` needs data that were not used for the estimate.

After
- [ ] `auvid import`, `auvid inspect`, `auvid identify` the first run, `auvid validate` with the second.
"""


def _by_heading(manoeuvre: AnyManoeuvre) -> str:
    """Return the line on a zigzag, whose rudder follows the heading and is not in inputs.csv; empty without one."""
    if not isinstance(manoeuvre, Zigzag):
        return ""
    rudder, heading = np.rad2deg([manoeuvre.rudder, manoeuvre.heading])
    return f"""
- [ ] The rudder by the heading, without a control loop: straight for {manoeuvre.approach:g} s, then {rudder:.0f} deg to
      starboard, and to the other side whenever the heading is {heading:.0f} deg from that of the start."""
