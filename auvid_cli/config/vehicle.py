"""Settings of a vehicle: size, actuators, known parameters and coefficients, each with its source."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from auvid_cli.config.coefficients import Term, TermPrior, check_own_terms
from auvid_cli.config.geometry import GeometrySettings
from auvid_cli.config.settings import Settings
from auvid_cli.config.units import Amount, Unit
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.actuators import Actuator, Actuators
from auvid_cli.vehicle.coefficients import COEFFICIENTS, CoefficientSet
from auvid_cli.vehicle.geometry import DerivedValue, coefficients_from_geometry
from auvid_cli.vehicle.hull import Geometry
from auvid_cli.vehicle.parameters import PARAMETERS

_TimeConstant = Annotated[
    float | None, Amount("s"), Field(gt=0, le=1e3, description="of a first-order lag behind what is commanded")
]
# Added mass may hide an impossible mass from the mass matrix, so each is looked at by itself.
_POSITIVE = ("m", "W", "B", "Ixx", "Iyy", "Izz")


class _ActuatorSettings(Settings):
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


class FinActuator(_ActuatorSettings):
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


class PropellerActuator(_ActuatorSettings):
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

    def descriptions(self) -> dict[str, str]:
        """Return what there is of fins and propeller, in words, SI; empty of what follows its commands exactly."""
        return {"fins": self.fins.described(), "a propeller": self.propeller.described()}

    def actuators(self) -> Actuators:
        """Return them by input, SI."""
        fin = self.fins.actuator()
        return Actuators(fin, fin, self.propeller.actuator())


class VehicleEntry(Settings):
    """One number of a vehicle with where it comes from; a bare quantity is an entry without a source."""

    value: float
    status: Annotated[str, Field(description="read, derived or assumed, and how")] = "stated"
    source: Annotated[str | None, Field(description="where from, if not the vehicle file's own source")] = None
    standard_deviation: Annotated[float | None, Field(description="how sure it is, in the unit of the value")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_quantity(cls, data: Any) -> Any:
        return data if isinstance(data, dict | VehicleEntry) else {"value": data}


class CoefficientEntry(VehicleEntry):
    """A coefficient, and whether it is known well enough, or too small, to be left out of what is estimated."""

    estimate: Annotated[
        bool | None, Field(strict=True, description="false: `identification.coefficients: all` does not mean it")
    ] = None


def _entry(unit: str, base: type[VehicleEntry] = VehicleEntry, positive: bool = False) -> type[VehicleEntry]:
    limits = (Amount(unit), Field(gt=0)) if positive else (Unit(unit),)
    return create_model(
        base.__name__,
        __base__=base,
        value=(Annotated[float, *limits], ...),
        standard_deviation=(Annotated[float | None, Amount(unit), Field(gt=0)], None),
    )


def _identifier(symbol: str) -> str:
    return symbol.replace("|", "_")


class _Table(Settings):
    """Entries by symbol; the fields come from the tables in `auvid_cli.vehicle`."""

    def by_symbol(self) -> dict[str, float]:
        """Return the values of the entries that are given, SI, by the paper's symbol."""
        return {symbol: entry.value for symbol, entry in self._entries()}

    def deviations(self) -> dict[str, float]:
        """Return the standard deviations of the entries that state one, SI, by the paper's symbol."""
        return {symbol: entry.standard_deviation for symbol, entry in self._entries() if entry.standard_deviation}

    def not_estimated(self) -> list[str]:
        """Return the symbols of those that are not to be estimated where all are, by the paper's symbol."""
        return [s for s, entry in self._entries() if isinstance(entry, CoefficientEntry) and entry.estimate is False]

    def _entries(self) -> Iterator[tuple[str, VehicleEntry]]:
        for name, field in type(self).model_fields.items():
            if (entry := getattr(self, name)) is not None:
                yield field.alias or name, entry


if TYPE_CHECKING:
    ParameterTable = CoefficientTable = _Table
else:
    ParameterTable = create_model(
        "ParameterTable",
        __base__=_Table,
        **{
            q.symbol: (_entry(q.unit, positive=q.symbol in _POSITIVE), Field(description=q.meaning)) for q in PARAMETERS
        },
    )
    CoefficientTable = create_model(
        "CoefficientTable",
        __base__=_Table,
        **{
            _identifier(c.symbol): (
                _entry(c.unit, CoefficientEntry) | None,
                Field(None, alias=c.symbol, description=c.meaning),
            )
            for c in COEFFICIENTS
        },
    )


class Size(Settings):
    """Size of the vehicle, from which the natural magnitude of a coefficient follows."""

    length: Annotated[float, Unit("m"), Field(ge=1e-2, le=1e3, description="hull length")]
    diameter: Annotated[float, Unit("m"), Field(ge=1e-3, le=1e3, description="hull diameter")]
    density: Annotated[float, Unit("kg/m^3"), Field(ge=1, le=2e4, description="density of the water")] = 1025.0


class Drawing(Settings):
    """Drawing of a vehicle, from which a vehicle file can be made."""

    name: str
    mass: Annotated[float, Amount("kg"), Field(gt=0, description="with all water inside")]
    size: Size
    geometry: GeometrySettings

    @field_validator("geometry", mode="after")
    @classmethod
    def _parts_that_fit(cls, value: GeometrySettings, info: ValidationInfo) -> GeometrySettings:
        return _fitting(value, info)


def _fitting(geometry: GeometrySettings, info: ValidationInfo) -> GeometrySettings:
    """Return a geometry that makes a shape of the size that stands before it."""
    size: Size | None = info.data.get("size")
    if size is not None:
        geometry.shape(size.length, size.diameter, size.density)
    return geometry


class VehicleSettings(Settings):
    """A vehicle file."""

    name: str
    source: Annotated[str, Field(description="where the numbers come from")] = ""
    notes: tuple[str, ...] = ()
    size: Size
    geometry: Annotated[
        GeometrySettings | None, Field(description="hull and fins, for `prior: geometry` and for checks")
    ] = None
    parameters: ParameterTable
    coefficients: Annotated[
        CoefficientTable,
        Field(description="needed by a simulation, and for those that are held while others are estimated"),
    ] = CoefficientTable()

    terms: Annotated[tuple[Term, ...], Field(description="of the equations of motion beyond the 22")] = ()
    actuators: Annotated[
        ActuatorSettings,
        Field(description="how fins and propeller follow the recorded inputs, which are commands then"),
    ] = ActuatorSettings()

    @field_validator("geometry", mode="after")
    @classmethod
    def _parts_that_fit(cls, value: GeometrySettings | None, info: ValidationInfo) -> GeometrySettings | None:
        return value if value is None else _fitting(value, info)

    def shape(self) -> Geometry | None:
        """Return hull and fins in body axes, SI, where they are stated."""
        if self.geometry is None:
            return None
        return self.geometry.shape(self.size.length, self.size.diameter, self.size.density)

    def derived_values(self) -> tuple[DerivedValue, ...]:
        """Return what follows from the shape, SI; nothing where it is not stated."""
        shape = self.shape()
        if shape is None or self.geometry is None:
            return ()
        return coefficients_from_geometry(shape, self.known_parameters()["m"], self.geometry.speed)

    @field_validator("terms")
    @classmethod
    def _terms_of_their_own(cls, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        check_own_terms(terms)
        return terms

    @property
    def coefficient_set(self) -> CoefficientSet:
        """Return the 22 and the vehicle's own terms."""
        return CoefficientSet((*COEFFICIENTS, *(term.coefficient for term in self.terms)))

    def known_parameters(self) -> dict[str, float]:
        """Return the known parameters by symbol, SI."""
        return self.parameters.by_symbol()

    def stated_coefficients(self) -> dict[str, float]:
        """Return the coefficients, of the 22 and of own terms, that have a value, SI, by symbol."""
        return self.coefficients.by_symbol() | {t.name: t.value for t in self.terms if t.value is not None}

    def stated_deviations(self) -> dict[str, float]:
        """Return the standard deviations of those that state one, SI, by symbol."""
        of_terms = {t.name: t.standard_deviation for t in self.terms if t.standard_deviation is not None}
        return self.coefficients.deviations() | of_terms

    def with_coefficients(self, values: Mapping[str, float]) -> "VehicleSettings":
        """Return the same with these values, SI, of all coefficients."""
        terms = tuple(term.model_copy(update={"value": values[term.name]}) for term in self.terms)
        table = self.coefficients.model_validate({c.symbol: values[c.symbol] for c in COEFFICIENTS})
        return self.model_copy(update={"coefficients": table, "terms": terms})

    def term_prior(self, symbol: str) -> TermPrior:
        """Return what a term states of itself before any data; nothing for one of the 22."""
        return next((term.prior for term in self.terms if term.name == symbol), TermPrior())

    def not_estimated(self) -> tuple[str, ...]:
        """Return the symbols of coefficients that are not to be estimated where all are."""
        return (*self.coefficients.not_estimated(), *(term.name for term in self.terms if not term.estimate))

    def all_coefficients(self) -> dict[str, float]:
        """Return the 22 coefficients and those of own terms by symbol, SI, for a simulation.

        Raises
        ------
        ConfigError
            If one of them is not given.
        """
        given = self.stated_coefficients()
        if missing := [symbol for symbol in self.coefficient_set.symbols if symbol not in given]:
            raise ConfigError(
                f"vehicle {self.name!r} states no value for {', '.join(missing)}: a simulation needs all "
                f"{len(COEFFICIENTS)} coefficients, and those of the vehicle's own terms"
            )
        return {symbol: given[symbol] for symbol in self.coefficient_set.symbols}
