"""What came of a design, on the terminal."""

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.text import Text

from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table

if TYPE_CHECKING:
    # It brings the compiled core along.
    from auvid_cli.design.conclusion import Design
    from auvid_cli.design.trials import Trial

_DIGITS = 3


def print_design(console: Console, design: "Design") -> None:
    """Print manoeuvres beside each other on vehicles that the search has not seen, and what is to be made of it."""
    spiral = design.trials["spiral"]
    columns = (
        Column("manoeuvre", numeric=False),
        *(Column(header) for header in ("mean sd (%)", "worst sd (%)", "gain", "least", "largest")),
        *(Column(header) for header in ("outside", "box (m)", "depth (m)")),
    )
    rows = [_row(name, trial, spiral) for name, trial in design.trials.items()]
    console.print(screen_table(console, Table("design", "Design", columns, rows), _DIGITS, unbroken=["manoeuvre"]))
    for line in sentences(design):
        console.print(Text(line), soft_wrap=True)


def _row(name: str, trial: "Trial", spiral: "Trial") -> list[Cell]:
    home = [flight.extent for flight in trial.flights if flight.extent is not None]
    counted: list[Cell] = [f"{trial.outside} of {len(trial.flights)}"]
    if not home:
        return [name, None, None, None, None, None, *counted, None, None]
    gains, percent = trial.gain_over(spiral), trial.percent()
    percent = percent[percent > 0.0]
    gain: list[Cell] = [None] * 3
    if gains.size:
        gain = [trial.mean_gain_over(spiral), float(gains.min()), float(gains.max())]
    sizes: list[Cell] = [max(extent.box for extent in home), max(extent.depth for extent in home)]
    return [name, float(np.exp(np.log(percent).mean())), float(percent.max()), *gain, *counted, *sizes]


def sentences(design: "Design") -> list[str]:
    """Say what is to be made of a design, a line each."""
    chosen, spiral = design.trials[design.chosen], design.trials["spiral"]
    number = len(spiral.flights)
    gain = f"x{design.gain:.2f} over the spiral"
    if design.is_own and design.is_worth_while:
        lines = ["No designed run keeps the envelope as the spiral does: the spiral is what is written."]
    elif design.is_own:
        lines = [f"The spiral is as good ({gain} on {number} vehicles not seen by the search): it is what is written."]
    elif design.chosen == "designed":
        lines = [f"The designed run gives {gain} on {number} vehicles not seen by the search."]
    else:
        said = f"{gain} on {number} vehicles not seen by the search"
        lines = [f"Best of all that was tried: {design.chosen} ({said}), which is what is written."]
    if chosen.outside:
        limits = dict.fromkeys(name for shares in chosen.excess for name, share in shares.items() if share > 0.0)
        how = f" ({', '.join(limits)})" if limits else ""
        lost = f", of which {chosen.lost} are lost" if chosen.lost else ""
        lines.append(f"It leaves the envelope with {chosen.outside} of {number} vehicles{how}{lost}: keep room for it.")
    if np.isfinite(design.gain) and spiral.outside and not design.is_own:
        lines.append(f"The spiral itself leaves the envelope with {spiral.outside} of them.")
    if design.soonest is not None and not design.is_own:
        lines.append(
            f"After {design.soonest:.0f} of {design.posterior.time[-1]:.0f} s it has told what the spiral tells in all."
        )
    end = design.posterior.time[-1]
    course = ", ".join(f"{percent:.2g} % after {time:.0f} s" for time, percent in design.growth if time <= end)
    lines.append(f"Mean sd with the vehicle as it is believed to be: {course}.")
    if longer := [f"{percent:.2g} % in {time:.0f} s" for time, percent in design.growth if time > end]:
        lines.append(f"A longer run of this kind, if there is room for it: {', '.join(longer)}.")
    lines += [f"{poor.symbol} stays at {poor.percent:.2g} %: {poor.why}." for poor in design.poor]
    return lines
