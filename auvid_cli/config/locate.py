"""Validation errors of pydantic as plain messages with their positions in the files."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from types import UnionType
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from auvid_cli.config.source_positions import KeyPath, Mistake, Position, Tree
from auvid_cli.config.units import Unit, describe, expected

LIMITS = {
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "literal_error": "expected {expected}",
    "enum": "expected {expected}",
    "string_pattern_mismatch": "must match {pattern}",
    "too_short": "expected at least {min_length} of them",
}
# Expected values by the first word of the error type of pydantic.
_EXPECTED = {
    "string": "text",
    "int": "a whole number",
    "float": "a number",
    "finite": "a finite number",
    "bool": "true or false",
    "tuple": "a list",
    "list": "a list",
    "dict": "a mapping",
}


class _Place(NamedTuple):
    """Location of an error: path in the settings, enclosing settings class and field, expected type."""

    path: KeyPath
    holder: type[BaseModel] | None
    field: FieldInfo | None
    annotation: Any
    in_union: bool

    @property
    def models(self) -> list[type[BaseModel]]:
        """Return the settings classes that are expected."""
        return _models(self.annotation)

    @property
    def tags(self) -> dict[str, type[BaseModel]]:
        """Return the classes of a discriminated union by their tag; empty for another type."""
        if self.field is None or not isinstance(self.field.discriminator, str) or len(self.models) < 2:
            return {}
        name = self.field.discriminator
        return {tag: model for model in self.models for tag in get_args(model.model_fields[name].annotation)}


def locate(error: ValidationError, model: type[BaseModel], tree: Tree) -> list[Mistake]:
    """Return the errors of validating `tree.data` with `model`, each at its position, in the order of the fields."""
    details = error.errors(include_url=False)
    places = [_follow(model, detail["loc"]) for detail in details]
    paths = [place.path for place in places if place.in_union]
    mistakes: dict[tuple[KeyPath, str], Mistake] = {}
    for detail, place in zip(details, places, strict=True):
        n = len(place.path)
        if place.in_union and any(len(path) > n and path[:n] == place.path for path in paths):
            continue  # another branch of the union matched further
        mistake = _mistake(detail, place, tree)
        mistakes.setdefault((mistake.path, mistake.message), mistake)
    return list(mistakes.values())


def _follow(model: type[BaseModel], location: Iterable[str | int]) -> _Place:
    """Follow an error's location through the settings classes, without labels of unions, which are not keys."""
    place = _Place((), None, None, model, False)
    for part in location:
        origin, models = get_origin(place.annotation), place.models
        if isinstance(part, int) and origin in (tuple, list):
            inner = get_args(place.annotation)[0]
            place = place._replace(path=(*place.path, part), holder=None, annotation=inner)
        elif place.tags:
            place = place._replace(annotation=place.tags.get(str(part)), in_union=False)
        elif not models and isinstance(part, str) and origin in (Union, UnionType):
            place = place._replace(in_union=True)
        else:
            holder = models[0] if models else None
            field = _fields(holder).get(str(part)) if holder else None
            annotation = field.annotation if field else None
            place = _Place((*place.path, part), holder, field, annotation, place.in_union)
    return place


def _models(annotation: Any) -> list[type[BaseModel]]:
    """Return the settings classes that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return [model for argument in get_args(annotation) for model in _models(argument)]
    return []


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _mistake(detail: ErrorDetails, place: _Place, tree: Tree) -> Mistake:
    context, path = detail.get("ctx", {}), place.path
    match detail["type"]:
        case "missing":
            return _at_mapping(tree, path[:-1], f"missing key {str(path[-1])!r}{_meaning(place.field)}")
        case "union_tag_not_found":
            return _at_mapping(tree, path, f"missing key {context['discriminator']}: one of {', '.join(place.tags)}")
        case "union_tag_invalid" if place.field:
            tag = str(context["tag"])
            hint = _did_you_mean(tag, tuple(place.tags), "one of")
            return at_value(tree, (*path, str(place.field.discriminator)), f"{tag!r} is not a {path[-1]}{hint}")
        case "extra_forbidden" if place.holder:
            key = str(path[-1])
            *_, mapping, node = tree.descend(path)
            changed = _changed_kind(mapping) if node.at.source == mapping.at.source else None
            hint = _did_you_mean(key, tuple(_fields(place.holder)), "known keys:")
            return Mistake(changed or node.key_at or node.at, path, f"unknown key {key!r}{hint}")
        case "value_error":
            return at_value(tree, path, str(context["error"]))
    *_, node = tree.descend(path)
    return at_value(tree, path, f"{_expectation(detail, place)}, got {describe(node.data)}")


def _at_mapping(tree: Tree, path: KeyPath, message: str) -> Mistake:
    *_, node = tree.descend(path)
    return Mistake(_changed_kind(node) or node.heading, path, message)


def _changed_kind(mapping: Tree) -> Position | None:
    """Return the position of a `type` from another source, which changes the expected keys; None without one."""
    kind = mapping.child("type")
    return None if kind is None or kind.at.source == mapping.at.source else kind.at


def at_value(tree: Tree, path: KeyPath, message: str) -> Mistake:
    """Return a mistake at a value, or at the nearest enclosing one if a short form omits the path."""
    nodes = list(tree.descend(path))
    node = nodes[-1]
    at = node.heading if isinstance(node.content, dict) else node.at
    return Mistake(at, path[: len(nodes) - 1], message)


def _expectation(detail: ErrorDetails, place: _Place) -> str:
    kind, context = detail["type"], detail.get("ctx", {})
    if place.in_union and place.field and place.field.description:
        return f"expected {place.field.description}"
    if kind in LIMITS:
        unit = _unit(place.field) if any(isinstance(limit, int | float) and limit for limit in context.values()) else ""
        return f"{LIMITS[kind].format(**context)} {unit}".strip()
    if place.models and kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"expected {_mapping_like(place.models[0]) if len(place.models) == 1 else 'a mapping'}"
    stem = kind.split("_")[0]
    return f"expected {_EXPECTED[stem]}" if stem in _EXPECTED else detail["msg"][:1].lower() + detail["msg"][1:]


def _meaning(field: FieldInfo | None) -> str:
    """Return the meaning and an example of a key, if its field has them."""
    if field is None:
        return ""
    models = _models(field.annotation)
    example = expected(unit) if (unit := _unit(field)) else _mapping_like(models[0]) if len(models) == 1 else ""
    return (f" ({field.description})" if field.description else "") + (f": {example}" if example else "")


def _unit(field: FieldInfo | None) -> str:
    """Return the SI unit of a field, or of the `value` of the entry that it holds; empty if it has none."""
    if field is None:
        return ""
    models = _models(field.annotation)
    field = models[0].model_fields.get("value", field) if models else field
    return next((item.unit for item in field.metadata if isinstance(item, Unit)), "")


def _mapping_like(model: type[BaseModel]) -> str:
    needed = [name for name, field in _fields(model).items() if field.is_required()] or list(_fields(model))
    return f"a mapping with the {'key' if len(needed) == 1 else 'keys'} {', '.join(needed)}"


def _did_you_mean(word: str, known: Sequence[str], otherwise: str) -> str:
    near = get_close_matches(word, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; {otherwise} {', '.join(known)}"
