"""Settings of how fins and propeller follow their commands."""

from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator

from auvid_cli.config.quantity import Amount, Unit
from auvid_cli.config.settings import Settings
from auvid_cli.vehicle.actuators import Actuator, Actuators


class _Follows(Settings):
    """Settings that fins and propeller share; a setting that is not given has no effect."""

    # Of commands, in SI.
    command_unit: ClassVar[str]

    @model_validator(mode="after")
    def _something_acts(self) -> Any:
        given = self.model_dump(exclude_none=True)
        dead_band, saturation = given.get("dead_band", 0.0), given.get("saturation")
        if saturation is not None and dead_band >= saturation:
            raise ValueError(
                f"dead_band ({dead_band:.4g} {self.command_unit}) is not less than saturation "
                f"({saturation:.4g} {self.command_unit}): no command would act"
            )
        return self

    def described(self) -> str:
        """Return what there is in words, SI, in the order in which it acts."""
        words = [
            f"{name.replace('_', ' ')} {value['angle']:g} with slope {value['slope']:g}"
            if isinstance(value, dict)
            else f"{name.replace('_', ' ')} {value:g}"
            for name, value in self.model_dump(exclude_none=True).items()
        ]
        return ", ".join(words)

    def actuator(self) -> Actuator:
        """Return it as the compiled law has it, SI."""
        given = self.model_dump(exclude_none=True)
        stall = given.pop("stall", None)
        return (
            Actuator(**given) if stall is None else Actuator(**given, stall=stall["angle"], stall_slope=stall["slope"])
        )


class Stall(Settings):
    """How a fin's force goes on beyond the deflection at which it stalls."""

    angle: Annotated[
        float, Amount("rad"), Field(gt=0, lt=1.6, description="deflection up to which the force grows in proportion")
    ]
    slope: Annotated[
        float,
        Field(
            ge=-100,
            lt=1,
            description="of the force by deflection beyond, over that before; less than 0 until none is left",
        ),
    ] = 0.0


_TimeConstant = Annotated[
    float | None, Amount("s"), Field(gt=0, le=1e3, description="of a first-order lag behind what is commanded")
]


class FinActuator(_Follows):
    """How both fins follow their commands."""

    command_unit = "rad"

    dead_band: Annotated[
        float | None,
        Amount("rad"),
        Field(gt=0, lt=1.6, description="commands count by what they exceed this, either way"),
    ] = None
    saturation: Annotated[
        float | None, Amount("rad"), Field(gt=0, lt=1.6, description="larger commands do no more than this one")
    ] = None
    rate_limit: Annotated[float | None, Amount("rad/s"), Field(gt=0, description="fastest that a fin turns")] = None
    time_constant: _TimeConstant = None
    stall: Stall | None = None


class PropellerActuator(_Follows):
    """How the surge force follows what is commanded of it."""

    command_unit = "N"

    dead_band: Annotated[
        float | None, Amount("N"), Field(gt=0, description="commands count by what they exceed this, either way")
    ] = None
    saturation: Annotated[
        float | None, Amount("N"), Field(gt=0, description="larger commands do no more than this one")
    ] = None
    rate_limit: Annotated[float | None, Unit("N/s"), Field(gt=0, description="fastest that the force changes")] = None
    time_constant: _TimeConstant = None


class ActuatorSettings(Settings):
    """Actuators between the recorded inputs (commands) and the fin angles and thrust that act."""

    fins: FinActuator = FinActuator()
    propeller: PropellerActuator = PropellerActuator()

    def described(self) -> dict[str, str]:
        """Return what there is of fins and propeller, in words, SI; empty of what follows its commands exactly."""
        return {"fins": self.fins.described(), "a propeller": self.propeller.described()}

    def actuators(self) -> Actuators:
        """Return them by input, SI."""
        fin = self.fins.actuator()
        return Actuators(fin, fin, self.propeller.actuator())
