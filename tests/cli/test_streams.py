"""Standard streams that are full, closed, or know few signs."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from auvid_cli.cli.terminal import reporting_errors

COMPLAINT = "auvid: output: No space left on device\n"


def shell(command, **environment):
    line = f"{sys.executable} -m auvid_cli {command}"
    return subprocess.run(line, shell=True, capture_output=True, text=True, env=os.environ | environment, timeout=60)


@pytest.mark.parametrize("command", ["--version", "--help", "simulate --dry-run"])
def test_full_device_is_one_line(command):
    result = shell(f"{command} > /dev/full")
    assert (result.returncode, result.stderr) == (2, COMPLAINT)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("redirection", "code"),
    [
        ("--version >&-", 0),
        ("--version >&- 2>&- <&-", 0),
        ("inspect none.h5 >/dev/full 2>&1", 2),
        ("--help >/dev/full 2>&1", 2),
    ],
)
def test_closed_streams_give_exit_code(redirection, code):
    result = shell(redirection)
    assert (result.returncode, result.stdout, result.stderr) == (code, "", "")


def test_unsupported_characters_are_escaped():
    result = shell("run --set é=1", PYTHONIOENCODING="ascii")
    assert result.returncode == 2
    assert r"unknown key '\xe9'" in result.stderr


def test_undecodable_name_is_printed_escaped():
    line = "from auvid_cli.cli.streams import prepare_streams; prepare_streams(); print('\\udcff é')"
    command = [sys.executable, "-c", line]
    result = subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": "ascii"}, timeout=60)
    assert result.stdout == b"\\udcff \\xe9\n"


def swallow_an_end():
    with reporting_errors(), suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)


def test_swallowed_signal_still_ends_command():
    with pytest.raises(SystemExit) as ended:
        swallow_an_end()
    assert ended.value.code == 128 + signal.SIGTERM
