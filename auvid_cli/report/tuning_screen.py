"""Noise as the data have it, for the terminal: each kind with its interval, and what it makes of the estimate."""

from collections.abc import Callable
from math import isfinite

from rich.console import Console
from rich.text import Text

from auvid_cli.data.estimate import Estimate
from auvid_cli.data.tuning import DisturbanceChoice, TunedNoise, Tuning
from auvid_cli.evaluation.judgement import Judgement, whiteness
from auvid_cli.report.screen_table import screen_table
from auvid_cli.report.table import Cell, Column, Table, UnitCell

_DIGITS = 3
_LESS, _WHITE = "any less will do", "white process noise would do"
_LONGER, _ANY = "any longer will do", "any will do"
_PREFIX = "identification."


# The smoother's estimate, and what is said of it.
Judged = tuple[Estimate, Judgement]


def print_tuning(console: Console, tuning: Tuning, before: Judged, after: Judged) -> None:
    """Print the noise, and the smoother's estimates with the stated and with the tuned one."""
    console.print(screen_table(console, _noises(tuning), _DIGITS))
    for said, of, so in _SAYINGS:
        if names := [noise.setting.removeprefix(_PREFIX) for noise in tuning.noises if of(noise)]:
            console.print(Text(f"The data {said} {', '.join(names)}: {so}."))
    console.print(screen_table(console, _estimates(before, after), _DIGITS))
    if not tuning.converged:
        console.print(Text("The search has not settled: take this for a beginning, and tune again with it."))


def _noises(tuning: Tuning) -> Table:
    columns = (
        *(Column(header, numeric=False) for header in ("noise", "unit")),
        *(Column(header) for header in ("stated", "most likely", "95 % from", "to")),
    )
    return Table("noise", "Noise", columns, [_row(noise) for noise in tuning.noises])


def choice_text(choice: DisturbanceChoice) -> str:
    """Say whether a disturbance is estimated, and why."""
    criterion = f"{choice.numbers} numbers more must bring {choice.needed:.3g} (Bayesian information criterion)"
    what = "kept" if choice.is_kept else "left out"
    return f"a disturbance that lasts is {what}: with it the log-likelihood is {choice.gain:+.4g}, and {criterion}"


def _is_flat(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and not isfinite(noise.high)


def _is_bounded(noise: TunedNoise) -> bool:
    return noise.low == 0.0 and isfinite(noise.high)


# What data say of some noise, of which, and what follows.
_SAYINGS: tuple[tuple[str, Callable[[TunedNoise], bool], str], ...] = (
    ("only say that there is no more of", lambda noise: _is_bounded(noise) and not noise.is_time_constant, _LESS),
    ("say nothing of", lambda noise: _is_flat(noise) and not noise.is_time_constant, _LESS),
    ("only say that it is no longer,", lambda noise: _is_bounded(noise) and noise.is_time_constant, _WHITE),
    ("only say that it is no shorter,", lambda noise: noise.low > 0.0 and not isfinite(noise.high), _LONGER),
    ("say nothing of", lambda noise: _is_flat(noise) and noise.is_time_constant, _ANY),
)


def _row(noise: TunedNoise) -> list[Cell]:
    # Where any less will do the likeliest is as little as the search allows, and says nothing.
    is_none = noise.low == 0.0 and noise.tuned < 1e-3 * noise.high and not noise.is_time_constant
    likeliest = "none" if is_none else noise.tuned
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
