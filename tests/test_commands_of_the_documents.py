"""Every command and every block of settings in the README and the pages of tasks, in order, in one empty folder."""

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from auvid_cli.api import campaign
from auvid_cli.cli.app import app
from auvid_cli.cli.options import Group
from auvid_cli.config import enums, loading
from auvid_cli.simulation import first_folder
from auvid_cli.simulation.simulate import simulate
from auvid_cli.vehicle.parameters import INPUT_SYMBOLS, SENSORS

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FIRST = ROOT / "README.md", DOCS / "quick-start.md", DOCS / "paper.md"
PAGES = *FIRST, *sorted(DOCS.glob("how-to/*.md")), *sorted(DOCS.glob("explanation/*.md")), DOCS / "formats.md"
# They begin what is no matter of auvid's commands.
OTHERS = ("python3 -m venv", ". .venv/bin/activate", "pip install", "pytest")
FENCE = re.compile(r"```yaml\n(name: (\w+).*?)```\n", re.DOTALL)
FRAGMENT = re.compile(r"```yaml\n(.*?)```\n", re.DOTALL)
SHELL = re.compile(r"^```(?:sh|text)\n(.*?)^```", re.DOTALL | re.MULTILINE)
# Fenced commands that take seconds on short data. The others search or repeat; those of the survey are the tutorial's.
RUN_HERE = re.compile(r"auvid (identify results/spiral|terms results/spiral|fit |run remus100)(?!.*survey)")


def indented(text: str) -> list[str]:
    """Blocks of indented lines, outside of fences."""
    lines = SHELL.sub("\n", FRAGMENT.sub("\n", FENCE.sub("\n", text))).splitlines()
    marked = "".join(f"{line[4:]}\n" if line.startswith("    ") else "\0" for line in lines)
    return [block for block in marked.split("\0") if block]


def commands(block: str) -> Iterator[list[str]]:
    for line in block.splitlines():
        for command in line.split(" && "):
            if not command.startswith(OTHERS):
                yield shlex.split(command, comments=True)


@pytest.fixture
def quick(tmp_path, monkeypatch, without_figures, fewer_starts, walked_here):
    """Settings for 120 s at 10 Hz without the slowest filters and the judge; a trial run of a campaign; no figures."""
    configs = shutil.copytree(enums.shipped_configs(), tmp_path / "package/configs")
    for path in (*configs.glob("*.yaml"), *configs.glob("manoeuvres/*.yaml"), *configs.glob("sensors/*.yaml")):
        text = path.read_text(encoding="utf-8").replace("[ekf, ckf, tukf", "[ckf, tukf")
        # Of so short a run the errors of an AHRS, which last, are doubted with reason.
        text = re.sub("(, smoother)?, output_error]", "]", text).replace("  filters: [", "  judge: false\n  filters: [")
        text = text.replace("rate: 100 Hz", "rate: 10 Hz").replace(
            "duration: 300 s", "duration: 120 s\ninput_rate: 10 Hz"
        )
        text = text.replace("integration_step: 0.02 s", "integration_step: 0.1 s")
        path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(enums, "PACKAGE", configs.parent)
    monkeypatch.setattr(campaign, "N_PROBES", 1)
    monkeypatch.setattr(first_folder, "MIN_DURATION", 90.0)
    lines = first_folder.spiral_lines
    monkeypatch.setattr(first_folder, "spiral_lines", lambda *settings: (*lines(*settings), "input_rate: 20 Hz"))
    monkeypatch.setattr(first_folder, "SENSORS", first_folder.SENSORS.replace("rate: 50 Hz", "rate: 20 Hz"))


def write_log(path: Path) -> None:
    """A CSV file as a vehicle might log it, with all sensors in each row."""
    run = simulate(
        loading.load_experiment(
            loading.find_experiment(None),
            ("seed=5", "sensors.dvl.rate=10 Hz", "sensors.attitude.source=direct", "manoeuvre.input_rate=10 Hz"),
        )
    )
    columns = {"time": run.inputs.time}
    for name in ("gyroscope", "dvl", "attitude"):
        columns |= {q.symbol: column for q, column in zip(SENSORS[name], run.sensors[name].values.T, strict=True)}
    columns |= dict(zip(INPUT_SYMBOLS, run.inputs.values.T, strict=True))
    np.savetxt(path, np.column_stack([*columns.values()]), "%.9g", ",", header=",".join(columns), comments="")


def fill_in(path: Path) -> None:
    """What only the user knows of a suggested map."""
    text = path.read_text(encoding="utf-8")
    vehicle = f"\nvehicle: {enums.shipped_configs()}/vehicles/vt690.yaml\nlogs:"
    text = re.sub(r"(?s)\nvehicle: .*?\nlogs:", vehicle, text, count=1)
    text = re.sub(r"unit: null # required: m/s.*", "unit: m/s", text)
    path.write_text(text.replace("standard_deviation: null", "standard_deviation: 0.01"), encoding="utf-8")


@pytest.mark.slow
def test_commands_of_the_readme_and_the_pages_run_in_order_in_one_empty_folder(quick, tmp_path, monkeypatch):
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    text = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    for written, name in FENCE.findall(text):
        Path(f"{name}.yaml").write_text(written, encoding="utf-8")
    for k, written in enumerate(FRAGMENT.findall(FENCE.sub("\n", text))):
        Path(f"fragment{k}.yaml").write_text(written, encoding="utf-8")
        assert loading.load_experiment(loading.find_experiment(None), [f"fragment{k}.yaml"])
    done = []
    init = shlex.split(next(line for line in text.splitlines() if line.startswith("    auvid init mine")))[1:]
    for block in indented(text):
        if block.startswith("import "):
            exec(block, {})
            continue
        for program, *arguments in commands(block):
            assert program == "auvid", f"{program} {arguments}: neither auvid nor named in this test"
            if arguments in done:
                continue  # Said again where it belongs.
            if arguments[:2] == ["import", "--suggest"]:
                write_log(Path(arguments[2]))
                if "--vehicle" in arguments and not Path("mine").exists():
                    # The README links to the page with this command.
                    assert CliRunner().invoke(app, init).exit_code == 0
                    done.append(init)
            if arguments[0] == "compare":
                # The reader has these: of an earlier run, or of a clone.
                shutil.copytree("results/spiral/tables", Path(arguments[2]) / "spiral", dirs_exist_ok=True)
            result = CliRunner().invoke(app, arguments)
            assert result.exit_code == 0, f"auvid {shlex.join(arguments)}:\n{result.output}"
            if arguments[:2] == ["import", "--suggest"]:
                fill_in(Path(arguments[-1]))
            done.append(arguments)
    commands_done = {arguments[0] for arguments in done}
    assert commands_done >= {"run", "identify", "validate", "export", "import", "inspect", "campaign", "compare"}


@pytest.fixture
def datasets_of_the_pages(quick, tmp_path, monkeypatch):
    """Folder with the files that fenced commands name: short runs, one of them also as logs with a map."""
    configs = enums.shipped_configs()
    for path in configs.glob("manoeuvres/spiral*.yaml"):
        path.write_text(path.read_text(encoding="utf-8").replace("duration: 120 s", "duration: 20 s"), encoding="utf-8")
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    for arguments in (["-o", "results/spiral"], ["--as-log", "-o", "dive"], ["-o", "results/dive"]):
        assert CliRunner().invoke(app, ["simulate", *arguments]).exit_code == 0


@pytest.mark.slow
def test_fenced_commands_of_the_pages_run_in_order(datasets_of_the_pages):
    done = []
    for page in (*FIRST[:2], *sorted(DOCS.glob("how-to/*.md"))):
        for block in SHELL.findall(page.read_text(encoding="utf-8")):
            for command in filter(RUN_HERE.match, block.splitlines()):
                arguments = [
                    name
                    for word in shlex.split(command, comments=True)[1:]
                    for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
                ]
                if arguments[0] == "fit" and not {"--only", "--not"} & {*arguments}:
                    # Tests of the search check what it finds.
                    arguments += ["--only", "fin_trim"]
                result = CliRunner().invoke(app, arguments)
                if command.endswith("terms.yaml") and "No term is proposed" in done[-1][1]:
                    assert result.exit_code == 2, command  # The page says that there is no such file then.
                    continue
                # As the page of `fit` says: 1 if the model is not sound.
                assert result.exit_code in ((0, 1) if "fit" in command else (0,)), f"{command}:\n{result.output}"
                done.append((command, result.output))
    assert len(done) >= 9, done


def test_fenced_commands_have_known_options():
    """Some commands in fences take long, so all are parsed and not run."""
    group = get_command(app)
    assert isinstance(group, Group)
    parsed = 0
    for page in (ROOT / "README.md", *sorted(DOCS.rglob("*.md"))):
        for line in "".join(SHELL.findall(page.read_text(encoding="utf-8"))).splitlines():
            if line.startswith("auvid "):
                name, *arguments = shlex.split(line, comments=True)[1:]
                command = group.commands.get(name)
                assert command is not None, f"{page.name}: {line}"
                command.make_context(name, arguments)
                parsed += 1
    assert parsed >= 20
