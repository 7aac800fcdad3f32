"""Limits of a designed run: room, attitude, speed, energy."""

from typing import Annotated

import numpy as np
from pydantic import Field

from auvid_cli.config.quantity import Amount
from auvid_cli.config.settings import Settings

_Length = Annotated[float, Amount("m"), Field(gt=0)]
_Inclination = Annotated[float, Amount("rad"), Field(gt=0, lt=1.48)]


class Envelope(Settings):
    """Limits that every drawn vehicle has to keep, each named as the option that sets it."""

    box: Annotated[_Length, Field(description="largest extent of the track, north and east")] = 200.0
    depth: Annotated[_Length, Field(description="from the shallowest to the deepest point")] = 40.0
    pitch: Annotated[_Inclination, Field(description="largest pitch, up or down")] = float(np.deg2rad(40.0))
    roll: Annotated[_Inclination, Field(description="largest roll, either way")] = float(np.deg2rad(40.0))
    speed: Annotated[
        float | None, Amount("m/s"), Field(gt=0, description="least speed after the start; else 0.4 of the cruise")
    ] = None
    energy: Annotated[
        float | None, Amount("J"), Field(gt=0, description="largest work of the thrust, without losses; else any")
    ] = None
