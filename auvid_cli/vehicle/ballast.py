"""What lies between weight and buoyancy as they are stated and those that act."""

from collections.abc import Mapping
from typing import NamedTuple


class Ballast(NamedTuple):
    """What lies between weight and buoyancy as they are stated and those that act.

    Attributes
    ----------
    excess_buoyancy : float
        Buoyancy less weight beyond what is stated, at the origin, upwards along the earth's vertical, N.
    trim_moment : float
        Pitching moment beyond the stated, bow up, of a level vehicle, N m.

    Notes
    -----
    A moment that is there at rest is one of weights off their place. Those of W a distance d ahead of where it is
    stated are ``d e_x x W down``, with ``down = (-sin theta, cos theta sin phi, cos theta cos phi)``: in pitch
    ``-d W cos theta cos phi``, in yaw ``d W cos theta sin phi``, in roll none. With ``trim_moment = -d W`` they are
    ``trim_moment cos theta cos phi`` and ``-trim_moment cos theta sin phi``.
    """

    excess_buoyancy: float = 0.0
    trim_moment: float = 0.0

    def added_to(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the known parameters, SI, of a vehicle that is stated right: its buoyancy and where that acts."""
        buoyancy = parameters["B"] + self.excess_buoyancy
        # What is more acts at the origin, so that all the moments of the buoyancy but that of the trim stay.
        moments = {axis: parameters[f"{axis}B"] * parameters["B"] for axis in "xyz"}
        moments["x"] += self.trim_moment
        return {**parameters, "B": buoyancy, **{f"{axis}B": moment / buoyancy for axis, moment in moments.items()}}


NO_BALLAST = Ballast()
N_BALLAST = len(Ballast._fields)
