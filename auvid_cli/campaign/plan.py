"""Plan of a campaign: the data to simulate, the filters to run on them, and the settings that filters assume."""

import hashlib
import json
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import groupby, product
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from auvid_cli._version import __version__
from auvid_cli.campaign.measures import Measure
from auvid_cli.config.campaign import Campaign, FilterVariant, Label, Option, axis_options, changes_in
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import (
    Change,
    assemble,
    find_experiment,
    given_settings,
    open_source,
    validated,
    with_changes,
)
from auvid_cli.config.source_positions import Mistake, Tree, mistakes_text
from auvid_cli.data.netcdf import digest
from auvid_cli.errors import ConfigError

# Limited, because the settings of each combination are kept in memory.
MAX_COMBINATIONS = 10_000
# Limited, because the identity of each run is kept in memory.
MAX_RUNS = 1_000_000
# Runs that a worker performs on the same data; few, so that little work is lost if the worker dies.
MAX_GROUP = 6
_IDENTITY_LENGTH = 24  # hexadecimal digits, 96 bits


class CampaignRun(NamedTuple):
    """One filter on one set of data."""

    identity: str  # hash of the resolved settings of data and filter, the seed, and auvid's version
    labels: dict[str, Label]  # values of the axes of the campaign, by column
    filter: str  # name of the variant
    seed: int
    is_fit: bool = False  # whether a model is searched for

    def settings(self) -> str:
        """Return the values of the axes as text."""
        return ", ".join(f"{column} = {label}" for column, label in self.labels.items())


class RunGroup(NamedTuple):
    """Runs on the same data."""

    simulated: str  # experiment of the data, as JSON
    runs: list[CampaignRun]
    # Experiment that the filter of each run assumes, as JSON; its identification has only that filter
    assumed: list[str]
    version: str = __version__  # version of auvid; workers must have the same


class _Resolved(NamedTuple):
    """Settings of one combination for any seed."""

    labels: dict[str, Label]
    simulated: dict[str, Any]  # settings of the data
    data: str  # hash of `simulated`
    assumed: list[tuple[dict[str, Any], str]]  # settings that each filter assumes, and their hash


_SeededOption: TypeAlias = Callable[[int], Option]
_Triple: TypeAlias = tuple[_Resolved, dict[str, Any], CampaignRun]


class CampaignPlan:
    """All runs of a campaign.

    Parameters
    ----------
    tree : Tree
        The campaign file, with positions.
    path : pathlib.Path
        Path of the campaign file.

    Raises
    ------
    ConfigError
        With all mistakes in the settings of the options and their positions, or if there are too many runs.
    """

    def __init__(self, campaign: Campaign, tree: Tree, path: Path) -> None:
        self.campaign = campaign
        self._tree = tree
        self._path = path
        neighbour = path.parent / campaign.experiment
        is_own = os.path.lexists(neighbour) and not neighbour.is_dir()
        try:
            source = open_source(neighbour if is_own else find_experiment(campaign.experiment))
        except ConfigError as error:
            at = tree.child("experiment") or tree
            raise ConfigError(mistakes_text([Mistake(at.at, ("experiment",), str(error))])) from None
        self._base, self._folder = assemble(source), source.folder
        experiment = self._experiment([])
        # By default the filters of the experiment.
        self.filters = campaign.filters or tuple(
            FilterVariant(filter=name, name=name.value) for name in experiment.identification.filters
        )
        settings, axes = given_settings(experiment), tree.child("vary")
        written = axes.content if axes is not None else []
        taken = [
            Mistake(place.at, ("vary", k), f"results have a column {axis.column!r} already; give it another `name`")
            for k, (axis, place) in enumerate(zip(campaign.vary, written, strict=True))
            if axis.column in Measure._fields
        ]
        if taken:
            raise ConfigError(mistakes_text(taken))
        self._refuse_too_many()
        axes = [axis_options(*pair, settings) for pair in zip(campaign.vary, written, strict=True)]
        self._cells = list(product(*axes))
        self._fixed: list[_Resolved] = []
        seed = campaign.seed_list[0]
        _refuse_twins(path, self._runs(_all_or_errors(self._resolve, _one_at_a_time(axes)), seed))

    @property
    def columns(self) -> dict[str, bool]:
        """Return the columns of the axes in order, and whether their values are numbers."""
        return {axis.column: axis.draw is not None or _are_numbers(axis.values) for axis in self.campaign.vary}

    @property
    def fixed_columns(self) -> list[str]:
        """Return the columns of the axes that are not drawn for each seed."""
        return [axis.column for axis in self.campaign.vary if not axis.is_drawn]

    @property
    def drawn_columns(self) -> list[str]:
        """Return the columns of the axes that are drawn for each seed."""
        return [axis.column for axis in self.campaign.vary if axis.is_drawn]

    @property
    def n_runs(self) -> int:
        """Return the number of runs."""
        return self.campaign.n_cells * len(self.filters) * self.campaign.n_seeds

    def examples(self, most: int) -> Iterator[RunGroup]:
        """Yield the groups of the first seed for at most `most` evenly spaced combinations."""
        seed = self.campaign.seed_list[0]
        for cell in self._cells[:: -(-len(self._cells) // most)]:
            yield _group(list(self._runs([self._resolve(cell)], seed)), seed)

    def groups(self, done: Collection[str] = ()) -> Iterator[RunGroup]:
        """Yield the groups of all runs that are not `done`, seed by seed."""
        for seed in self.campaign.seed_list:
            pending = [triple for triple in self._of_seed(seed) if triple[2].identity not in done]
            pending.sort(key=lambda triple: triple[0].data)
            for _, same in groupby(pending, key=lambda triple: triple[0].data):
                triples = list(same)
                for k in range(0, len(triples), MAX_GROUP):
                    yield _group(triples[k : k + MAX_GROUP], seed)

    def labels(self) -> dict[str, dict[str, Label]]:
        """Return filter and axes of each run by its identity.

        Raises
        ------
        ConfigError
            If a combination of settings is not valid, or two runs are the same.
        """
        labels: dict[str, dict[str, Label]] = {}
        for seed in self.campaign.seed_list:
            triples = list(self._of_seed(seed))
            _refuse_twins(self._path, triples)
            labels |= {run.identity: {"filter": run.filter, **run.labels} for *_, run in triples}
        return labels

    def _refuse_too_many(self) -> None:
        """Raise a ConfigError before the combinations fill the memory."""
        cells, runs = self.campaign.n_cells, self.n_runs
        if cells > MAX_COMBINATIONS or runs > MAX_RUNS:
            message = (
                f"{runs:,} runs, of {cells:,} combinations of settings, {len(self.filters)} filters and "
                f"{self.campaign.n_seeds:,} seeds, are too many; expected at most {MAX_RUNS:,} runs and "
                f"{MAX_COMBINATIONS:,} combinations; split the campaign"
            )
            raise ConfigError(mistakes_text([Mistake(self._tree.at, (), message)]))

    def _of_seed(self, seed: int) -> Iterator[_Triple]:
        if any(axis.is_drawn for axis in self.campaign.vary):
            return self._runs((self._resolve(cell, seed) for cell in self._cells), seed)
        # Without draws a combination is the same for all seeds.
        self._fixed = self._fixed or _all_or_errors(self._resolve, self._cells)
        return self._runs(self._fixed, seed)

    def _runs(self, cells: Iterable[_Resolved], seed: int) -> Iterator[_Triple]:
        for cell in cells:
            for variant, (assumed, key) in zip(self.filters, cell.assumed, strict=True):
                # Without the name of the variant: equal settings are the same run under any name.
                identity = _hash(__version__, cell.data, key, seed, *(["fit"] if variant.fit else []))
                yield cell, assumed, CampaignRun(identity, cell.labels, variant.name, seed, variant.fit)

    def _resolve(self, cell: tuple[_SeededOption, ...], seed: int | None = None) -> _Resolved:
        options = [option(self.campaign.seed_list[0] if seed is None else seed) for option in cell]
        known = [change for option in options if option.known for change in option.changes]
        labels = dict(zip(self.columns, (option.label for option in options), strict=True))
        data = given_settings(self._experiment([change for option in options for change in option.changes]))
        sections = (data[section] for section in ("vehicle", "sensors", "manoeuvre"))
        assumed = [given_settings(self._assumed(k, known)) for k in range(len(self.filters))]
        return _Resolved(
            labels,
            data,
            _hash(*sections, _digest(data["manoeuvre"], "file")),
            [(settings, _hash_of_assumed(settings)) for settings in assumed],
        )

    def _assumed(self, variant: int, known: list[Change]) -> Experiment:
        *_, written = self._tree.descend(("filters", variant, "settings"))
        changes = changes_in(written) if self.filters[variant].settings else []
        experiment, name = self._experiment([*known, *changes]), self.filters[variant].filter
        experiment.identification.check_filters([name])
        return experiment.with_identification(filters=(name,))

    def _experiment(self, changes: list[Change]) -> Experiment:
        base, mistakes = self._base
        common = changes_in(self._tree.child("settings"))
        tree, further_mistakes = with_changes(base, [*common, *changes], self._folder)
        return validated(Experiment, tree, [*mistakes, *further_mistakes])


def _are_numbers(values: Sequence[Any] | None) -> bool:
    return values is not None and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def _one_at_a_time(axes: Sequence[Sequence[_SeededOption]]) -> list[tuple[_SeededOption, ...]]:
    """Return combinations that contain each option of each axis: the sum of the options, not their product."""
    first = tuple(axis[0] for axis in axes)
    return [first, *((*first[:k], other, *first[k + 1 :]) for k, axis in enumerate(axes) for other in axis[1:])]


def _group(triples: Sequence[_Triple], seed: int) -> RunGroup:
    cells, assumed, runs = zip(*triples, strict=True)
    return RunGroup(_text(cells[0].simulated, seed), list(runs), [_text(settings, seed) for settings in assumed])


def _refuse_twins(path: Path, triples: Iterable[_Triple]) -> None:
    """Raise a ConfigError if two runs of a seed are the same, and would be counted twice."""
    by_identity: dict[str, CampaignRun] = {}
    for *_, run in triples:
        twin = by_identity.setdefault(run.identity, run)
        if twin is not run:
            first, second = (f"{same.filter} with {same.settings() or 'the same settings'}" for same in (twin, run))
            raise ConfigError(f"{path}: two runs of the campaign are the same: {first}, and {second}; remove one")


def _hash(*settings: Any) -> str:
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:_IDENTITY_LENGTH]


def _hash_of_assumed(settings: dict[str, Any]) -> str:
    prior = settings["identification"].get("prior", {})
    sections = (settings[section] for section in ("vehicle", "sensors", "identification"))
    return _hash(*sections, _digest(prior, "from_estimate"))


def _digest(settings: dict[str, Any], key: str) -> str:
    """Return the hash of the file that a setting names: another content is another run."""
    return digest(Path(settings[key])) if key in settings else ""


def _text(experiment: dict[str, Any], seed: int) -> str:
    return json.dumps(experiment | {"seed": seed})


def _all_or_errors(
    resolve: Callable[[tuple[_SeededOption, ...]], _Resolved],
    cells: list[tuple[_SeededOption, ...]],
) -> list[_Resolved]:
    """Resolve every combination, or raise one ConfigError with the mistakes of all."""
    resolved, errors = [], {}
    for cell in cells:
        try:
            resolved.append(resolve(cell))
        except ConfigError as error:
            errors[str(error)] = None
    if errors:
        raise ConfigError("\n".join(errors))
    return resolved
