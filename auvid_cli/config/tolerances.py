"""Standard deviations of known quantities: parameters of the vehicle, gains, scales, mountings and delays."""

from typing import Annotated, Any

from pydantic import Field, model_validator

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Amount, Unit

_Share = Annotated[float, Unit("1"), Field(ge=0, le=10)]
_Length = Annotated[float, Amount("m"), Field(ge=0)]
_Angle = Annotated[float, Amount("rad"), Field(ge=0, le=1)]


class Tolerances(Settings):
    """Standard deviations of known quantities that have no `standard_deviation` of their own and are not estimated.

    They enter the total standard deviations. `usual` has the defaults; `none` has zeros: everything is known exactly.
    The documentation lists their sources on the page about ± and the judgement.
    """

    mass: Annotated[_Share, Field(description="of the mass, as a share of it")] = 0.005
    inertia: Annotated[_Share, Field(description="of each moment of inertia, as a share of it")] = 0.05
    added_mass: Annotated[_Share, Field(description="of each added mass, as a share of it")] = 0.1
    buoyancy: Annotated[_Share, Field(description="of buoyancy less weight, as a share of the buoyancy")] = 0.001
    centre_of_gravity: Annotated[_Length, Field(description="of zG")] = 0.001
    trim: Annotated[_Length, Field(description="of xG and yG, by which a floating vehicle is trimmed")] = 0.0001
    thrust: Annotated[_Share, Field(description="of the surge force, as a share of it")] = 0.05
    thrust_fade: Annotated[
        _Share, Field(description="of the fall of thrust from rest to the mean speed, as a share")
    ] = 0.1
    linear_damping: Annotated[
        _Share,
        Field(
            description="of drag and damping of pitch and yaw that do not grow with speed, as a share, at mean speed"
        ),
    ] = 0.1
    fins: Annotated[_Share, Field(description="of each fin angle, as a share of it")] = 0.02
    held_coefficients: Annotated[
        _Share, Field(description="of each coefficient that is not estimated, as a share of it")
    ] = 0.4
    dvl_scale: Annotated[_Share, Field(description="of the scale of the DVL")] = 0.002
    dvl_yaw: Annotated[_Angle, Field(description="of the mounting yaw of the DVL")] = 0.0034907
    dvl_position: Annotated[_Length, Field(description="of each coordinate of the DVL")] = 0.01
    gyroscope_scale: Annotated[_Share, Field(description="of the scale of each gyro")] = 0.002
    gyroscope_mounting: Annotated[_Angle, Field(description="of the mounting of the gyroscope about each axis")] = (
        0.0034907
    )
    ahrs: Annotated[_Angle, Field(description="of the constant errors of roll, pitch and heading of an AHRS")] = (
        0.0034907
    )
    accelerometer_position: Annotated[_Length, Field(description="of each coordinate of the accelerometer")] = 0.01
    delay: Annotated[float, Amount("s"), Field(ge=0, description="of each delay of gyroscope, DVL and inputs")] = 0.003

    @model_validator(mode="before")
    @classmethod
    def _accept_a_word(cls, data: Any) -> Any:
        if data == "usual":
            return {}
        if data == "none":
            return dict.fromkeys(cls.model_fields, 0.0)
        if isinstance(data, str):
            raise ValueError("expected usual, none, or standard deviations such as {inertia: 3 %, delay: 1 ms}")
        return data
