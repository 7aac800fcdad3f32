"""Filters over steps and priors, into docs/studies.md and docs/images/regimes.png: `python -m docs.make_regimes`.

From the kept rows of `auvid campaign regimes`; `--results results/campaigns/regimes` reads and keeps new ones.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvid_cli.report.figures.style import DPI, FILTER_STYLES
from auvid_cli.report.table import filter_label
from docs.campaign_rows import campaign_rows, results_option
from docs.section import replace_section

_PICTURE = Path(__file__).with_name("images") / "regimes.png"
_STEP, _PRIOR = "filter_step", "identification.prior.factor"
_ERROR = "steady_state_error_percent"
_WIDEST_USUAL = 3.0  # widest prior, in natural magnitudes, with which no filter fails
_DRAWN = ("ekf", "ckf", "tukf", "ukf")
_LABEL_GAP = 0.07  # of the height of a panel


def labelled(name: str) -> str:
    """Return the label of a filter variant."""
    return "EKF, first order" if name == "ekf_first_order" else filter_label(name)


def with_outcomes(runs: pd.DataFrame) -> pd.DataFrame:
    """Return runs with whether each was lost, was inconsistent or failed in one of these ways, and its step in s."""
    lost, inconsistent = (runs["status"].str.startswith(words) for words in (("diverged", "failed"), "inconsistent"))
    step = runs[_STEP].str.removesuffix(" s").astype(float)
    return runs.assign(lost=lost, inconsistent=inconsistent, fails=lost | inconsistent, step=step)


def cell(runs: pd.DataFrame) -> str:
    """Return the median error of the runs that ended, and how many runs did not end well."""
    ended = runs.loc[~runs["lost"], _ERROR]
    counts = {"lost": runs["lost"].sum(), "inc.": runs["inconsistent"].sum()}
    notes = [f"{count} {word}" for word, count in counts.items() if count]
    return (f"{ended.median():.3g}" if len(ended) else "-") + (f" ({', '.join(notes)})" if notes else "")


def cells(runs: pd.DataFrame, names: list[str]) -> list[str]:
    """Return a row for each step and prior."""
    return [
        f"| {step} | {prior:g} | {' | '.join(cell(own[own['filter'] == name]) for name in names)} |"
        for (step, prior), own in runs.groupby([_STEP, _PRIOR], sort=False)
    ]


def failures(runs: pd.DataFrame, names: list[str]) -> list[str]:
    """Return a row for each prior: the share of the runs of all steps that were lost or inconsistent."""
    shares = runs.groupby([_PRIOR, "filter"])["fails"].mean().unstack()[names]
    return [f"| {prior:g} | {' | '.join(f'{share:.0%}' for share in row)} |" for prior, row in shares.iterrows()]


def against_ckf(runs: pd.DataFrame, names: list[str]) -> list[str]:
    """Return how the errors of each filter compare with those of the CKF, seed by seed, with usual priors."""
    usual = runs[(runs[_PRIOR] <= _WIDEST_USUAL) & ~runs["lost"]]
    errors = usual.pivot(index=[_STEP, _PRIOR, "seed"], columns="filter", values=_ERROR)
    lines = []
    for name in names:
        if name != "ckf":
            ratio = (errors[name] / errors["ckf"]).dropna()
            low, high = ratio.quantile([0.05, 0.95])
            lines.append(f"| {labelled(name)} | {len(ratio)} | {ratio.median():.3f} | {low:.2f} - {high:.2f} |")
    return lines


def label_lines(axes: Axes, ends: dict[str, float]) -> None:
    """Write the name of each filter at the end of its line, one below the other."""
    low, high = axes.get_ylim()
    below = np.inf
    for name, end in sorted(ends.items(), key=lambda item: -item[1]):
        height = min((end - low) / (high - low), below - _LABEL_GAP)
        below = height
        axes.text(
            1.02, height, filter_label(name), transform=axes.transAxes, color=FILTER_STYLES[name].color, va="center"
        )


def lines(axes: Axes, tables: Iterable[tuple[str, "pd.Series[float]"]]) -> None:
    """Draw a line for each filter, with its name at the end."""
    ends = {}
    for name, values in tables:
        style = FILTER_STYLES[name]
        axes.plot(values.index, values, **style.line(), **style.mark())
        ends[name] = float(values.iloc[-1])
    axes.set_ylim(0.0)
    axes.set_xscale("log")
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    label_lines(axes, ends)


def picture(runs: pd.DataFrame) -> Figure:
    """Draw the share of failed runs over the prior, and the error over the step with usual priors."""
    figure = Figure(figsize=(9.5, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    by_filter = {name: runs[runs["filter"] == name] for name in _DRAWN}
    lines(left, ((name, 100.0 * own.groupby(_PRIOR)["fails"].mean()) for name, own in by_filter.items()))
    left.set_xticks(priors := sorted(runs[_PRIOR].unique()), [f"{prior:g}" for prior in priors])
    left.set_xlabel("standard deviation of the prior / natural magnitude")
    left.set_title("Lost or inconsistent runs, %", loc="left", fontsize=11)
    usual = {name: own[(own[_PRIOR] <= _WIDEST_USUAL) & ~own["lost"]] for name, own in by_filter.items()}
    lines(right, ((name, own.groupby("step")[_ERROR].median()) for name, own in usual.items()))
    right.set_xticks(steps := sorted(runs["step"].unique()), [f"{step:g}" for step in steps])
    right.set_xlabel("time between samples of gyroscope and attitude, s")
    right.set_title(f"Steady-state error, priors up to {_WIDEST_USUAL:g}, %", loc="left", fontsize=11)
    for axes in (left, right):
        axes.minorticks_off()
    return figure


def main() -> None:
    """Write the section and the picture."""
    rows = campaign_rows("regimes", results_option(__doc__).parse_args().results, kinds=("run",))
    runs = with_outcomes(rows.runs)
    names = [variant.name for variant in rows.plan.filters]
    labels, of_prior = " | ".join(map(labelled, names)), len(runs) // runs[_PRIOR].nunique() // len(names)
    text = [
        f"{rows.summary()} {runs['seed'].nunique()} seeds in each of {len(runs.groupby([_STEP, _PRIOR]))} cells.",
        "",
        f"Lost or inconsistent, of {of_prior} runs (all steps):",
        "",
        f"| prior / natural magnitude | {labels} |",
        f"| ---: {'| ---: ' * len(names)}|",
        *failures(runs, names),
        "",
        f"Steady-state error relative to that of the CKF in the same run, priors up to {_WIDEST_USUAL:g}:",
        "",
        "| filter | runs | median | 5 - 95 % |",
        "| --- | ---: | ---: | --- |",
        *against_ckf(runs, names),
        "",
        "Each cell: median steady-state error of the runs that ended, percent, and the runs that did not end well.",
        "",
        f"| step | prior | {labels} |",
        f"| --- | ---: | {' | '.join(['---'] * len(names))} |",
        *cells(runs, names),
    ]
    replace_section("regimes", "\n".join(text), page="studies")
    picture(runs).savefig(_PICTURE, dpi=DPI)


if __name__ == "__main__":
    main()
