"""Write docs/reference.md, the keys that shells complete, and the sizes of usual units, from what the package has.

`python docs/make_reference.py`
"""

import json
import types
import typing
from collections.abc import Iterator
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo
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
LONGEST_EXAMPLE = 40  # characters
# Examples of keys that no shipped file has: `key: example` in each line, by key or by the last part of the key.
WRITTEN = dict(
    line.split(": ", 1) for line in Path(__file__).with_name("reference_examples.txt").read_text("utf-8").splitlines()
)
# Column, unit and size of one count of signals in a log.
SIGNALS = {
    "angular rate": ("yaw_rate", "deg/s", "0.01 deg/s"),
    "specific force": ("acc_x", "g", "0.001 g"),
    "angle": ("heading", "deg", "0.35 deg"),
    "magnetic flux density": ("mag_x", "uT", "0.1 uT"),
    "velocity": ("dvl_x", "cm/s", "1 mm/s"),
    "length": ("depth", "cm", "1 cm"),
    "pure number": ("q_w", "1", "0.0001"),
}
OPENING = """# Reference

You want to change a setting, or to know its unit. Here is every setting with its meaning, unit, default and an example.
It is made by `python docs/make_reference.py` from the tables and settings classes in the package; do not edit.

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


def all_sections() -> dict[type[BaseModel], str]:
    """Return all settings classes of experiments, maps, outlines and campaigns, with the first key of each."""
    found: dict[type[BaseModel], str] = {}
    for whole in (Experiment, LogMap, Outline, Campaign):
        collect("", whole, found)
    return found


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
    kind = type_of(model)
    heading += f" with `type: {kind}`" if kind else ""
    rows = [
        (
            f"`{field.alias or name}`",
            unit(model, name, field),
            limits(field),
            default(field),
            example(path, kind, model, name, field),
            meaning(field),
        )
        for name, field in model.model_fields.items()
        if name != "type"
    ]
    header = "key", "unit or choices", "from ... to", "default", "example", "meaning"
    return f"{heading}\n\n{summary(model)}\n\n" + table(header, rows)


def type_of(model: type[BaseModel]) -> str:
    """Return the `type` that selects a settings class, or an empty text."""
    return typing.get_args(model.model_fields["type"].annotation)[0] if "type" in model.model_fields else ""


def summary(model: type[BaseModel]) -> str:
    """Return the first paragraph of a settings class."""
    return (model.__doc__ or "").split("\n\n")[0].strip()


def meaning(field) -> str:
    """Return the description of a key, or that of its only section, as a sentence."""
    inner = classes(field.annotation)
    text = field.description or ""
    if inner and not text:
        text = summary(inner[0]).split(". ")[0] if len(inner) == 1 else "one of the types below"
    if not text:
        return ""
    # A symbol at the beginning stays as it is.
    first = text.split()[0].rstrip(",;:")
    begin = text[0].upper() if first == "a" or (len(first) > 1 and first.isalpha() and first.islower()) else text[0]
    return f"{begin}{text[1:].removesuffix('.')}."


def example(path: str, kind: str, model: type[BaseModel], name: str, field) -> str:
    """Return an example of a key: from a shipped file, from reference_examples.txt, a choice, or its default."""
    key = f"{path}.{field.alias or name}".lstrip(".")
    shipped = [value for value in (shipped_values().get((kind, key)), shipped_values().get(("", key))) if value]
    if classes(field.annotation):
        return ""
    if shipped:
        return f"`{shipped[0]}`"
    if summary(model).startswith("A signal of ") and name in ("column", "unit", "scale"):
        quantity = summary(model).removeprefix("A signal of ").removesuffix(".").split(";")[0].split(" ", 1)[1]
        return f"`{SIGNALS[quantity][('column', 'unit', 'scale').index(name)]}`"
    if key in WRITTEN:
        return f"`{WRITTEN[key]}`"
    own, given = unit(model, name, field), default(field)
    is_component = issubclass(model, SensorSettings) and typing.get_origin(field.annotation) is tuple
    if is_component and name == "standard_deviation":
        return example(path, kind, model, "noise", model.model_fields["noise"])
    if given not in ("", "required", "0.0") and (
        is_component or any(isinstance(item, Unit) for item in field.metadata)
    ):
        return f"`{f'{given} {own}'.removesuffix(' 1')}`"
    if (field.alias or name) in WRITTEN:
        return f"`{WRITTEN[field.alias or name]}`"
    if typing.get_origin(field.annotation) is typing.Literal:
        return f"`{typing.get_args(field.annotation)[-1]}`"
    if field.annotation is bool:
        return f"`{str(not field.default).lower()}`"
    if isinstance(field.default, tuple) and given:
        return f"`[{given}]`"
    return f"`{given}`" if given not in ("", "required") else ""


@cache
def shipped_values() -> dict[tuple[str, str], str]:
    """Return values in shipped files by type of the section, where it has one, and key."""
    found: dict[tuple[str, str], str] = {}

    def walk(kind: str, path: str, tree: Any) -> None:
        if isinstance(tree, dict):
            own = str(tree.get("type", ""))
            for key, inner in tree.items():
                walk(own, f"{path}.{key}".lstrip("."), inner)
        elif isinstance(tree, list) and any(isinstance(inner, dict) for inner in tree):
            for inner in tree:
                walk(kind, path, inner)
        else:
            text = yaml.safe_dump(tree, default_flow_style=True, width=1000).removesuffix("\n...\n").strip()
            if len(text) <= LONGEST_EXAMPLE:
                found.setdefault((kind, path), text)
                found.setdefault(("", path), text)

    roots = {"vehicles": "vehicle", "sensors": "sensors", "manoeuvres": "manoeuvre"}
    for file in sorted(SHIPPED.rglob("*.yaml")):
        walk("", roots.get(file.parent.name, ""), yaml.safe_load(file.read_text("utf-8")))
    return found


def unit(model: type[BaseModel], name: str, field) -> str:
    """Return the unit or type of a key."""
    for item in field.metadata:
        if isinstance(item, Unit):
            return item.unit
    if issubclass(model, SensorSettings) and typing.get_origin(field.annotation) is tuple:
        if name in ("arm", "position"):
            return "m"
        own = SENSORS[model.sensor][0].unit if model is not SensorSettings else ""
        return f"{own}/s^0.5" if name == "drift" else own
    if classes(field.annotation):
        return "see below"
    return kind_of(field.annotation)


def kind_of(annotation) -> str:
    """Return the unit of an annotation, its choices, or the kind of its values."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in arguments)
    if origin is typing.Annotated:
        return next((item.unit for item in arguments[1:] if isinstance(item, Unit)), "") or kind_of(arguments[0])
    if origin is dict:
        return f"{kind_of(arguments[1])}, by name"
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(kind for kind in map(kind_of, arguments) if kind))
    if origin is tuple:
        return "list"
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return ", ".join(f"`{choice.value}`" for choice in annotation)
    return {int: "integer", float: "number", str: "text", bool: "true or false"}.get(annotation, "")


def limits(field) -> str:
    """Return the range of a number; an amount may also be 0 if that means none."""
    low, high = "", ""
    metadata = [*field.metadata]
    for argument in typing.get_args(field.annotation):
        if typing.get_origin(argument) is typing.Annotated:
            for item in typing.get_args(argument)[1:]:
                metadata += item.metadata if isinstance(item, FieldInfo) else [item]
    for item in metadata:
        if isinstance(item, Unit):
            size = magnitude_of(item.unit)
            low, high = plain(size.smallest if isinstance(item, Amount) else -size.largest), plain(size.largest)
    for item in metadata:
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
