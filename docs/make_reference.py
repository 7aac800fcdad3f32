"""Write docs/reference.md, the keys that shells complete, and the sizes of usual units, from what the package has.

`python docs/make_reference.py`
"""

import json
import types
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from auvid_cli.config.campaign import Campaign
from auvid_cli.config.experiment import Experiment
from auvid_cli.config.loading import SECTIONS
from auvid_cli.config.log_map import LogMap
from auvid_cli.config.outline import Outline
from auvid_cli.config.sensors import SensorSettings
from auvid_cli.config.units import EXAMPLES, NUMBER, Amount, Unit, magnitude_of, size_of_unit, with_standard_gravity
from auvid_cli.config.vehicle import VehicleEntry
from auvid_cli.vehicle.coefficients import COEFFICIENTS
from auvid_cli.vehicle.parameters import INPUTS, MOTION, PARAMETERS, POSITION, SENSORS

TARGET = Path(__file__).with_name("reference.md")
# A file next to the code that reads it, because loading the settings classes takes too long for completion.
KEYS = Path(__file__).parents[1] / "auvid_cli/cli/setting_keys.txt"
UNITS = Path(__file__).parents[1] / "auvid_cli/config/usual_units.json"
SHIPPED = Path(__file__).parents[1] / "configs"
OPENING = """# Reference

Made by `python docs/make_reference.py` from the tables and settings classes in the package; do not edit.

"""


def reference() -> str:
    """Return the page."""
    rows = [(c.symbol, c.unit, c.meaning, c.equation, c.group) for c in COEFFICIENTS]
    page = OPENING + "## The 22 coefficients\n\n" + table(("symbol", "unit", "meaning", "enters", "group"), rows)
    for title, quantities in (
        ("Known parameters", PARAMETERS),
        ("Motion states", MOTION),
        ("Position", POSITION),
        ("Inputs", INPUTS),
    ):
        page += f"\n## {title}\n\n" + table(("symbol", "unit", "meaning", "where"), quantities)
    page += "\n## Settings\n\nA bare number is in the unit given here; any unit of the same dimension may be written. "
    page += "Lists of components have the limits of their unit, and so have the numbers of a vehicle:\n\n"
    units = dict.fromkeys(q.unit for q in (*PARAMETERS, *COEFFICIENTS)) | dict.fromkeys(
        q.unit for q in (*MOTION, *INPUTS)
    )
    page += table(
        ("unit", "least amount that is not 0", "largest size"), [(u, *map(plain, magnitude_of(u))) for u in units]
    )
    found: dict[type[BaseModel], str] = {}
    collect("", Experiment, found)
    page += "".join(section(path, model) for model, path in found.items())
    page += "\n## The map of a log\n\nFor `auvid import`; `vehicle` and `identification` are those of an experiment.\n"
    known = set(found)
    collect("", LogMap, found)
    page += "".join(section(path, model) for model, path in found.items() if model not in known)
    page += "\n## The options of `auvid init`\n"
    page += section("", Outline)
    page += "\n## A campaign's file\n\nFor `auvid campaign`; dotted keys are those of an experiment.\n"
    campaign: dict[type[BaseModel], str] = {}
    collect("", Campaign, campaign)
    return page + "".join(section(path, model) for model, path in campaign.items())


def setting_keys() -> str:
    """Return the keys of an experiment, one per line, without keys that a shell would misread."""
    keys = {*SECTIONS, *leaves("", Experiment)}
    return "".join(f"{key}\n" for key in sorted(keys) if "|" not in key)


def usual_units() -> str:
    """Return the sizes, by pint, of units in shipped files and of SI units, one per line."""
    texts = [text for path in SHIPPED.rglob("*.yaml") for text in words(yaml.safe_load(path.read_text("utf-8")))]
    written = {unit for _, example in EXAMPLES.values() for unit in unit_of(example)}
    written |= {unit for text in texts for unit in unit_of(text)}
    written |= {*EXAMPLES, *(quantity.unit for quantity in (*PARAMETERS, *COEFFICIENTS, *MOTION, *INPUTS))}
    units = sorted(written | {with_standard_gravity(unit) for unit in written})
    sizes = {unit: size_of_unit(unit) for unit in units if unit not in {"1", "%"}}
    return "{\n" + ",\n".join(f"{json.dumps(unit)}: {json.dumps(size)}" for unit, size in sizes.items()) + "\n}\n"


def words(tree: Any) -> Iterator[str]:
    """Yield the texts in a settings file."""
    if isinstance(tree, dict | list):
        for inner in tree.values() if isinstance(tree, dict) else tree:
            yield from words(inner)
    elif isinstance(tree, str):
        yield tree


def unit_of(text: str) -> Iterator[str]:
    """Yield the unit of a quantity, if it has one."""
    number = NUMBER.match(text)
    if number and (unit := text[number.end() :].strip()):
        try:
            size_of_unit(unit)
        except ValueError:
            return
        yield unit


def leaves(path: str, model: type[BaseModel]):
    """Yield the keys below a settings class that take a value; entries of a list or a mapping have none."""
    for name, field in model.model_fields.items():
        key = f"{path}.{field.alias or name}".lstrip(".")
        inner = sections(field.annotation)
        if not inner:
            yield key
        for each in inner:
            yield from leaves(key, each)


def sections(annotation) -> list[type[BaseModel]]:
    """List the settings classes that a key may be a section of; a vehicle's entry is a value."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [] if issubclass(annotation, VehicleEntry) else [annotation]
    if typing.get_origin(annotation) in (tuple, dict):
        return []
    return [model for argument in typing.get_args(annotation) for model in sections(argument)]


def table(header, rows) -> str:
    """Write a Markdown table."""
    cells = [header, ["---"] * len(header), *rows]
    return "".join("| " + " | ".join(str(c).replace("|", "\\|") for c in row) + " |\n" for row in cells)


def collect(path: str, model: type[BaseModel], found: dict[type[BaseModel], str]) -> None:
    """Collect all settings classes reachable from one, with the first key of each."""
    if model in found:
        return
    found[model] = path
    for name, field in model.model_fields.items():
        for inner in classes(field.annotation):
            collect(f"{path}.{field.alias or name}".lstrip("."), inner, found)


def classes(annotation) -> list[type[BaseModel]]:
    """List the settings classes named in an annotation, other than entries of the vehicle tables."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [] if annotation.__name__ in ("ParameterTable", "CoefficientTable") else [annotation]
    return [c for argument in typing.get_args(annotation) for c in classes(argument)]


def section(path: str, model: type[BaseModel]) -> str:
    """Write the section of one settings class."""
    wholes = {LogMap: "A map", Outline: "An outline", Campaign: "A campaign", Experiment: "An experiment"}
    heading = f"\n### `{path}`" if path else f"\n### {wholes[model]}"
    kind = typing.get_args(model.model_fields["type"].annotation)[0] if "type" in model.model_fields else ""
    heading += f" with `type: {kind}`" if kind else ""
    rows = [
        (f"`{field.alias or name}`", unit(model, name, field), limits(field), default(field), field.description or "")
        for name, field in model.model_fields.items()
        if name != "type"
    ]
    summary = (model.__doc__ or "").split("\n\n")[0].strip()
    return f"{heading}\n\n{summary}\n\n" + table(("key", "unit or choices", "from ... to", "default", "meaning"), rows)


def unit(model: type[BaseModel], name: str, field) -> str:
    """Return the unit or type of a key."""
    for item in field.metadata:
        if isinstance(item, Unit):
            return item.unit
    if issubclass(model, SensorSettings) and typing.get_origin(field.annotation) is tuple:
        own = SENSORS[model.sensor][0].unit if model is not SensorSettings else ""
        return f"{own}/s^0.5" if name == "drift" else own
    if typing.get_origin(field.annotation) is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in typing.get_args(field.annotation))
    if isinstance(field.annotation, type) and field.annotation in (int, float, str, bool):
        return {int: "integer", float: "number", str: "text", bool: "true or false"}[field.annotation]
    if classes(field.annotation):
        return "see below"
    return "list" if "tuple" in str(field.annotation) and typing.get_origin(field.annotation) is not dict else ""


def limits(field) -> str:
    """Return the range of a number; an amount may also be 0 if that means none."""
    low, high = "", ""
    for item in field.metadata:
        if isinstance(item, Unit):
            size = magnitude_of(item.unit)
            low, high = plain(size.smallest if isinstance(item, Amount) else -size.largest), plain(size.largest)
    for item in field.metadata:
        least = next(
            (limit for limit in (getattr(item, "ge", None), getattr(item, "gt", None)) if limit is not None), None
        )
        most = next(
            (limit for limit in (getattr(item, "le", None), getattr(item, "lt", None)) if limit is not None), None
        )
        if getattr(item, "ge", None) == 0 and low:
            low = f"0, {low}"
        elif least is not None and not (least == 0 and low):
            low = plain(least)
        high = plain(most) if most is not None else high
    return f"{low} ... {high}".strip() if low or high else ""


def plain(number: float) -> str:
    """Write a limit, short."""
    return f"{number:g}"


def default(field) -> str:
    """Return the default of a key."""
    if field.is_required():
        return "required"
    value = field.default
    if value is PydanticUndefined or value is None or value == () or isinstance(value, BaseModel | types.NoneType):
        return ""
    if isinstance(value, tuple):
        return ", ".join(str(v) for v in value)
    return str(value)


if __name__ == "__main__":
    TARGET.write_text(reference(), encoding="utf-8")
    KEYS.write_text(setting_keys(), encoding="utf-8")
    UNITS.write_text(usual_units(), encoding="utf-8")
