"""The sound files that are damaged: settings, a short run, logs of every kind."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from benchmarks.attack.log_files import write_logs
from benchmarks.attack.running import perform

_CONFIGS = Path(__file__).parents[2] / "configs"
EXPERIMENTS = "spiral", "remus100", "lauv", "lrauv", "dive"
_LONGEST = 120.0
# All keys of the settings appear in the resolved ones only if they are said.
_RICH = (
    "manoeuvre.duration=2 s",
    "identification.estimate.biases=[gyro, attitude, dvl]",
    "identification.gate=0.999",
    "identification.output_error.bounds={X_u|u|: [-10 kg/m, 0 kg/m]}",
    "identification.use.spans=[[0 s, 1.5 s]]",
)


@dataclass(frozen=True)
class Material:
    """Where the sound files are."""

    folder: Path

    @property
    def configs(self) -> Path:
        """Return the folder of the settings as they ship."""
        return self.folder / "configs"

    @property
    def results(self) -> Path:
        """Return the results folder of a short run: dataset.h5 and an estimate."""
        return self.folder / "run"

    @property
    def other(self) -> Path:
        """Return the dataset file of another run."""
        return self.folder / "other.h5"

    @property
    def logs(self) -> Path:
        """Return the folder of the logs of one dive, each with its map."""
        return self.folder / "logs"

    def resolved(self, experiment: str) -> str:
        """Return all settings of an experiment, as `--dry-run` prints them."""
        return (self.folder / "resolved" / f"{experiment}.yaml").read_text(encoding="utf-8")


def make(folder: Path) -> Material:
    """Write everything; takes some seconds."""

    def done(*arguments: str) -> str:
        ended = perform(arguments, folder, _LONGEST)
        if ended.code not in (0, 1):
            raise SystemExit(f"auvid {' '.join(arguments)}: {ended.err}")
        return ended.out

    folder.mkdir(parents=True)
    shutil.copytree(_CONFIGS, folder / "configs")
    done("simulate", "--quiet", "--set", "manoeuvre.duration=6 s", "--output", "run")
    done("identify", "--quiet", "run/dataset.h5", "-f", "tukf", "--output", "run")
    done("simulate", "--quiet", "--set", "manoeuvre.duration=5 s", "--seed", "2", "--output", "other")
    (folder / "other" / "dataset.h5").rename(folder / "other.h5")
    (folder / "resolved").mkdir()
    for experiment in EXPERIMENTS:
        text = done("run", experiment, "--dry-run", *(word for each in _RICH for word in ("--set", each)))
        (folder / "resolved" / f"{experiment}.yaml").write_text(text, encoding="utf-8")
    write_logs(folder / "logs", folder / "configs" / "vehicles" / "vt690.yaml")
    return Material(folder)
