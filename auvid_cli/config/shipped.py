"""Settings files that ship with auvid, found from any working directory."""

from pathlib import Path, PurePath
from typing import NamedTuple

PACKAGE = Path(__file__).resolve().parents[1]

# Folder of each kind, within that of all settings.
KINDS = {
    "experiments": "",
    "vehicles": "vehicles",
    "sensors": "sensors",
    "manoeuvres": "manoeuvres",
    "campaigns": "campaigns",
}
# Kinds that commands name as they are, without folder and ending.
_BY_STEM = "experiments", "campaigns"


class ShippedFile(NamedTuple):
    """A settings file that ships with auvid.

    Attributes
    ----------
    name : str
        As commands and experiments name it: ``spiral``, ``vehicles/vt690.yaml``.
    description : str
        Description of one line.
    """

    name: str
    description: str


def shipped_configs() -> Path:
    """Find the folder of the settings that ship with auvid: inside the package, or next to it in a checkout."""
    inside = PACKAGE / "configs"
    return inside if inside.is_dir() else PACKAGE.parent / "configs"


def shipped_files(kind: str) -> list[ShippedFile]:
    """List the files of a kind, each described by the comment in its first line."""
    files = []
    for path in sorted((shipped_configs() / KINDS[kind]).glob("*.yaml")):
        first, *_ = path.read_text(encoding="utf-8").splitlines()
        name = path.stem if kind in _BY_STEM else f"{KINDS[kind]}/{path.name}"
        files.append(ShippedFile(name, first.removeprefix("#").strip()))
    return files


def shipped_part(name: str) -> Path | None:
    """Find a part, such as ``sensors/table_iii.yaml``; None if no such file ships."""
    path = shipped_configs() / name
    is_within = not PurePath(name).is_absolute() and ".." not in PurePath(name).parts
    return path if is_within and path.is_file() else None
