"""auvid identify."""

import typer

from auvid_cli.cli.exit_codes import DONE
from auvid_cli.cli.options import (
    DataArgument,
    DryRunOption,
    FilterOption,
    OutputOption,
    OverwriteOption,
    QuietOption,
    SetOption,
    UseOption,
    VerboseOption,
    dataset_path,
    overrides,
)
from auvid_cli.cli.terminal import Terminal, reporting_errors


def identify(
    source: DataArgument = None,
    filters: FilterOption = None,
    settings: SetOption = None,
    use: UseOption = None,
    output: OutputOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
    dry_run: DryRunOption = False,
) -> None:
    """Estimate coefficients from a dataset into results/NAME/estimates/FILTER.h5."""
    with reporting_errors() as command:
        from auvid_cli.api.files import read_dataset
        from auvid_cli.cli import pipeline
        from auvid_cli.config.load import dump_experiment, find_experiment, load_with_files
        from auvid_cli.data.files import keep_apart
        from auvid_cli.data.replacement import put_copy
        from auvid_cli.data.results import read_simulated
        from auvid_cli.data.results_folder import folder_of_dataset, folder_of_run, locked, products

        changes = overrides(settings, use=use)
        path = dataset_path(source)
        dataset = read_dataset(path, *changes) if path else None
        if dataset:
            experiment, files = dataset.experiment, dataset.experiment.data_files()
        else:
            experiment, files = load_with_files(find_experiment(source), changes)
        if dry_run:
            print(dump_experiment(experiment), end="")
            return
        folder = output or (folder_of_dataset(path) if path else folder_of_run(experiment.name))
        command.enter_context(locked(folder))
        keep_apart(products(folder), files)
        if path and dataset:
            put_copy(path, dataset, folder, files, overwrite)
        dataset = dataset or read_simulated(folder, experiment)
        chosen = experiment.identification.with_judge(filters or experiment.identification.by_default())
        terminal = Terminal(quiet, verbose)
        pipeline.say_doubts(dataset.experiment.vehicle, terminal)
        with terminal.compiling():
            from auvid_cli.api.preparation import prepare
        prepared = pipeline.settle(prepare(dataset), terminal)
        estimates = pipeline.identify_to(folder, prepared, chosen, terminal, overwrite)
        with terminal.compiling():
            from auvid_cli.api.inspection import contradictions_of_unused
            from auvid_cli.api.judgement import judge
            from auvid_cli.report.judgements import contradiction_sentences, judgement_sentences
        judgements = judge(*estimates)
        terminal.say_all(judgement_sentences(judgements, with_sound=True))
        terminal.say_all(contradiction_sentences(contradictions_of_unused(dataset)))
        code = pipeline.exit_code(judgements)
        terminal.say(f"next: auvid report {folder}")
        if code == DONE:
            terminal.say(f"on another run: auvid validate {folder / 'estimates' / chosen[0].value}.h5 OTHER.h5")
        else:
            terminal.say(f"what is wrong, and what to do: auvid check {folder}")
        raise typer.Exit(code)
