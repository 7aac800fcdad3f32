"""Settings of the prior and of each filter."""

from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.settings import Settings
from auvid_cli.config.units import check_amount, check_size, parse_quantity
from auvid_cli.vehicle.coefficients import COEFFICIENTS, CoefficientGroup, CoefficientSet


def of_vehicle(info: ValidationInfo) -> CoefficientSet:
    """Return the coefficients of the vehicle whose settings are validated, by default the 22."""
    return info.context if isinstance(info.context, CoefficientSet) else COEFFICIENTS


def check_symbol(symbol: str, coefficients: CoefficientSet, *groups: str) -> None:
    """Raise ValueError, with the nearest known symbol, if `symbol` is neither a coefficient nor a group."""
    from difflib import get_close_matches

    known = (*coefficients.symbols, *groups)
    if symbol not in known:
        near = get_close_matches(symbol, known, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else f"; one of {', '.join(known)}"
        raise ValueError(f"{symbol!r} is not a coefficient{' or a group of them' if groups else ''}{hint}")


def _shares(value: Any, info: ValidationInfo) -> Any:
    """Parse a share, or one for each coefficient or group of them."""
    if not isinstance(value, dict):
        return value if value is None else check_amount(parse_quantity(value, "1"), "1")
    groups = get_args(CoefficientGroup)
    for name in value:
        if name not in groups:
            check_symbol(name, of_vehicle(info), *groups)
    return {name: check_amount(parse_quantity(share, "1"), "1") for name, share in value.items()}


class Prior(Settings):
    """Prior of the coefficients: zero and natural magnitude from the vehicle's size times `factor`, or a vehicle's."""

    mean: Annotated[
        Literal["zero", "vehicle", "geometry"],
        Field(
            description="zero, what the vehicle file states of a coefficient, or what follows from its `geometry`; "
            "`prior: geometry` is short for `prior: {mean: geometry}`"
        ),
    ] = "zero"
    relative: Annotated[
        float | dict[str, float] | None,
        BeforeValidator(_shares),
        Field(
            description="standard deviation as a share of that mean, or by coefficient and group (damping, lift, "
            "control, term); else that of the geometry, or of the vehicle file's entry, else 50 %"
        ),
    ] = None
    factor: Annotated[float, Field(ge=1e-6, le=1e6, description="times the natural magnitude")] = 3.0
    standard_deviation: dict[str, float] = Field(
        default_factory=dict, description="by coefficient, instead of all else"
    )
    from_estimate: Annotated[
        str | None,
        Field(description="estimate file of other data: its coefficients and their covariance, where it has them"),
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _accept_a_bare_mean(cls, data: Any) -> Any:
        return {"mean": data} if isinstance(data, str) else data

    @field_validator("standard_deviation", mode="before")
    @classmethod
    def _known_coefficients_with_units(cls, value: Any, info: ValidationInfo) -> Any:
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
    def _shares_of_something(self) -> "Prior":
        if self.relative is not None and self.mean == "zero":
            raise ValueError("relative is a share of a mean other than zero: it needs mean: vehicle or geometry")
        shares = self.relative.values() if isinstance(self.relative, dict) else (self.relative,)
        if any(share is not None and not share > 0.0 for share in shares):
            raise ValueError("a share must be greater than 0")
        return self


class EkfSettings(Settings):
    """Extended Kalman filter."""

    transition: Annotated[
        Literal["exact", "first_order"],
        Field(description="variational equation along the integration, or the paper's I + A dt"),
    ] = "exact"


class UkfSettings(Settings):
    """Scaled unscented transformation."""

    alpha: Annotated[float, Field(ge=1e-4, le=10, description="scaling of the points")] = 0.1
    beta: Annotated[float, Field(ge=0, le=100, description="2 is best for a Gaussian")] = 2.0
    kappa: Annotated[float, Field(ge=0, le=1000, description="secondary scaling")] = 0.0

    @model_validator(mode="after")
    def _no_negative_covariance_term(self) -> "UkfSettings":
        if self.beta < self.alpha**2:
            raise ValueError("beta must be at least alpha^2, else the covariance can lose definiteness")
        return self


class OutputErrorSettings(Settings):
    """Output-error method: fit of coefficients and initial motion, without process noise."""

    max_evaluations: Annotated[
        int, Field(ge=1, strict=True, description="how often the motion may be computed along the data or a part of it")
    ] = 100
    use_prior: Annotated[
        bool, Field(strict=True, description="whether the prior and the spread of the initial motion count")
    ] = False
    bounds: dict[str, tuple[float, float]] = Field(
        default_factory=dict, description="by coefficient, [lowest, highest] value that the fit may take"
    )

    @field_validator("bounds", mode="before")
    @classmethod
    def _known_coefficients_with_units(cls, value: Any, info: ValidationInfo) -> Any:
        if not isinstance(value, dict):
            return value
        units = of_vehicle(info).units
        parsed = {}
        for symbol, interval in value.items():
            check_symbol(symbol, of_vehicle(info))
            if not isinstance(interval, list | tuple) or len(interval) != 2:
                raise ValueError(f"the bounds of {symbol}: expected [lowest, highest]")
            low, high = (check_size(parse_quantity(bound, units[symbol]), units[symbol]) for bound in interval)
            if not low < high:
                raise ValueError(f"the bounds of {symbol}: the lowest must be less than the highest")
            parsed[symbol] = low, high
        return parsed


class SmootherSettings(Settings):
    """Smoother: the most probable trajectory and coefficients, with process noise."""

    max_passes: Annotated[
        int, Field(ge=1, strict=True, description="how often the data may be filtered, from each start")
    ] = 50
    answer: Annotated[
        Literal["automatic", "joint", "marginal"],
        Field(
            description="joint: the most probable coefficients and trajectory together; marginal: the most probable "
            "coefficients whatever the trajectory; automatic: marginal where a disturbance or the noise is estimated"
        ),
    ] = "automatic"
