"""A folder to begin with."""

from collections.abc import Mapping
from pathlib import Path

from auvid_cli.config.outline import outline_of_options
from auvid_cli.config.quantity import parse_quantity
from auvid_cli.errors import ConfigError
from auvid_cli.start.first_folder import FirstFolder, folder_like, folder_of_outline
from auvid_cli.start.sanity import SanityRow, sanity_notes, sanity_rows


def first_folder(folder: Path, options: Mapping[str, str | int], like: str | None) -> FirstFolder:
    """Make the files of a folder to begin with; nothing is written.

    Parameters
    ----------
    folder : pathlib.Path
        Where they will be.
    options : mapping
        Keys of an outline; with `like` none but ``speed``.
    like : str or None
        Name of the shipped vehicle to start at.

    Raises
    ------
    ConfigError
        If the options are wrong, no such vehicle ships, or it survives no spiral.
    """
    if like is None:
        return folder_of_outline(folder, outline_of_options(options))
    try:
        speed = parse_quantity(options["speed"], "m/s") if "speed" in options else None
    except ValueError as error:
        raise ConfigError(f"--speed: {error}") from None
    if speed is not None and not 0.05 <= speed <= 50.0:
        raise ConfigError(f"--speed: must be from 0.05 to 50 m/s, got {options['speed']!r}")
    return folder_like(folder, like, speed)


def sanity(first: FirstFolder) -> tuple[list[SanityRow], list[str]]:
    """Return what the vehicle comes to beside what is usual, and what of it is doubtful."""
    return [*sanity_rows(first.vehicle, first.spiral)], [*sanity_notes(first.vehicle, first.spiral)]
