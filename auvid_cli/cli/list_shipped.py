"""auvid list."""

from enum import StrEnum
from typing import Annotated

import typer

from auvid_cli.cli.hanging import hanging
from auvid_cli.cli.terminal import reporting_errors


class Listed(StrEnum):
    """What may be listed, in the order in which it is."""

    EXPERIMENTS = "experiments"
    VEHICLES = "vehicles"
    SENSORS = "sensors"
    MANOEUVRES = "manoeuvres"
    CAMPAIGNS = "campaigns"
    FILTERS = "filters"


# How what is listed is used.
_USES = {
    Listed.EXPERIMENTS: "auvid run NAME",
    Listed.VEHICLES: "vehicle: NAME in an experiment, or --set vehicle=NAME",
    Listed.SENSORS: "sensors: NAME, or --set sensors=NAME",
    Listed.MANOEUVRES: "manoeuvre: NAME, or --set manoeuvre=NAME",
    Listed.CAMPAIGNS: "auvid campaign NAME",
    Listed.FILTERS: "--filter NAME, or identification.filters",
}


def list_shipped(
    kinds: Annotated[
        list[Listed] | None,
        typer.Argument(metavar="KIND", help=f"{', '.join(Listed)}. Default: all.", show_default=False),
    ] = None,
) -> None:
    """List what ships with auvid: experiments, their parts, campaigns and filters, a line each."""
    with reporting_errors():
        from auvid_cli.config.filter_name import FilterName
        from auvid_cli.config.shipped import shipped_files

        for kind in kinds or Listed:
            rows = (
                [(name.value, name.description) for name in FilterName]
                if kind is Listed.FILTERS
                else shipped_files(kind.value)
            )
            width = max(len(name) for name, _ in rows)
            print(f"{kind.value} ({_USES[kind]})")
            for name, description in rows:
                print(hanging(f"  {name:{width}}  {description}", width + 4))
