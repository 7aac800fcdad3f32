"""Where a sensor sits in the vehicle."""

from typing import Annotated, Any

from pydantic import BeforeValidator

from auvid_cli.config.quantity import parse_components


def _three_lengths(value: Any) -> Any:
    if isinstance(value, list | tuple) and len(value) == 3:
        return parse_components(value, "m", 3)
    raise ValueError("expected [forward, starboard, down], such as [0.4 m, 0 m, 0.1 m]")


Lever = Annotated[tuple[float, float, float], BeforeValidator(_three_lengths)]
