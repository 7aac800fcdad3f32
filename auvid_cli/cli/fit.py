"""auvid fit: from a dataset to a model that holds."""

import shlex
from typing import Annotated

from auvid_cli.cli import options
from auvid_cli.cli.streams import DONE, VERDICT_FAILED
from auvid_cli.errors import ConfigError

_ONLY = "Kinds of additions that may be tried, such as current,gyro; see docs/how-to/fit.md. Default: all."
_NOT = "Kinds of additions that may not be tried, such as disturbance,term."
_TIME = "Processor time after which the search ends with the best model so far, such as '5 min'. Default: no limit."


@options.command
def fit(
    *,
    dataset: options.DatasetArgument,
    only: Annotated[str | None, options.optional("KINDS", _ONLY)] = None,
    excluded: Annotated[str | None, options.optional("KINDS", _NOT, "--not")] = None,
    max_time: Annotated[str | None, options.optional("QUANTITY", _TIME)] = None,
    settings: options.SettingOptions,
    output: options.OutputOptions,
    console: options.TerminalOptions,
) -> int:
    """Find a model that explains a dataset, and show every decision; exit code 1 if the model is not sound.

    The settings of the dataset are the first model. If it does not hold, the process noise is found from the data, and
    errors, delays, noise, a disturbance or terms are added one at a time, each only if the data support it. Ctrl-C
    ends the search and keeps the best model. The settings are written to fit.yaml; `auvid identify --set fit.yaml`
    repeats the estimate.
    """
    options.refuse_log(dataset)
    changes, terminal = settings.overrides(), console.terminal()
    limit = float("inf") if max_time is None else _seconds(max_time)
    with terminal.compiling():
        from auvid_cli.api.files import RecordedData, read_dataset
        from auvid_cli.api.fit import fit_into
        from auvid_cli.report.screens import fit_sentences

    source = RecordedData(dataset, read_dataset(dataset, *changes))
    result = fit_into(output.destination(terminal), source, _kinds(only), _kinds(excluded), limit)
    for sentence in fit_sentences(result.fit):
        terminal.print_wrapped(sentence)
    terminal.print_lines([*result.files, result.page])
    terminal.print(f"next: auvid report {shlex.quote(str(result.folder))}")
    return DONE if result.fit.is_sound else VERDICT_FAILED


def _kinds(text: str | None) -> list[str]:
    return [] if text is None else [kind.strip() for kind in text.split(",") if kind.strip()]


def _seconds(text: str) -> float:
    from auvid_cli.config.units import parse_quantity

    try:
        value = parse_quantity(text, "s")
    except ValueError as error:
        raise ConfigError(f"--max-time: {error}") from None
    if not value > 0.0:
        raise ConfigError(f"--max-time {text}: must be larger than 0 s")
    return value
