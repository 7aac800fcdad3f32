"""The tutorial of manoeuvres, command by command in one empty folder, with shorter runs; and what it says they tell."""

import re
import shlex
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from auvid_cli.cli.app import app

TUTORIAL = Path(__file__).parents[1] / "docs/which-manoeuvre.md"
SHORTER = {
    '"120 s" --generations 12 --draws 4': '"20 s" --generations 1 --draws 1',
    'duration=120 s" --set manoeuvre.excitation.roll_moment=null --filter': 'duration=15 s" --filter',
    "duration=120 s": "duration=40 s",
    "-o results/circle": '--set "manoeuvre.duration=60 s" -o results/circle',
    "-o results/zigzag": '--set "manoeuvre.duration=60 s" -o results/zigzag',
}


@pytest.mark.slow
def test_the_commands_of_the_tutorial_tell_what_it_says(tmp_path, monkeypatch, without_figures, fewer_starts):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"(?m)^    (auvid .*)", TUTORIAL.read_text(encoding="utf-8"))
    assert len(commands) == 7
    for command in commands:
        shorter = command
        for long, short in SHORTER.items():
            shorter = shorter.replace(long, short)
        result = CliRunner().invoke(app, shlex.split(shorter)[1:])
        # So short a run may be doubted with reason.
        assert result.exit_code in (0, 1 if " run " in command else 0), f"{shorter}:\n{result.output}"
    bounds = {
        name: pd.read_csv(f"results/{name}/tables/identifiability.csv").set_index("coefficient")
        for name in ("circle", "zigzag", "spiral")
    }
    # A steady turn tells sums, a zigzag yaw and not heave or pitch, a spiral all of them.
    assert bounds["zigzag"].loc["N_r|r|", "percent"] < bounds["circle"].loc["N_r|r|", "percent"] / 10
    for vertical in ("Z_w|w|", "M_q|q|"):
        assert bounds["zigzag"].loc[vertical, "verdict"] == "not identified"
        assert bounds["spiral"].loc[vertical, "verdict"] != "not identified"
    assert (Path("mission") / "timeline.md").is_file()
    assert Path("results/designed_run/tables/coefficients.csv").is_file()
