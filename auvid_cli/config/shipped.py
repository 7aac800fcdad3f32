"""Settings files that ship with auvid, found from any working directory."""

from pathlib import Path, PurePath
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parents[1]

# Folder of each kind, within the folder of all settings.
KINDS = {
    "experiments": "",
    "vehicles": "vehicles",
    "sensors": "sensors",
    "manoeuvres": "manoeuvres",
    "campaigns": "campaigns",
}
# Kinds whose names in commands have no folder and no suffix.
_BY_STEM = ("experiments", "campaigns")


class ShippedFile(NamedTuple):
    """A settings file that ships with auvid: its name in commands and experiments, and a description of one line."""

    name: str
    description: str


def shipped_configs() -> Path:
    """Return the folder of the shipped settings: inside the package, or next to it in a checkout."""
    inside = PACKAGE / "configs"
    return inside if inside.is_dir() else PACKAGE.parent / "configs"


def shipped_files(kind: str) -> list[ShippedFile]:
    """Return the files of a kind, each with the comment in its first line as description."""
    files = []
    for path in sorted((shipped_configs() / KINDS[kind]).glob("*.yaml")):
        first, *_ = path.read_text(encoding="utf-8").splitlines()
        name = path.stem if kind in _BY_STEM else f"{KINDS[kind]}/{path.name}"
        files.append(ShippedFile(name, first.removeprefix("#").strip()))
    return files


def shipped_part(name: str) -> Path | None:
    """Return the path of a part such as ``sensors/table_iii.yaml``; None if no such file ships."""
    path = shipped_configs() / name
    is_within = not PurePath(name).is_absolute() and ".." not in PurePath(name).parts
    return path if is_within and path.is_file() else None
