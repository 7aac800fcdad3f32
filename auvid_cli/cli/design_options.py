"""What `auvid design` is told, read from text: each mistake one line that names the option."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from auvid_cli.errors import ConfigError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

    from auvid_cli.config.envelope import Envelope


def quantity_of(option: str, text: str, unit: str, below: float = float("inf")) -> float:
    """Read a quantity above 0 and below a limit.

    Raises
    ------
    ConfigError
        If it is none.
    """
    from auvid_cli.config.quantity import parse_quantity

    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        raise ConfigError(f"--{option}: {error}") from None
    if not 0.0 < value < below:
        upper = f" and below {below:g} {unit}" if below < float("inf") else ""
        raise ConfigError(f"--{option} {text}: expected more than 0{upper}")
    return value


def envelope_of(**limits: str | None) -> "Envelope":
    """Read the limits that are given, each by the name of its option.

    Raises
    ------
    ConfigError
        With a line for each that is none.
    """
    from pydantic import ValidationError

    from auvid_cli.config.envelope import Envelope

    try:
        return Envelope.model_validate({name: text for name, text in limits.items() if text is not None})
    except ValidationError as error:
        raise ConfigError("\n".join(_complaint(Envelope, each) for each in error.errors())) from None


def _complaint(model: "type[Envelope]", error: "ErrorDetails") -> str:
    from auvid_cli.config.locate import LIMITS
    from auvid_cli.config.quantity import Unit

    name, limit = str(error["loc"][0]), LIMITS.get(error["type"])
    if limit is None:
        return f"--{name}: {error['msg'].removeprefix('Value error, ')}"
    unit = next(each.unit for each in model.model_fields[name].metadata if isinstance(each, Unit))
    return f"--{name} {error['input']}: {limit.format(**error.get('ctx', {}))} {unit}"


def place_of(text: str) -> tuple[float, float]:
    """Read latitude and longitude, degrees.

    Raises
    ------
    ConfigError
        If these are none.
    """
    from auvid_cli.config.quantity import parse_number

    try:
        latitude, longitude = (parse_number(part) for part in text.split(","))
    except ValueError:
        latitude, longitude = float("nan"), float("nan")
    if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
        raise ConfigError(f"--origin {text}: expected latitude and longitude in degrees, such as 41.18,-8.70")
    return latitude, longitude


def refuse_what_stands(paths: Iterable[Path], overwrite: bool) -> None:
    """Refuse to write over an earlier design.

    Raises
    ------
    FileError
        If there is one, and nobody said `--overwrite`.
    """
    from auvid_cli.data.replacement import refuse_unless

    standing = next((path for path in paths if path.exists()), None)
    refuse_unless(overwrite, "" if standing is None else f"{standing} is there already")
