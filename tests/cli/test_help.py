"""Help of every command on a terminal of 80 columns."""

import shlex

import pytest
import typer.main

from auvid_cli.cli.app import GROUPS, app

from .conftest import auvid

COMMANDS = {entry.name: entry for entries in GROUPS.values() for entry in entries}
EXAMPLES = [example for entry in COMMANDS.values() for example in entry.examples]


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def words(text: str) -> list[str]:
    return text.replace("│", " ").split()


def test_help_lists_commands_by_task():
    output = auvid("-h").stdout
    places = [
        output.index(place) for title, entries in GROUPS.items() for place in (f"─ {title} ─", *map(row, entries))
    ]
    assert places == sorted(places)
    assert output.index("│ import ") < output.index("│ inspect ") < output.index("│ run ")


def row(entry) -> str:
    return f"│ {entry.name} "


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_the_same_by_both_names_and_shows_examples(name):
    result = auvid(name, "-h")
    assert result.exit_code == 0
    assert result.stdout == auvid(name, "--help").stdout
    assert all(f" {example} " in result.stdout for example in COMMANDS[name].examples)


@pytest.mark.parametrize("example", EXAMPLES)
def test_example_of_the_help_is_accepted(example):
    program, name, *arguments = shlex.split(example)
    assert program == "auvid"
    command = typer.main.get_command(app).commands[name]
    assert command.make_context(name, arguments).params


@pytest.mark.parametrize("name", COMMANDS)
def test_help_breaks_no_option_and_shows_no_python_type(name):
    command = typer.main.get_command(app).commands[name]
    output = words(auvid(name, "-h").stdout)
    for param in command.params:
        assert {*param.opts} <= {*output} or param.param_type_name == "argument"
        assert param.metavar is None or param.metavar in output
    assert not [word for word in output if word.startswith("<")]


def test_help_paragraphs_fill_the_line():
    """A line of a paragraph ends only if the next word does not fit."""
    lines = auvid("validate", "-h").stdout.split("\n")
    begin = next(i for i, line in enumerate(lines) if line.startswith(" The model is simulated"))
    for line, following in zip(lines[begin:], lines[begin + 1 :], strict=False):
        if not following.strip():
            break
        assert len(line.rstrip()) + 1 + len(following.split()[0]) > 78


@pytest.mark.parametrize(
    "arguments", [("run", "--filter", "foo"), ("export", "a.h5", "--to", "foo"), ("list", "foo")], ids=lambda a: a[0]
)
def test_unknown_choice_lists_valid_choices(arguments):
    result = auvid(*arguments)
    output = " ".join(words(result.stderr))
    assert result.exit_code == 2
    assert ": 'foo' is not one of '" in output
