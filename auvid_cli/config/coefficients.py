"""Settings of coefficients: a vehicle's own terms of the equations of motion, and priors."""

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator
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
    CoefficientGroup,
    CoefficientSet,
    unit_of,
)

_FORCES = ("surge force", "sway force", "heave force", "roll moment", "pitch moment", "yaw moment")


class TermPrior(Settings):
    """Prior of the coefficient of a term, in the unit of its value."""

    mean: Annotated[float | None, Field(description="mean; default: that of `identification.prior`")] = None
    standard_deviation: Annotated[
        float | None, Field(description="standard deviation; default: that of `identification.prior`")
    ] = None


class Term(Settings):
    """A term of the equations of motion: a coefficient times a product of factors."""

    name: Annotated[str, Field(pattern=TERM_NAME, description="row, underscore and word, such as N_|v|r")]
    row: Annotated[Literal["X", "Y", "Z", "K", "M", "N"], Field(description="force or moment to which it belongs")]
    factors: Annotated[
        tuple[str, ...],
        Field(
            min_length=1,
            max_length=MAX_FACTORS,
            description=f"factors, each one of {', '.join(SIGNALS)}, or a modulus such as |v|",
        ),
    ]
    value: Annotated[float | None, Field(description="value; needed by simulations, and if not estimated")] = None
    estimate: Annotated[bool, Field(strict=True, description="whether `coefficients: all` includes this term")] = True
    prior: Annotated[
        TermPrior, Field(description="mean and standard_deviation, which replace those of `identification.prior`")
    ] = TermPrior()
    meaning: Annotated[str, Field(max_length=200, description="phrase for tables and files")] = ""
    status: Annotated[str, Field(description="read, derived or assumed, and how")] = "stated"
    source: Annotated[str | None, Field(description="source, if not that of the vehicle file")] = None
    standard_deviation: Annotated[float | None, Field(description="standard deviation of the value")] = None

    @field_validator("row")
    @classmethod
    def _row_matches_name(cls, row: str, info: ValidationInfo) -> str:
        name = info.data.get("name", row)
        if not name.startswith(row):
            raise ValueError(f"{name}: the name begins with {name[0]}; expected the row {row}")
        return row

    @field_validator("factors")
    @classmethod
    def _known_signals(cls, factors: tuple[str, ...]) -> tuple[str, ...]:
        for factor in factors:
            if factor not in SIGNALS and factor.removeprefix("|").removesuffix("|") not in SIGNALS:
                raise ValueError(f"unknown factor {factor!r}; expected one of {', '.join(SIGNALS)}, or |v|")
            if factor.count("|") not in (0, 2):
                raise ValueError(f"{factor!r}: incomplete modulus; expected |{factor.strip('|')}|")
        return factors

    @field_validator("value", "standard_deviation", mode="before")
    @classmethod
    def _parse_value(cls, value: Any, info: ValidationInfo) -> Any:
        unit = _unit(info)
        return None if value is None or unit is None else _parse_coefficient(value, unit, str(info.field_name))

    @field_validator("prior", mode="before")
    @classmethod
    def _parse_prior(cls, value: Any, info: ValidationInfo) -> Any:
        unit = _unit(info)
        if not isinstance(value, dict) or unit is None:
            return value if unit is not None else {}
        return {
            key: amount
            if amount is None or key not in TermPrior.model_fields
            else _parse_coefficient(amount, unit, key)
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
        """Return the coefficient as the table of coefficients has it."""
        row = EQUATION_ROWS.index(self.row)
        meaning = self.meaning or f"{_FORCES[row]} of {' '.join(self.factors)}"
        return Coefficient(self.name, unit_of(row, self.factors), meaning, row, self.factors, "term")


def _unit(info: ValidationInfo) -> str | None:
    """Return the unit that follows from row and factors; None if these are invalid, which is reported at them."""
    if "row" not in info.data or "factors" not in info.data:
        return None
    return unit_of(EQUATION_ROWS.index(info.data["row"]), info.data["factors"])


def _parse_coefficient(value: Any, unit: str, key: str) -> float:
    number = parse_quantity(value, unit)
    if key != "standard_deviation":
        return check_size(number, unit)
    if not number > 0.0:
        raise ValueError("the standard deviation must be greater than 0")
    return check_amount(number, unit)


def check_own_terms(terms: Sequence[Term]) -> None:
    """Raise ValidationError, at its name, for each term with the name or the factors of another coefficient."""
    names, products = dict(RESERVED_NAMES), {c.regressor: c for c in COEFFICIENTS}
    errors: list[InitErrorDetails] = []
    for index, term in enumerate(terms):
        coefficient, message = term.coefficient, ""
        if (taken := names.get(coefficient.identifier)) is not None:
            message = f"{term.name}: this name is already taken" + (f" by {taken}" if taken != term.name else "")
        elif (same := products.get(coefficient.regressor)) is not None:
            message = f"{term.name}: same factors as {same.symbol}, whose term is {same.equation}"
        if message:
            error = PydanticCustomError("value_error", "{error}", {"error": message})
            errors.append(InitErrorDetails(type=error, loc=(index, "name"), input=term.name))
        names.setdefault(coefficient.identifier, term.name)
        products.setdefault(coefficient.regressor, coefficient)
    if errors:
        raise ValidationError.from_exception_data("terms", errors)


def of_vehicle(info: ValidationInfo) -> CoefficientSet:
    """Return the coefficients of the vehicle whose settings are validated, by default the 22."""
    return info.context if isinstance(info.context, CoefficientSet) else COEFFICIENTS


def check_symbol(symbol: str, coefficients: CoefficientSet, *groups: str) -> None:
    """Raise ValueError, with the nearest known symbol, if `symbol` is neither a coefficient nor a group."""
    known = (*coefficients.symbols, *groups)
    if symbol not in known:
        near = get_close_matches(symbol, known, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"expected one of {', '.join(known)}"
        raise ValueError(f"{symbol!r} is not a coefficient{' or a group of them' if groups else ''}; {hint}")


def _parse_shares(value: Any, info: ValidationInfo) -> Any:
    """Parse a share, or one for each coefficient or group of them."""
    if not isinstance(value, dict):
        return value if value is None else check_amount(parse_quantity(value, "1"), "1")
    groups = get_args(CoefficientGroup)
    for name in value:
        if name not in groups:
            check_symbol(name, of_vehicle(info), *groups)
    return {name: check_amount(parse_quantity(share, "1"), "1") for name, share in value.items()}


class Prior(Settings):
    """Prior of the coefficients: by default zero, and `factor` times the natural magnitude for the vehicle's size."""

    mean: Annotated[
        Literal["zero", "vehicle", "geometry"],
        Field(
            description="mean: zero, the value in the vehicle file, or the value derived from its `geometry`; "
            "`prior: geometry` is short for `prior: {mean: geometry}`"
        ),
    ] = "zero"
    relative: Annotated[
        float | dict[str, float] | None,
        BeforeValidator(_parse_shares),
        Field(
            description="standard deviation as a share of the mean, one for all or by coefficient and group (damping, "
            "lift, control, term); default: that of the geometry or of the vehicle file's entry, else 50 %"
        ),
    ] = None
    factor: Annotated[
        float, Field(ge=1e-6, le=1e6, description="standard deviation in natural magnitudes, if the mean is zero")
    ] = 3.0
    standard_deviation: dict[str, float] = Field(
        default_factory=dict, description="by coefficient; replaces all others"
    )
    from_estimate: Annotated[
        str | None,
        Field(description="estimate file of other data: mean and covariance of the coefficients that it has"),
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_mean(cls, data: Any) -> Any:
        return {"mean": data} if isinstance(data, str) else data

    @field_validator("standard_deviation", mode="before")
    @classmethod
    def _parse_deviations(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        units = of_vehicle(info).units
        for symbol in value:
            check_symbol(symbol, of_vehicle(info))
        parsed = {
            symbol: check_amount(parse_quantity(amount, units[symbol]), units[symbol])
            for symbol, amount in value.items()
        }
        for symbol, deviation in parsed.items():
            if not deviation > 0.0:
                raise ValueError(f"the standard deviation of {symbol} must be greater than 0")
        return parsed

    @model_validator(mode="after")
    def _valid_shares(self) -> "Prior":
        if self.relative is not None and self.mean == "zero":
            raise ValueError("relative: a share of a zero mean; it needs mean: vehicle or geometry")
        shares = self.relative.values() if isinstance(self.relative, dict) else (self.relative,)
        if any(share is not None and not share > 0.0 for share in shares):
            raise ValueError("a share must be greater than 0")
        return self
