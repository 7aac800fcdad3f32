"""What the help of every command says, at the width of the narrowest terminal that is usual."""

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


def test_commands_stand_by_task_in_the_order_of_use():
    said = auvid("-h").stdout
    places = [said.index(place) for title, entries in GROUPS.items() for place in (f"─ {title} ─", *map(row, entries))]
    assert places == sorted(places)
    assert said.index("│ import ") < said.index("│ inspect ") < said.index("│ run ")


def row(entry) -> str:
    return f"│ {entry.name} "


@pytest.mark.parametrize("name", COMMANDS)
def test_help_is_the_same_by_both_names_and_shows_examples(name):
    result = auvid(name, "-h")
    assert result.exit_code == 0
    assert result.stdout == auvid(name, "--help").stdout
    assert all(f" {example} " in result.stdout for example in COMMANDS[name].examples)


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_is_a_command_that_parses(example):
    program, name, *arguments = shlex.split(example)
    assert program == "auvid"
    command = typer.main.get_command(app).commands[name]
    assert command.make_context(name, arguments).params


@pytest.mark.parametrize("name", COMMANDS)
def test_no_option_or_value_is_broken_and_no_python_type_is_shown(name):
    command = typer.main.get_command(app).commands[name]
    said = words(auvid(name, "-h").stdout)
    for param in command.params:
        assert {*param.opts} <= {*said} or param.param_type_name == "argument"
        assert param.metavar is None or param.metavar in said
    assert not [word for word in said if word.startswith("<")]


def test_no_paragraph_is_broken_where_the_source_is():
    """Lines of a paragraph end where the next word would not fit."""
    lines = auvid("validate", "-h").stdout.split("\n")
    begin = next(i for i, line in enumerate(lines) if line.startswith(" The estimate's vehicle"))
    for line, following in zip(lines[begin:], lines[begin + 1 :], strict=False):
        if not following.strip():
            break
        assert len(line.rstrip()) + 1 + len(following.split()[0]) > 78


@pytest.mark.parametrize(
    "arguments", [("run", "--filter", "foo"), ("export", "a.h5", "--to", "foo"), ("list", "foo")], ids=lambda a: a[0]
)
def test_a_word_that_is_no_choice_is_answered_with_those_there_are(arguments):
    result = auvid(*arguments)
    said = " ".join(words(result.stderr))
    assert result.exit_code == 2
    assert ": 'foo' is not one of '" in said
