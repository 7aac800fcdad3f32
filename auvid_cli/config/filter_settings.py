"""Settings of each filter."""

from typing import Annotated, Any, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from auvid_cli.config.magnitudes import check_size
from auvid_cli.config.prior import check_symbol, of_vehicle
from auvid_cli.config.quantity import parse_quantity
from auvid_cli.config.settings import Settings


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
