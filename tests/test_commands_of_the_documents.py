"""Every command and every block of Python in the README and the guide, in order, in one empty folder."""

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app
from auvid_cli.config import load
from auvid_cli.data.dataset import SENSORS, Dataset
from auvid_cli.data.dataset_file import read_dataset
from auvid_cli.data.files import write_text
from auvid_cli.report.figures import draw
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS

ROOT = Path(__file__).parents[1]
# They begin what is no matter of auvid's commands.
OTHERS = ("python3 -m venv", ". .venv/bin/activate", "pip install", "pytest")
FENCE = re.compile(r"```yaml\n(name: (\w+).*?)```\n", re.DOTALL)


def indented(text: str) -> list[str]:
    """Blocks of indented lines, outside of fences."""
    lines = FENCE.sub("\n", text).splitlines()
    marked = "".join(f"{line[4:]}\n" if line.startswith("    ") else "\0" for line in lines)
    return [block for block in marked.split("\0") if block]


def commands(block: str) -> Iterator[list[str]]:
    for line in block.splitlines():
        for command in line.split(" && "):
            if not command.startswith(OTHERS):
                yield shlex.split(command, comments=True)


@pytest.fixture
def quick(tmp_path, monkeypatch):
    """The shipped settings without the slowest filter and the last third of the run; figures are drawn by other tests."""
    configs = shutil.copytree(load.shipped_configs(), tmp_path / "shipped")
    for path in (*configs.glob("*.yaml"), *configs.glob("manoeuvres/*.yaml")):
        text = path.read_text(encoding="utf-8").replace("filters: [ekf, ckf, tukf]", "filters: [ckf, tukf]")
        path.write_text(text.replace("duration: 300 s", "duration: 200 s"), encoding="utf-8")
    monkeypatch.setattr(load, "shipped_configs", lambda: configs)
    monkeypatch.setattr(draw, "draw_and_save", save_nothing)


def save_nothing(kind, arguments, folder, name):
    write_text(folder / f"{name}.svg", kind)
    return [folder / f"{name}.svg"]


def write_log(path: Path, dataset: Dataset) -> None:
    """A dataset as one CSV file, as a vehicle might log it."""
    time = dataset.sensors["attitude"].time
    columns = {"time": time}
    for name in ("gyroscope", "dvl", "attitude"):
        record = dataset.sensors[name]
        # Between two readings of a slower sensor there is nothing.
        rows = np.full((time.size, len(SENSORS[name])), np.nan)
        rows[np.minimum(np.searchsorted(time, record.time), time.size - 1)] = record.values
        columns |= {q.symbol: rows[:, k] for k, q in enumerate(SENSORS[name])}
    held = np.searchsorted(dataset.inputs.time, time, side="right") - 1
    columns |= dict(zip(INPUT_SYMBOLS, dataset.inputs.values[held].T, strict=True))
    np.savetxt(path, np.column_stack([*columns.values()]), "%.9g", ",", header=",".join(columns), comments="")


def fill_in(path: Path) -> None:
    """What only the user knows of a suggested map."""
    text = path.read_text(encoding="utf-8")
    vehicle = f"vehicle: {load.shipped_configs()}/vehicles/vt690.yaml\nlogs:"
    text = re.sub(r"(?s)vehicle: #.*?logs:", vehicle, text)
    path.write_text(text.replace("standard_deviation: null", "standard_deviation: estimate"), encoding="utf-8")


def test_commands_of_the_readme_and_the_guide_run_in_order_in_one_empty_folder(quick, tmp_path, monkeypatch):
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    text = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "docs/guide.md"))
    for written, name in FENCE.findall(text):
        Path(f"{name}.yaml").write_text(written, encoding="utf-8")
    seen = set()
    for block in indented(text):
        if block.startswith("import "):
            exec(block, {})
            continue
        for program, *arguments in commands(block):
            assert program == "auvid", f"{program} {arguments}: neither auvid nor named in this test"
            if arguments[:2] == ["import", "--suggest"]:
                write_log(Path(arguments[2]), read_dataset(Path("results/spiral/dataset.h5")))
            import time; start=time.process_time(), time.perf_counter()
            result = CliRunner().invoke(app, arguments)
            print(f"{time.process_time()-start[0]:.2f} {time.perf_counter()-start[1]:.2f}", *arguments)
            assert result.exit_code == 0, f"auvid {shlex.join(arguments)}:\n{result.output}"
            if arguments[:2] == ["import", "--suggest"]:
                fill_in(Path(arguments[-1]))
            seen.add(arguments[0])
    assert seen >= {"run", "simulate", "identify", "validate", "export", "import", "inspect", "campaign"}
