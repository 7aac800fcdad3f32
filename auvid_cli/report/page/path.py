"""Where the vehicle went: plan, profile, and in space."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvid_cli.data.dataset import TruthRecord
from auvid_cli.data.estimate import Estimate
from auvid_cli.report.figures.series import spaced
from auvid_cli.report.notation import filter_label
from auvid_cli.report.page.parts import Part, PathTrack, Space, Words
from auvid_cli.report.page.picture import Axis, Picture, Shape, frame, stroke
from auvid_cli.report.travelled_paths import travelled, travelled_paths
from auvid_cli.vehicle.parameters import MOTION_SYMBOLS

Array = NDArray[np.float64]

_WIDTH, _HEIGHT, _LEFT, _TOP, _BOTTOM, _RIGHT = 520.0, 420.0, 58.0, 30.0, 48.0, 16.0
_MARGIN = 0.05
# Most points of a path that is turned.
_MOST_POINTS = 500


def path_parts(truth: TruthRecord | None, estimates: Sequence[Estimate]) -> list[Part]:
    """Draw the true path, where it is known, and those that follow from the estimated motion alone."""
    tracks = _tracks(truth, estimates)
    if not tracks:
        return []
    ends = ", ".join(
        f"{track.label} {np.linalg.norm(track.position[-1] - tracks[0].position[-1]):.3g} m" for track in tracks[1:]
    )
    words = "An estimate's path is dead reckoning: its velocities, turned by its attitude, added up"
    words += " from the true start." if truth is not None else " from its start."
    if ends and truth is not None:
        words += f" At the end they are off by: {ends}."
    says = f"Paths of {', '.join(track.label for track in tracks)} in space."
    return [Words([words]), _plan(tracks), _profile(tracks), Space(says, tracks)]


def _tracks(truth: TruthRecord | None, estimates: Sequence[Estimate]) -> list[PathTrack]:
    tracks = []
    for track in travelled_paths(truth, (estimate.course(MOTION_SYMBOLS) for estimate in estimates)):
        names = ("truth", "true") if track.filter is None else (filter_label(track.filter), track.filter)
        tracks.append(PathTrack(*names, track.position[spaced(len(track.position), _MOST_POINTS)]))
    return tracks


def _legend(tracks: Sequence[PathTrack]) -> list[tuple[str, str]]:
    return [(track.look, track.label) for track in tracks]


def _plan(tracks: Sequence[PathTrack]) -> Picture:
    """Draw north over east, both to one scale."""
    every = np.concatenate([track.position for track in tracks])
    (north, east), ranges = every[:, :2].max(axis=0), np.ptp(every[:, :2], axis=0)
    wide, high = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM
    metres = (1.0 + 2.0 * _MARGIN) * max(ranges[1] / wide, ranges[0] / high, 1e-3)
    middle = north - 0.5 * ranges[0], east - 0.5 * ranges[1]
    across = Axis(middle[1] - 0.5 * metres * wide, middle[1] + 0.5 * metres * wide, _LEFT, _LEFT + wide)
    up = Axis(middle[0] - 0.5 * metres * high, middle[0] + 0.5 * metres * high, _TOP + high, _TOP)
    shapes = frame(across, up, "east (m)", "north (m)")
    shapes += [stroke(t.position[:, 1], t.position[:, 0], across, up, t.look) for t in tracks]
    says = f"The paths reach over {ranges[0]:.3g} m north and {ranges[1]:.3g} m east."
    return Picture("Plan", says, _WIDTH, _HEIGHT, shapes, _legend(tracks))


def _profile(tracks: Sequence[PathTrack]) -> Picture:
    """Draw depth, growing downwards, over the distance along the track."""
    along = [travelled(track.position) for track in tracks]
    depths = np.concatenate([track.position[:, 2] for track in tracks])
    room = max(_MARGIN * float(np.ptp(depths)), 0.5)
    across = Axis(0.0, max(float(max(x[-1] for x in along)), 1.0), _LEFT, _WIDTH - _RIGHT)
    down = Axis(float(depths.min()) - room, float(depths.max()) + room, _TOP, _HEIGHT - _BOTTOM)
    shapes: list[Shape] = frame(across, down, "distance along the track (m)", "depth (m)")
    shapes += [
        stroke(x, track.position[:, 2], across, down, track.look) for x, track in zip(along, tracks, strict=True)
    ]
    says = f"Depth from {depths.min():.3g} to {depths.max():.3g} m along {across.high:.4g} m of track."
    return Picture("Profile", says, _WIDTH, _HEIGHT, shapes, _legend(tracks))
