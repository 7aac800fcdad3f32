"""Names of filters, formats and shipped files, without the code behind them, so that `--help` is fast."""

from enum import StrEnum
from pathlib import Path, PurePath
from typing import NamedTuple, TypeVar

from auvid_cli.errors import ConfigError

Member = TypeVar("Member", bound=StrEnum)

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


class FilterName(StrEnum):
    """A filter, the smoother or the output-error method; the value is its name in commands, settings and files."""

    EKF = "ekf"
    CKF = "ckf"
    TUKF = "tukf"
    UKF = "ukf"
    SMOOTHER = "smoother"
    OUTPUT_ERROR = "output_error"

    @property
    def in_one_batch(self) -> bool:
        """Whether it fits all data at once, instead of one measurement after another."""
        return self in (FilterName.SMOOTHER, FilterName.OUTPUT_ERROR)

    @property
    def description(self) -> str:
        """Return a description of one line."""
        return _DESCRIPTIONS[self]

    @property
    def is_free_run_fit(self) -> bool:
        """Whether it fits simulated motion: without process noise and, by default, without the prior."""
        return self is FilterName.OUTPUT_ERROR


_DESCRIPTIONS = {
    FilterName.EKF: "Extended Kalman filter: linearised along the motion; exact or first-order transition.",
    FilterName.CKF: "Cubature Kalman filter: third-degree spherical rule, in square-root form.",
    FilterName.TUKF: "Transformed unscented Kalman filter: cubature points, rotated to stay close in each state.",
    FilterName.UKF: "Unscented Kalman filter with the scaled transformation.",
    FilterName.SMOOTHER: "Smoother: the most probable coefficients and motion of all data; judges the others.",
    FilterName.OUTPUT_ERROR: "Output-error method (OE in tables): fit of coefficients and initial motion, without "
    "process noise.",
}
# Reference for the other filters: it estimates each state from all data, earlier and later.
JUDGE = FilterName.SMOOTHER


class FormatName(StrEnum):
    """Export format of an identified model, or of a whole run; the value is its name in commands."""

    YAML = "yaml"
    JSON = "json"
    PYTHON = "python"
    MATLAB = "matlab"
    SDF = "sdf"
    HOLOOCEAN = "holoocean"
    SIMULATOR = "simulator"
    MSS = "mss"
    MCAP = "mcap"

    @property
    def is_of_a_run(self) -> bool:
        """Whether it exports the estimates over time, instead of the model."""
        return self is FormatName.MCAP


class FigureFormat(StrEnum):
    """File format of a figure; the value is its name in commands and the suffix of the file."""

    PNG = "png"
    SVG = "svg"
    PDF = "pdf"


def named(kind: type[Member], name: str, noun: str) -> Member:
    """Return the member of a name, such as ``"tukf"``; ConfigError, which calls it a `noun`, if it is unknown."""
    try:
        return kind(name)
    except ValueError:
        raise ConfigError(f"unknown {noun} {name!r}; auvid knows {', '.join(kind)}") from None


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
