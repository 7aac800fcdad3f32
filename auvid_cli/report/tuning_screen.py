"""Noise as the data have it, for the terminal: each kind with its interval, and what it makes of the estimate."""

from math import isfinite

from rich.console import Console
from rich.text import Text

from auvid_cli.data.estimate import Estimate
from auvid_cli.data.tuning import TunedNoise, Tuning
from auvid_cli.evaluation.judgement import Judgement, whiteness
from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table, UnitCell

_DIGITS = 3
_PREFIX = "identification."


# The smoother's estimate, and what is said of it.
Judged = tuple[Estimate, Judgement]


def print_tuning(console: Console, tuning: Tuning, before: Judged, after: Judged) -> None:
    """Print the noise, and the smoother's estimates with the stated and with the tuned one."""
    console.print(screen_table(console, _noises(tuning), _DIGITS))
    for said, of in (("only say that there is no more of", _is_bounded), ("say nothing of", _is_flat)):
        if names := [noise.setting.removeprefix(_PREFIX) for noise in tuning.noises if of(noise)]:
            console.print(Text(f"The data {said} {', '.join(names)}: any less will do."))
    console.print(screen_table(console, _estimates(before, after), _DIGITS))
    if not tuning.converged:
        console.print(Text("The search has not settled: take this for a beginning, and tune again with it."))


def _noises(tuning: Tuning) -> Table:
    columns = (
        *(Column(header, numeric=False) for header in ("noise", "unit")),
        *(Column(header) for header in ("stated", "most likely", "95 % from", "to")),
    )
    return Table("noise", "Noise", columns, [_row(noise) for noise in tuning.noises])


def _is_flat(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and not isfinite(noise.high)


def _is_bounded(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and isfinite(noise.high)


def _row(noise: TunedNoise) -> list[Cell]:
    # Where any less will do the likeliest is as little as the search allows, and says nothing.
    likeliest = "none" if noise.low == 0.0 and noise.tuned < 1e-3 * noise.high else noise.tuned
    high = noise.high if isfinite(noise.high) else "no end"
    return [noise.setting.removeprefix(_PREFIX), UnitCell(noise.unit), noise.stated, likeliest, noise.low, high]


def _estimates(before: Judged, after: Judged) -> Table:
    """Lay out mean NIS and memory of the innovations of each sensor, and the judgement."""
    rows: list[list[Cell]] = []
    for sensor in before[0].innovations:
        nis: list[Cell] = [estimate.innovations[sensor].tally().mean_nis for estimate, _ in (before, after)]
        rows.append([f"mean NIS of {sensor}", *nis])
        memory: list[Cell] = [whiteness(estimate.innovations[sensor]).portmanteau for estimate, _ in (before, after)]
        rows.append([f"memory of {sensor}, Ljung-Box", *memory])
    grades: list[Cell] = [judgement.grade for _, judgement in (before, after)]
    columns = Column("smoother", numeric=False), Column("as stated"), Column("tuned")
    return Table("tuned", "Before and after", columns, [*rows, ["judgement", *grades]])
