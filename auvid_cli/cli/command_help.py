"""How the help of commands looks: whole paragraphs, examples below them, and of types only what one has to give."""

from collections.abc import Callable, Sequence
from inspect import cleandoc
from typing import Any

from rich.markup import escape
from typer import BadParameter
from typer.core import TyperCommand, TyperGroup

# What the parser of a command takes: both names of the help.
BOTH_HELPS = {"help_option_names": ["-h", "--help"]}


class Command(TyperCommand):
    """A command whose help does not tell the Python types of flags and arguments."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, as typer's own."""
        return _without_types(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse words; what pydantic puts before its complaints says nothing to whoever reads them."""
        try:
            return super().parse_args(ctx, args)
        except BadParameter as error:
            error.message = error.message.removeprefix("Value error, ")
            raise


class Group(TyperGroup):
    """All commands together, likewise."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the parameters, as typer's own."""
        return _without_types(super().get_params(ctx))


def paragraphs(function: Callable[..., None]) -> str:
    """Return the docstring of a command, each paragraph in a line, for the terminal to break."""
    return "\n\n".join(" ".join(part.split()) for part in cleandoc(function.__doc__ or "").split("\n\n"))


def examples_text(examples: Sequence[str]) -> str:
    """Write examples as they stand below the help of a command."""
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
