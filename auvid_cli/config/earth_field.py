"""The magnetic field of the earth where a vehicle is, as charts and models of it state it."""

from typing import Annotated

import numpy as np
from pydantic import Field

from auvid_cli.config.quantity import Amount, Unit
from auvid_cli.config.settings import Settings


class EarthField(Settings):
    """What a magnetometer of three axes turns with; all three are to be stated."""

    strength: Annotated[float, Amount("T"), Field(gt=0, description="of the earth's field, some 25 to 65 uT")]
    declination: Annotated[float, Unit("rad"), Field(description="how far magnetic north is east of true north")]
    dip: Annotated[
        float, Unit("rad"), Field(gt=-np.pi / 2, lt=np.pi / 2, description="how steeply the field goes down")
    ]

    @property
    def earth_field(self) -> tuple[float, float, float]:
        """Return the field, north, east and down, T."""
        level = self.strength * np.cos(self.dip)
        north, east = level * np.cos(self.declination), level * np.sin(self.declination)
        return float(north), float(east), float(self.strength * np.sin(self.dip))
