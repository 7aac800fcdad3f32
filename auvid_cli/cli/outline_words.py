"""Quantities of `auvid init` in two words: ``--length 2 m``."""

from collections.abc import Iterable, Mapping
from typing import Any

from auvid_cli.cli.command_help import Command


class OutlineCommand(Command):
    """A command whose options are the keys of an outline, with a unit as a word of its own if you like."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse words of which a number and its unit are first made one."""
        from auvid_cli.config.outline import option, units

        return super().parse_args(ctx, joined(args, {option(key): unit for key, unit in units().items()}))


def joined(words: Iterable[str], units: Mapping[str, str]) -> list[str]:
    """Join a number and its unit where they follow an option that takes such a quantity.

    Parameters
    ----------
    words : iterable of str
    units : mapping
        SI unit of what each option takes.
    """
    from auvid_cli.config.quantity import NUMBER

    result: list[str] = []
    for word in words:
        unit = units.get(result[-2]) if len(result) > 1 else None
        if unit is not None and NUMBER.fullmatch(result[-1]) and _is_quantity(f"{result[-1]} {word}", unit):
            result[-1] += f" {word}"
        else:
            result.append(word)
    return result


def _is_quantity(text: str, unit: str) -> bool:
    from auvid_cli.config.quantity import parse_quantity

    try:
        parse_quantity(text, unit)
    except ValueError:
        return False
    return True
