"""What ships with auvid: experiments and the parts that they name, found in any working directory."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]


def shipped_configs() -> Path:
    """Find the folder of the settings that ship with auvid: inside the package, or beside it in a checkout."""
    inside = PACKAGE / "configs"
    return inside if inside.is_dir() else PACKAGE.parent / "configs"
