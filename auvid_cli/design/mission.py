"""What the crew of a vehicle needs to sail a manoeuvre, as the texts of files: inputs, track, timeline, checklist."""

import json
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from auvid_cli.config.geometry import FinSettings
from auvid_cli.config.manoeuvre import AnyManoeuvre, Envelope, Zigzag
from auvid_cli.config.vehicle import VehicleSettings
from auvid_cli.design.envelope import Band
from auvid_cli.simulation.manoeuvres import ManoeuvrePlan, make_plan

Array = NDArray[np.float64]

# Hz: what vehicles play back.
_RATE = 20.0
# Seconds between two rows of the timeline, two corners of the track, and two boxes of its band.
_ROWS, _BOXES = 12, 5
# Equatorial radius, m, and eccentricity squared of WGS 84.
_RADIUS, _ECCENTRICITY = 6378137.0, 6.69437999014e-3


def manoeuvre_yaml(manoeuvre: AnyManoeuvre, comment: str) -> str:
    """Write the settings of a manoeuvre, SI, as an experiment names them."""
    settings = manoeuvre.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    # The type comes first for whoever reads it; a default or not, it tells the others apart.
    ordered = {"name": manoeuvre.name, "type": manoeuvre.type, **settings}
    return f"# {comment}\n{yaml.safe_dump(ordered, sort_keys=False, default_flow_style=None, width=100)}"


def inputs_csv(manoeuvre: AnyManoeuvre, fins: FinSettings | None) -> str:
    """Write what is added to the autopilot's commands, fin by fin where these are known, and what it has to hold.

    Notes
    -----
    A fin is positive as the vehicle file's rudder and elevator are; of an x tail that is the trailing edge to port.
    """
    plan = make_plan(manoeuvre.model_copy(update={"input_rate": _RATE}))
    # All that is added begins and ends with the run, steps too.
    plan.feedforward[[0, -1]] = 0.0
    columns = {"time [s]": plan.time, **_signals(plan, fins, manoeuvre.limits.fin_angle), **_held(manoeuvre, plan)}
    table = np.column_stack(list(columns.values()))
    lines = [",".join(columns), *(",".join(f"{value + 0.0:.5g}" for value in row) for row in table)]
    return "\n".join(lines) + "\n"


def _signals(plan: ManoeuvrePlan, fins: FinSettings | None, limit: float) -> dict[str, Array]:
    """Return the added signals, as far as fins go."""
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


def _held(manoeuvre: AnyManoeuvre, plan: ManoeuvrePlan) -> dict[str, Array]:
    """Return what the loops that are closed hold."""
    held, autopilot = dict[str, Array](), manoeuvre.autopilot
    if autopilot.horizontal == "turn_rate":
        held["held turn rate [deg/s]"] = np.rad2deg(plan.turn_rate)
    if autopilot.vertical == "depth":
        held["held change of depth [m]"] = np.zeros(plan.time.size)
    else:
        held["held pitch [deg]"] = np.full(plan.time.size, np.rad2deg(plan.pitch))
    return held | {"held speed [m/s]": plan.speed}


def track_geojson(band: Band, origin: tuple[float, float]) -> str:
    """Write the middle track, and boxes that 5 to 95 of 100 vehicles are between, every few seconds.

    Parameters
    ----------
    band : Band
    origin : tuple of float
        Latitude and longitude of the start, degrees.
    """

    def place(north: float, east: float) -> list[float]:
        latitude = np.deg2rad(origin[0])
        flat = 1.0 - _ECCENTRICITY * np.sin(latitude) ** 2
        by_north = _RADIUS * (1.0 - _ECCENTRICITY) / flat**1.5
        by_east = _RADIUS * np.cos(latitude) / np.sqrt(flat)
        return [
            round(origin[1] + float(np.rad2deg(east / by_east)), 8),
            round(origin[0] + float(np.rad2deg(north / by_north)), 8),
        ]

    middle = [[*place(*row[:2, 1]), round(-float(row[2, 1]), 2)] for row in band.position]
    boxes = []
    for (south, _, north), (west, _, east), _ in band.position[::_BOXES]:
        corners = ((south, west), (south, east), (north, east), (north, west), (south, west))
        boxes.append([[place(*corner) for corner in corners]])
    features = [
        _feature("LineString", middle, name="track", seconds_between_points=1, height="m above the start"),
        _feature("MultiPolygon", boxes, name="5 to 95 % band", seconds_between_boxes=_BOXES),
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}) + "\n"


def _feature(kind: str, coordinates: list[Any], **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def timeline_markdown(band: Band, envelope: Envelope, slowest: float, begun: float) -> str:
    """Write what a person sees as the run goes on, 5 to 95 of 100 vehicles, and where to end it.

    Parameters
    ----------
    band : Band
    envelope : Envelope
    slowest : float
        m/s.
    begun : float
        s, from when on the speed counts.
    """
    every = max((band.time.size - 1) // _ROWS, 1)
    columns = ("time (s)", "heading changed (deg)", "turn rate (deg/s)", "depth changed (m)", "pitch (deg)")
    header = (*columns, "roll (deg)", "speed (m/s)", "abort at a depth change of (m)")
    lines = [
        "# Timeline",
        "",
        f"Of {band.number} vehicles as they may be: 5 to 95 of 100. Heading and depth from the start of the run.",
        "",
        f"| {' | '.join(header)} |",
        f"|{' ---: |' * len(header)}",
    ]
    depth = band.position[:, 2]
    for place in range(0, band.time.size, every):
        low, _, high = depth[place]
        margin = 0.25 * envelope.depth
        cells = (
            f"{band.time[place]:.0f}",
            *(_range(np.rad2deg(values[place])) for values in (band.turned, band.turn_rate)),
            _range(depth[place]),
            *(_range(np.rad2deg(values[place])) for values in (band.pitch, band.roll)),
            _range(band.speed[place]),
            f"{low - margin:.1f} or {high + margin:.1f}",
        )
        lines.append(f"| {' | '.join(cells)} |")
    limits = (
        f"roll beyond {np.rad2deg(envelope.roll):.0f} deg, pitch beyond {np.rad2deg(envelope.pitch):.0f} deg, "
        f"slower than {slowest:.2g} m/s for more than 5 s after the first {begun:.0f} s, more than "
        f"{envelope.box:.0f} m from where the run began, or a depth outside the last column"
    )
    low, high = (np.array([length, 1e-3 * energy]) for length, energy in zip(band.length, band.energy, strict=True))
    whole = (
        f"In all: {band.time[-1]:.0f} s, {low[0]:.0f} to {high[0]:.0f} m through the water, {low[1]:.3g} to "
        f"{high[1]:.3g} kJ of work by the thrust, without losses"
    )
    return "\n".join([*lines, "", f"{whole}.", "", f"Abort at any time: {limits}."]) + "\n"


def _range(values: Array) -> str:
    return f"{values[0] + 0.0:.1f} to {values[-1] + 0.0:.1f}"


def checklist_markdown(manoeuvre: AnyManoeuvre, vehicle: VehicleSettings, band: Band) -> str:
    """Write what to do before, between and after, so that the data can be used."""
    shallowest, deepest = band.depths
    return f"""# Checklist: {vehicle.name}, {manoeuvre.duration:g} s

Before
- [ ] Water calm and deep enough: 95 of 100 vehicles stay within {band.box[0]:.0f} m north by {band.box[1]:.0f} m east,
      from {abs(min(shallowest, 0.0)):.1f} m above to {max(deepest, 0.0):.1f} m below the depth at which the run begins.
- [ ] Begin at least {abs(min(shallowest, 0.0)) + 2.0:.0f} m deep, heading north on the chart of track.geojson, at \
{manoeuvre.speed if manoeuvre.initial_speed is None else manoeuvre.initial_speed:g} m/s.
- [ ] Fins free, within {np.rad2deg(manoeuvre.limits.fin_angle):.0f} deg and \
{np.rad2deg(manoeuvre.limits.fin_rate):.0f} deg/s; their zero checked by eye.
- [ ] inputs.csv added to what the autopilot commands, which holds what its last columns say.{_by_heading(manoeuvre)}
- [ ] Abort limits of timeline.md set in the vehicle.

Log, with one clock
- [ ] Gyroscope and accelerometer at 50 Hz or more, raw.
- [ ] DVL at every ping, in its own axes, and whether it had bottom lock.
- [ ] Attitude and depth at 10 Hz or more.
- [ ] Fins as executed, not as commanded, and propeller speed, at 20 Hz or more.

Sail
- [ ] A straight, level run of 30 s one way and back: the current follows from the two.
- [ ] The run of inputs.csv.
- [ ] A coast-down: straight, level, propeller off, for 20 s: drag without thrust.
- [ ] The run of inputs.csv once more: `auvid validate` needs data that no estimate has seen.

After
- [ ] `auvid import`, `auvid inspect`, `auvid identify` the first run, `auvid validate` with the second.
"""


def _by_heading(manoeuvre: AnyManoeuvre) -> str:
    """Return what is steered by what the vehicle does, and is in no table over time."""
    if not isinstance(manoeuvre, Zigzag):
        return ""
    rudder, heading = np.rad2deg([manoeuvre.rudder, manoeuvre.heading])
    return f"""
- [ ] The rudder by the heading, no loop holds it: straight for {manoeuvre.approach:g} s, then {rudder:.0f} deg to
      starboard, and to the other side whenever the heading is {heading:.0f} deg from that of the start."""
