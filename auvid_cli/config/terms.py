"""Settings of the terms that a vehicle's equations of motion have beyond the 22."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, ValidationInfo, field_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import check_amount, check_size, parse_quantity
from auvid_cli.vehicle.coefficients import (
    COEFFICIENTS,
    EQUATION_ROWS,
    MAX_FACTORS,
    RESERVED_NAMES,
    SIGNALS,
    TERM_NAME,
    Coefficient,
    unit_of,
)

_MOTIONS = "surge force", "sway force", "heave force", "roll moment", "pitch moment", "yaw moment"


class Guess(Settings):
    """Prior of the coefficient of a term, independent of its value."""

    mean: float | None = None
    standard_deviation: float | None = None


class Term(Settings):
    """A term of the equations of motion: a coefficient times a product of factors."""

    name: Annotated[
        str,
        Field(pattern=TERM_NAME, description="its row, an underscore, and a word, such as N_|v|r"),
    ]
    row: Literal["X", "Y", "Z", "K", "M", "N"]
    factors: Annotated[
        tuple[str, ...],
        Field(
            min_length=1, max_length=MAX_FACTORS, description=f"out of {', '.join(SIGNALS)}, bare or as a modulus |v|"
        ),
    ]
    value: Annotated[float | None, Field(description="needed by a simulation, and where it is not estimated")] = None
    estimate: Annotated[
        bool, Field(strict=True, description="whether `identification.coefficients: all` means it too")
    ] = True
    prior: Annotated[
        Guess, Field(description="mean and standard_deviation, instead of what `identification.prior` says")
    ] = Guess()
    meaning: Annotated[str, Field(max_length=200, description="a phrase for tables and files")] = ""
    status: Annotated[str, Field(description="read, derived or assumed, and how")] = "stated"
    source: Annotated[str | None, Field(description="where from, if not the vehicle file's own source")] = None
    standard_deviation: Annotated[float | None, Field(description="how sure it is, in the unit of the value")] = None

    @field_validator("row")
    @classmethod
    def _row_of_the_name(cls, row: str, info: ValidationInfo) -> str:
        name = info.data.get("name", row)
        if not name.startswith(row):
            raise ValueError(f"{name} is named for row {name[0]}, and stands in row {row}")
        return row

    @field_validator("factors")
    @classmethod
    def _known_signals(cls, factors: tuple[str, ...]) -> tuple[str, ...]:
        for factor in factors:
            if factor not in SIGNALS and factor.removeprefix("|").removesuffix("|") not in SIGNALS:
                raise ValueError(f"{factor!r} is no factor; expected one of {', '.join(SIGNALS)}, bare or as |v|")
            if factor.count("|") not in (0, 2):
                raise ValueError(f"{factor!r} is half a modulus; expected |{factor.strip('|')}|")
        return factors

    @field_validator("value", "standard_deviation", mode="before")
    @classmethod
    def _of_its_dimension(cls, value: Any, info: ValidationInfo) -> Any:
        # A wrong row or factor is reported once, at its own place.
        unit = _unit(info)
        return None if value is None or unit is None else _parsed(value, unit, str(info.field_name))

    @field_validator("prior", mode="before")
    @classmethod
    def _guessed_in_its_dimension(cls, value: Any, info: ValidationInfo) -> Any:
        unit = _unit(info)
        if not isinstance(value, dict) or unit is None:
            return value if unit is not None else {}
        return {
            key: amount if amount is None or key not in Guess.model_fields else _parsed(amount, unit, key)
            for key, amount in value.items()
        }

    @classmethod
    def of(cls, coefficient: Coefficient) -> "Term":
        """Return the settings of a coefficient that is to be estimated."""
        return cls.model_validate(
            {"name": coefficient.symbol, "row": EQUATION_ROWS[coefficient.row], "factors": coefficient.factors}
        )

    @property
    def coefficient(self) -> Coefficient:
        """Return its row of the table of coefficients."""
        row = EQUATION_ROWS.index(self.row)
        meaning = self.meaning or f"{_MOTIONS[row]} of {' '.join(self.factors)}"
        return Coefficient(self.name, unit_of(row, self.factors), meaning, row, self.factors, "term")


def _unit(info: ValidationInfo) -> str | None:
    """Return the unit that row and factors ask for; None where these are wrong themselves."""
    if "row" not in info.data or "factors" not in info.data:
        return None
    return unit_of(EQUATION_ROWS.index(info.data["row"]), info.data["factors"])


def _parsed(value: Any, unit: str, key: str) -> float:
    number = parse_quantity(value, unit)
    if key != "standard_deviation":
        return check_size(number, unit)
    if not number > 0.0:
        raise ValueError("the standard deviation must be greater than 0")
    return check_amount(number, unit)


def check_own_terms(terms: Sequence[Term]) -> None:
    """Refuse terms that are there already, by name or but for a constant factor.

    Raises
    ------
    ValidationError
        With every such term, at its name.
    """
    names, products = dict(RESERVED_NAMES), {c.regressor: c for c in COEFFICIENTS}
    wrong: list[InitErrorDetails] = []
    for place, term in enumerate(terms):
        coefficient, why = term.coefficient, ""
        if (taken := names.get(coefficient.identifier)) is not None:
            other = f"called like {taken}, which" if taken != term.name else "a name that"
            why = f"{term.name} is {other} is there already"
        elif (there := products.get(coefficient.regressor)) is not None:
            why = f"{term.name} is {there.symbol} again, but for a constant: {there.equation} is there already"
        if why:
            error = PydanticCustomError("value_error", "{error}", {"error": why})
            wrong.append(InitErrorDetails(type=error, loc=(place, "name"), input=term.name))
        names.setdefault(coefficient.identifier, term.name)
        products.setdefault(coefficient.regressor, coefficient)
    if wrong:
        raise ValidationError.from_exception_data("terms", wrong)
