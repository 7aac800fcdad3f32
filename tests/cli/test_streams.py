"""Standard streams that are full, closed, or know few signs."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from typing import Any, cast

import pandas as pd
import pytest

from auvid_cli.cli.terminal import reporting_errors

COMPLAINT = "auvid: output: No space left on device\n"


def shell(command, **environment):
    line = f"{sys.executable} -m auvid_cli {command}"
    return subprocess.run(line, shell=True, capture_output=True, text=True, env=os.environ | environment, timeout=60)


@pytest.mark.slow
@pytest.mark.parametrize("command", ["--version", "--help", "simulate --dry-run"])
@pytest.mark.posix
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
@pytest.mark.posix
def test_closed_streams_give_exit_code(redirection, code):
    result = shell(redirection)
    assert (result.returncode, result.stdout, result.stderr) == (code, "", "")


@pytest.mark.slow
def test_unsupported_characters_are_escaped():
    result = shell("run --set é=1", PYTHONIOENCODING="ascii")
    assert result.returncode == 2
    assert r"unknown key '\xe9'" in result.stderr


def test_undecodable_name_is_printed_escaped():
    line = "from auvid_cli.cli import prepare_streams; prepare_streams(); print('\\udcff é')"
    command = [sys.executable, "-c", line]
    result = subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": "ascii"}, timeout=60)
    assert result.stdout == b"\\udcff \\xe9\n"


def end_swallowed(number):
    with reporting_errors(), suppress(KeyboardInterrupt):
        signal.raise_signal(number)


@pytest.mark.posix
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_swallowed_signal_still_ends_command(name):
    number = getattr(signal, name)
    with pytest.raises(SystemExit) as ended:
        end_swallowed(number)
    assert ended.value.code == 128 + number


class Interrupted:
    """A file whose reading is interrupted, which pandas reports as an error of its own."""

    def read(self, size=-1):
        signal.raise_signal(signal.SIGINT)
        return b""

    def __iter__(self):
        return self

    def __next__(self):
        return self.read()


def read_interrupted():
    with reporting_errors():
        pd.read_csv(cast("Any", Interrupted()), engine="c", encoding="utf-8")


def test_interrupt_that_a_library_turns_into_an_error_is_an_interrupt(capsys):
    with pytest.raises(SystemExit) as ended:
        read_interrupted()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "auvid: interrupted; files already written are complete\n"


@pytest.mark.posix
def test_ignored_signal_stays_ignored():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with reporting_errors():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_reader_that_ends_does_not_end_the_command():
    code = """
import sys
from auvid_cli.cli import finish, prepare_streams
prepare_streams()
print("first", flush=True)
sys.stdin.readline()
print("second", flush=True)
print("goes on", file=sys.stderr)
sys.exit(finish(0))
"""
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == "first\n"
        process.stdout.close()
        process.stdin.write("\n")
        process.stdin.close()
        assert process.stderr is not None
        assert process.stderr.read() == "goes on\n"
        assert process.wait() == 0


@pytest.mark.slow
@pytest.mark.parametrize("setting", ["NUMBA_NUM_THREADS=-1", "NUMBA_OPT=abc", "NUMBA_CPU_FEATURES=abc"])
def test_invalid_environment_variable_is_one_line(setting):
    name, _, value = setting.partition("=")
    result = shell("simulate -o out", **{name: value})
    assert result.returncode == 2
    assert result.stderr.startswith("auvid: environment")
    assert name in result.stderr
    assert result.stderr.count("\n") == 1
