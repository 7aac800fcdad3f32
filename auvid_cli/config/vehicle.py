"""Settings of a vehicle: size, actuators, parameters and coefficients, each with its source."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar

from pydantic import Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.coefficients import Term, TermPrior, check_own_terms
from auvid_cli.config.geometry import GeometrySettings
from auvid_cli.config.settings import Settings, make_settings, with_fields
from auvid_cli.config.units import Amount, Unit
from auvid_cli.errors import ConfigError
from auvid_cli.vehicle.coefficients import COEFFICIENTS, Coefficient, CoefficientSet
from auvid_cli.vehicle.geometry import DerivedValue, coefficients_from_geometry
from auvid_cli.vehicle.hull import Geometry
from auvid_cli.vehicle.parameters import PARAMETERS, Actuator, Actuators

_TimeConstant = Annotated[float | None, Amount("s"), Field(gt=0, le=1e3, description="time constant of the lag")]
# Added mass can hide an invalid mass in the mass matrix, so each of these is checked by itself.
_POSITIVE = ("m", "W", "B", "Ixx", "Iyy", "Izz")


class _ActuatorSettings(Settings):
    """Settings that fins and propeller share; missing settings have no effect."""

    command_unit: ClassVar[str]

    @model_validator(mode="after")
    def _dead_band_below_saturation(self) -> Any:
        given = self.model_dump(exclude_none=True)
        dead_band, saturation = given.get("dead_band", 0.0), given.get("saturation")
        if saturation is not None and dead_band >= saturation:
            raise ValueError(
                f"dead_band ({dead_band:.4g} {self.command_unit}) must be less than saturation "
                f"({saturation:.4g} {self.command_unit}); otherwise no command has an effect"
            )
        return self

    def description(self) -> str:
        """Return the given settings in words, SI, in the order of their effects."""
        words = [
            f"{name.replace('_', ' ')} {value['angle']:g} with slope {value['slope']:g}"
            if isinstance(value, dict)
            else f"{name.replace('_', ' ')} {value:g}"
            for name, value in self.model_dump(exclude_none=True).items()
        ]
        return ", ".join(words)

    def actuator(self) -> Actuator:
        """Return the parameters of the compiled model, SI."""
        given = self.model_dump(exclude_none=True)
        stall = given.pop("stall", None)
        return (
            Actuator(**given) if stall is None else Actuator(**given, stall=stall["angle"], stall_slope=stall["slope"])
        )


class Stall(Settings):
    """Stall of a fin: its force beyond a limit angle."""

    angle: Annotated[float, Amount("rad"), Field(gt=0, lt=1.6, description="largest angle without stall")]
    slope: Annotated[
        float,
        Field(
            ge=-100,
            lt=1,
            description="slope of the force beyond that angle, divided by the slope below it; if negative, the force "
            "falls to 0",
        ),
    ] = 0.0


class FinActuator(_ActuatorSettings):
    """Dynamics of both fins."""

    command_unit = "rad"

    dead_band: Annotated[
        float | None, Amount("rad"), Field(gt=0, lt=1.6, description="dead band, subtracted from commands")
    ] = None
    saturation: Annotated[float | None, Amount("rad"), Field(gt=0, lt=1.6, description="largest command")] = None
    rate_limit: Annotated[float | None, Amount("rad/s"), Field(gt=0, description="largest fin rate")] = None
    time_constant: _TimeConstant = None
    stall: Stall | None = None


class PropellerActuator(_ActuatorSettings):
    """Dynamics of the surge force."""

    command_unit = "N"

    dead_band: Annotated[float | None, Amount("N"), Field(gt=0, description="dead band, subtracted from commands")] = (
        None
    )
    saturation: Annotated[float | None, Amount("N"), Field(gt=0, description="largest command")] = None
    rate_limit: Annotated[float | None, Unit("N/s"), Field(gt=0, description="largest rate of the force")] = None
    time_constant: _TimeConstant = None


class ActuatorSettings(Settings):
    """Dynamics between the recorded inputs, which are commands, and the actual fin angles and thrust."""

    fins: FinActuator = FinActuator()
    propeller: PropellerActuator = PropellerActuator()

    def descriptions(self) -> dict[str, str]:
        """Return the settings of fins and propeller in words, SI; empty for an ideal actuator."""
        return {"fins": self.fins.description(), "a propeller": self.propeller.description()}

    def actuators(self) -> Actuators:
        """Return the actuator of each input, SI."""
        fin = self.fins.actuator()
        return Actuators(fin, fin, self.propeller.actuator())


class VehicleEntry(Settings):
    """One number of a vehicle with its source; a bare quantity is an entry without a source."""

    value: float
    status: Annotated[str, Field(description="read, derived or assumed, and how")] = "stated"
    source: Annotated[str | None, Field(description="source, if not that of the vehicle file")] = None
    standard_deviation: Annotated[float | None, Field(description="standard deviation of the value")] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_quantity(cls, data: Any) -> Any:
        return data if isinstance(data, dict | VehicleEntry) else {"value": data}


class CoefficientEntry(VehicleEntry):
    """A coefficient, and whether it is estimated by default."""

    estimate: Annotated[bool | None, Field(strict=True, description="false: `coefficients: all` excludes it")] = None


@cache
def _entry(unit: str, base: type[VehicleEntry] = VehicleEntry, positive: bool = False) -> type[VehicleEntry]:
    limits = (Amount(unit), Field(gt=0)) if positive else (Unit(unit),)
    return make_settings(
        f"{base.__name__}[{'positive ' if positive else ''}{unit}]",
        __name__,
        base,
        None,
        value=(Annotated[float, *limits], ...),
        standard_deviation=(Annotated[float | None, Amount(unit), Field(gt=0)], None),
    )


class _Table(Settings):
    """Entries by symbol; the fields come from the tables in `auvid_cli.vehicle`."""

    def by_symbol(self) -> dict[str, float]:
        """Return the given values by symbol, SI."""
        return {symbol: entry.value for symbol, entry in self._entries()}

    def deviations(self) -> dict[str, float]:
        """Return the given standard deviations by symbol, SI."""
        return {symbol: entry.standard_deviation for symbol, entry in self._entries() if entry.standard_deviation}

    def not_estimated(self) -> list[str]:
        """Return the symbols of the coefficients with `estimate: false`."""
        return [s for s, entry in self._entries() if isinstance(entry, CoefficientEntry) and entry.estimate is False]

    def _entries(self) -> Iterator[tuple[str, VehicleEntry]]:
        for name, field in type(self).model_fields.items():
            if (entry := getattr(self, name)) is not None:
                yield field.alias or name, entry


@with_fields(
    **{q.symbol: (_entry(q.unit, positive=q.symbol in _POSITIVE), Field(description=q.meaning)) for q in PARAMETERS}
)
class ParameterTable(_Table):
    """Known parameters by symbol."""


def _coefficient_field(c: Coefficient) -> Any:
    return _entry(c.unit, CoefficientEntry) | None, Field(None, alias=c.symbol, description=c.meaning)


@with_fields(**{c.symbol.replace("|", "_"): _coefficient_field(c) for c in COEFFICIENTS})
class CoefficientTable(_Table):
    """Coefficients by symbol."""


class Size(Settings):
    """Size of the vehicle, from which the natural magnitudes of coefficients follow."""

    length: Annotated[float, Unit("m"), Field(ge=1e-2, le=1e3, description="hull length")]
    diameter: Annotated[float, Unit("m"), Field(ge=1e-3, le=1e3, description="hull diameter")]
    density: Annotated[float, Unit("kg/m^3"), Field(ge=1, le=2e4, description="density of the water")] = 1025.0


class _WithGeometry(Settings):
    """Settings with a geometry that must match `size`; `size` must be declared before it."""

    @field_validator("geometry", mode="after", check_fields=False)
    @classmethod
    def _valid_geometry(cls, value: GeometrySettings | None, info: ValidationInfo) -> GeometrySettings | None:
        size: Size | None = info.data.get("size")
        if value is not None and size is not None:
            value.shape(size.length, size.diameter, size.density)
        return value


class Drawing(_WithGeometry):
    """Drawing of a vehicle, from which `auvid` derives a vehicle file."""

    name: str
    mass: Annotated[float, Amount("kg"), Field(gt=0, description="mass, including all water inside")]
    size: Size
    geometry: GeometrySettings


class VehicleSettings(_WithGeometry):
    """A vehicle file."""

    name: Annotated[str, Field(description="name of the vehicle, in headings and exported files")]
    source: Annotated[str, Field(description="source of the numbers")] = ""
    notes: Annotated[tuple[str, ...], Field(description="remarks on the numbers, a text each")] = ()
    size: Size
    geometry: Annotated[GeometrySettings | None, Field(description="hull and fins, for prior and checks")] = None
    parameters: Annotated[
        ParameterTable, Field(description="known parameters, such as mass, inertia and added mass, by symbol")
    ]
    coefficients: Annotated[
        CoefficientTable,
        Field(description="values; needed by a simulation, and for coefficients that are not estimated"),
    ] = CoefficientTable()
    terms: Annotated[tuple[Term, ...], Field(description="own terms, in addition to the 22")] = ()
    actuators: Annotated[
        ActuatorSettings, Field(description="dynamics of fins and propeller; the recorded inputs are then commands")
    ] = ActuatorSettings()

    def shape(self) -> Geometry | None:
        """Return hull and fins in body axes, SI; None without a geometry."""
        if self.geometry is None:
            return None
        return self.geometry.shape(self.size.length, self.size.diameter, self.size.density)

    def derived_values(self) -> tuple[DerivedValue, ...]:
        """Return the values that follow from the geometry, SI; empty without one."""
        shape = self.shape()
        if shape is None or self.geometry is None:
            return ()
        return coefficients_from_geometry(shape, self.known_parameters()["m"], self.geometry.speed)

    @field_validator("terms")
    @classmethod
    def _distinct_terms(cls, terms: tuple[Term, ...]) -> tuple[Term, ...]:
        check_own_terms(terms)
        return terms

    @property
    def coefficient_set(self) -> CoefficientSet:
        """Return the 22 coefficients and those of own terms."""
        return CoefficientSet((*COEFFICIENTS, *(term.coefficient for term in self.terms)))

    def known_parameters(self) -> dict[str, float]:
        """Return the parameters by symbol, SI."""
        return self.parameters.by_symbol()

    def stated_coefficients(self) -> dict[str, float]:
        """Return the coefficients with a value, of the 22 and of own terms, by symbol, SI."""
        return self.coefficients.by_symbol() | {t.name: t.value for t in self.terms if t.value is not None}

    def stated_deviations(self) -> dict[str, float]:
        """Return the standard deviations of coefficients that have one, by symbol, SI."""
        of_terms = {t.name: t.standard_deviation for t in self.terms if t.standard_deviation is not None}
        return self.coefficients.deviations() | of_terms

    def with_coefficients(self, values: Mapping[str, float]) -> "VehicleSettings":
        """Return the vehicle with these values of all its coefficients, SI."""
        terms = tuple(term.model_copy(update={"value": values[term.name]}) for term in self.terms)
        table = self.coefficients.model_validate({c.symbol: values[c.symbol] for c in COEFFICIENTS})
        return self.model_copy(update={"coefficients": table, "terms": terms})

    def term_prior(self, symbol: str) -> TermPrior:
        """Return the prior in a term's own settings; empty for one of the 22."""
        return next((term.prior for term in self.terms if term.name == symbol), TermPrior())

    def not_estimated(self) -> tuple[str, ...]:
        """Return the symbols of all coefficients with `estimate: false`."""
        return (*self.coefficients.not_estimated(), *(term.name for term in self.terms if not term.estimate))

    def all_coefficients(self) -> dict[str, float]:
        """Return the 22 coefficients and those of own terms by symbol, SI; ConfigError if one has no value."""
        given = self.stated_coefficients()
        if missing := [symbol for symbol in self.coefficient_set.symbols if symbol not in given]:
            raise ConfigError(
                f"vehicle {self.name!r}: no value for {', '.join(missing)}; a simulation needs all "
                f"{len(COEFFICIENTS)} coefficients and those of own terms"
            )
        return {symbol: given[symbol] for symbol in self.coefficient_set.symbols}
