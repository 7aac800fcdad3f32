"""The tutorial, block by block in one namespace, as in a notebook."""

import re
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).parents[1] / "docs/tutorial.md"
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


@pytest.mark.slow
def test_the_blocks_of_the_tutorial_run_in_order_and_leave_one_file(tmp_path, monkeypatch, capsys, fewer_starts):
    monkeypatch.chdir(tmp_path)
    text, names = TUTORIAL.read_text(encoding="utf-8"), {}
    for block in BLOCK.finditer(text):
        # With its lines where they stand in the page, for whoever reads the traceback.
        lines_before = "\n" * text.count("\n", 0, block.start(1))
        exec(compile(lines_before + block[1], str(TUTORIAL), "exec"), names)
    assert names["ckf"].completed
    assert names["tukf"].completed
    assert (names["errors"]["tukf"] < 20.0).mean() > 0.8
    printed = capsys.readouterr().out
    shown = re.findall(r"(?m)^ {4}(\S.*)", BLOCK.sub("", text))
    assert len(shown) >= 3
    assert set(shown) <= set(printed.splitlines())
    assert printed.endswith("unknown filter 'tufk'; auvid knows ekf, ckf, tukf, ukf, smoother, output_error\n")
    assert [path.name for path in tmp_path.iterdir()] == ["vehicle.py"]
