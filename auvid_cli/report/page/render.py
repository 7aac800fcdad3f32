"""A page as one HTML file that needs no other."""

import base64
import json
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from auvid_cli import __version__
from auvid_cli.printable import one_line, printable, printable_lines
from auvid_cli.report.page.cells import heading_rows, shown, symbol_parts, with_code, with_symbols, with_ties
from auvid_cli.report.page.packed import PackedArrays
from auvid_cli.report.page.parts import Page, Part, PlotLine, Plots, Section, Space

_STYLES = ("uPlot.min.css", "page.css")
_SCRIPTS = ("uPlot.iife.min.js", "plots.js", "space.js", "tables.js")
# Of what may end a script or begin markup; JSON and JavaScript read these back.
_UNSAFE = str.maketrans({"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"})
# Classes of correlations from -1 to 1: tenths.
_SHADES = 10


class _Block(NamedTuple):
    """A part with the name of what draws it, and a key that is its own."""

    kind: str
    key: str
    part: Part


def render_page(page: Page) -> str:
    """Render a page; every text that it is handed stays text."""
    sections = [section for section in page.sections if section.parts]
    blocks = {section.key: _blocks(section) for section in sections}
    styles, scripts = _assets(_STYLES), _assets(_SCRIPTS)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            page=page,
            sections=sections,
            blocks=blocks,
            version=__version__,
            licence=_asset("uPlot.LICENSE.txt"),
            policy=_policy(styles, scripts),
            styles=[Markup(text) for text in styles],
            scripts=[Markup(text) for text in scripts],
            data=Markup(_data([block for of_section in blocks.values() for block in of_section])),
        )
    )


def _blocks(section: Section) -> list[_Block]:
    return [
        _Block(type(part).__name__.lower(), f"{section.key}-{place}", part) for place, part in enumerate(section.parts)
    ]


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Return the policy that allows what the page brings along, by its hash, and no network, other script or form."""
    scripted, styled = (" ".join(map(_hash, texts)) for texts in (scripts, styles))
    return f"default-src 'none'; script-src {scripted}; style-src {styled}; base-uri 'none'; form-action 'none'"


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(sha256(text.encode()).digest()).decode('ascii')}'"


def _assets(names: Sequence[str]) -> list[str]:
    return [_asset(name) for name in names]


@cache
def _asset(name: str) -> str:
    return files("auvid_cli.report.page").joinpath("static", name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("auvid_cli.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "cell": shown,
        "heading_rows": heading_rows,
        "symbol": symbol_parts,
        "with_code": with_code,
        "with_symbols": with_symbols,
        "line": one_line,
        "with_ties": with_ties,
        "lines": printable_lines,
        "shade": _shade,
        "hundredths": _hundredths,
    }
    return environment


def _shade(correlation: float) -> str:
    """Return the class of a correlation's colour."""
    if correlation != correlation:
        return "r-none"
    tenths = round(_SHADES * min(max(correlation, -1.0), 1.0))
    return f"r{'-' if tenths < 0 else ''}{abs(tenths)}"


def _hundredths(correlation: float) -> str:
    """Write a correlation with its sign, which one that is rounded to zero has not."""
    if correlation != correlation:
        return "·"
    whole = round(100.0 * correlation)
    return f"{whole:+d}" if whole else "0"


def _data(blocks: Sequence[_Block]) -> str:
    """Return what scripts draw, as JSON that cannot end the element that it stands in."""
    arrays = PackedArrays()
    groups: dict[str, Any] = {}
    spaces: dict[str, Any] = {}
    for block in blocks:
        match block.part:
            case Plots() as plots:
                groups[block.key] = _plots(plots, arrays)
            case Space() as space:
                spaces[block.key] = [
                    {
                        "label": printable(track.label),
                        "look": track.look,
                        "at": [arrays.add(x) for x in track.position.T],
                    }
                    for track in space.tracks
                ]
    data = {"groups": groups, "spaces": spaces, "arrays": arrays.texts}
    return json.dumps(data, separators=(",", ":"), allow_nan=False).translate(_UNSAFE)


def _plots(plots: Plots, arrays: PackedArrays) -> dict[str, Any]:
    return {
        "linked": plots.linked,
        "choice": bool(plots.choice),
        "plots": [
            {
                "unit": plot.unit,
                "x": plot.x_label,
                "logX": plot.log_x,
                "logY": plot.log_y,
                "limits": plot.limits,
                "marks": [[float(f"{time:.8g}") for time in mark] for mark in plot.marks],
                "lines": [_line(line, arrays) for line in plot.lines],
            }
            for plot in plots.plots
        ],
    }


def _line(line: PlotLine, arrays: PackedArrays) -> dict[str, Any]:
    # Told from a round time near the first, what is left has all its fractions in seven digits.
    origin = float(round(float(line.time[0]))) if line.time.size else 0.0
    return {
        "label": printable(line.label),
        "look": line.look,
        "kind": line.kind,
        "of": line.of,
        "key": printable(line.key),
        "from": origin,
        "t": arrays.add(line.time - origin),
        "v": arrays.add(line.values),
    }
