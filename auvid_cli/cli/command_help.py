"""Help of commands: paragraphs, examples below them, and no Python types."""

from collections.abc import Callable, Sequence
from inspect import cleandoc
from typing import Any

from rich.markup import escape
from typer import BadParameter
from typer.core import TyperCommand, TyperGroup

BOTH_HELPS = {"help_option_names": ["-h", "--help"]}  # context settings of each command


class Command(TyperCommand):
    """Command whose help shows no Python types of flags and arguments."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, without the types of flags and arguments."""
        return _without_types(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command line; remove the prefix of pydantic from error messages."""
        try:
            return super().parse_args(ctx, args)
        except BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")
            raise


class Group(TyperGroup):
    """Group of commands whose help shows no Python types."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, without the types of flags and arguments."""
        return _without_types(super().get_params(ctx))


def paragraphs(function: Callable[..., None]) -> str:
    """Return the docstring of a command, one line per paragraph."""
    return "\n\n".join(" ".join(part.split()) for part in cleandoc(function.__doc__ or "").split("\n\n"))


def examples_text(examples: Sequence[str]) -> str:
    """Return the examples below the help of a command."""
    return "\n".join(["Example:" if len(examples) == 1 else "Examples:", *map(escape, examples)])


def _without_types(params: list[Any]) -> list[Any]:
    for param in params:
        if param.param_type_name == "argument":
            param.display_type_rich = _nothing
        elif param.is_flag:
            param.metavar = ""
    return params


def _nothing(ctx: Any) -> None:
    """Return no type."""
