"""Validation errors of pydantic to mistakes in plain words, at their place in the files."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from auvid_cli.config.position import KeyPath, Mistake, Position
from auvid_cli.config.quantity import Unit, describe, expected
from auvid_cli.config.tree import Tree

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
_KINDS = {
    "string": "text",
    "int": "a whole number",
    "float": "a number",
    "finite": "a finite number",
    "bool": "true or false",
    "tuple": "a list",
    "list": "a list",
    "dict": "a mapping",
}


@dataclass(frozen=True)
class _Place:
    """What the location of an error means: a path of the settings, and what is expected there."""

    path: KeyPath
    holder: type[BaseModel] | None
    field: FieldInfo | None
    annotation: Any
    in_union: bool


def locate(error: ValidationError, model: type[BaseModel], tree: Tree) -> list[Mistake]:
    """Say each error of a validation in plain words and point at its place.

    Parameters
    ----------
    error : pydantic.ValidationError
        From validating ``tree.data``.
    model : type
        The settings class that was validated.
    tree : Tree
        The settings as they were read.

    Returns
    -------
    list of Mistake
        In the order of the fields.
    """
    details = error.errors(include_url=False)
    places = [_follow(model, detail["loc"]) for detail in details]
    paths = [place.path for place in places if place.in_union]
    mistakes: dict[tuple[KeyPath, str], Mistake] = {}
    for detail, place in zip(details, places, strict=True):
        if place.in_union and any(len(path) > len(place.path) and _within(path, place.path) for path in paths):
            continue  # another branch of the union fits better: it failed further down
        mistake = _mistake(detail, place, tree)
        mistakes.setdefault((mistake.path, mistake.message), mistake)
    return list(mistakes.values())


def _within(path: KeyPath, outer: KeyPath) -> bool:
    return path[: len(outer)] == outer


def _follow(model: type[BaseModel], location: Iterable[str | int]) -> _Place:
    """Walk the settings classes along an error's location, past labels of unions, which are no keys."""
    annotation: Any = model
    place = _Place((), None, None, model, False)
    for part in location:
        if isinstance(part, int) and get_origin(annotation) in (tuple, list):
            annotation = get_args(annotation)[0]
            place = _Place((*place.path, part), None, place.field, annotation, place.in_union)
            continue
        models = _models(annotation)
        tagged = _by_tag(place.field, models)
        if tagged:
            annotation = tagged.get(str(part))
            place = _Place(place.path, place.holder, place.field, annotation, False)
            continue
        if not models and isinstance(part, str) and get_origin(annotation) in (Union, UnionType):
            place = _Place(place.path, place.holder, place.field, annotation, True)
            continue
        holder = models[0] if models else None
        field = _fields(holder).get(str(part)) if holder else None
        annotation = field.annotation if field else None
        place = _Place((*place.path, part), holder, field, annotation, place.in_union)
    return place


def _models(annotation: Any) -> list[type[BaseModel]]:
    """List the settings classes that an annotation allows."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, UnionType, Annotated):
        return [model for argument in get_args(annotation) for model in _models(argument)]
    return []


def _by_tag(field: FieldInfo | None, models: list[type[BaseModel]]) -> dict[str, type[BaseModel]]:
    """Return the classes of a discriminated union by their tag; none of another type."""
    if field is None or not isinstance(field.discriminator, str) or len(models) < 2:
        return {}
    name = field.discriminator
    return {tag: model for model in models for tag in get_args(model.model_fields[name].annotation)}


def _fields(model: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _mistake(detail: ErrorDetails, place: _Place, tree: Tree) -> Mistake:
    context = detail.get("ctx", {})
    kind = detail["type"]
    if kind == "missing":
        return _at_mapping(tree, place.path[:-1], f"missing key {str(place.path[-1])!r}{_meaning(place.field)}")
    if kind == "union_tag_not_found":
        tags = _by_tag(place.field, _models(place.annotation))
        return _at_mapping(tree, place.path, f"missing key {context['discriminator']}: one of {', '.join(tags)}")
    if kind == "union_tag_invalid" and place.field:
        tags = _by_tag(place.field, _models(place.annotation))
        path = (*place.path, str(place.field.discriminator))
        hint = _did_you_mean(str(context["tag"]), tuple(tags), "one of")
        return at_value(tree, path, f"{str(context['tag'])!r} is not a {place.path[-1]}{hint}")
    if kind == "extra_forbidden" and place.holder:
        key = str(place.path[-1])
        hint = _did_you_mean(key, tuple(_fields(place.holder)), "known keys:")
        *_, holder, node = tree.descend(place.path)
        changed = _changed_kind(holder) if node.at.source == holder.at.source else None
        return Mistake(changed or node.key_at or node.at, place.path, f"unknown key {key!r}{hint}")
    if kind == "value_error":
        return at_value(tree, place.path, str(context["error"]))
    *_, node = tree.descend(place.path)
    return at_value(tree, place.path, f"{_expectation(detail, place)}, got {describe(node.data)}")


def _at_mapping(tree: Tree, path: KeyPath, message: str) -> Mistake:
    *_, node = tree.descend(path)
    return Mistake(_changed_kind(node) or node.heading, path, message)


def _changed_kind(mapping: Tree) -> Position | None:
    """Return where another source made a mapping one of another kind, which has other keys; None if none did."""
    kind = mapping.child("type")
    return None if kind is None or kind.at.source == mapping.at.source else kind.at


def at_value(tree: Tree, path: KeyPath, message: str) -> Mistake:
    """Point at the value, or at the nearest one around it where shorthand leaves the path out."""
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
    models = _models(place.annotation)
    if models and kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"expected {_mapping_like(models[0]) if len(models) == 1 else 'a mapping'}"
    stem = kind.split("_")[0]
    return f"expected {_KINDS[stem]}" if stem in _KINDS else detail["msg"][:1].lower() + detail["msg"][1:]


def _meaning(field: FieldInfo | None) -> str:
    """Say what a key is for and what it looks like, as far as its field says so."""
    if field is None:
        return ""
    unit = _unit(field)
    models = _models(field.annotation)
    description = f" ({field.description})" if field.description else ""
    if unit:
        return f"{description}: {expected(unit)}"
    if len(models) == 1:
        return f"{description}: {_mapping_like(models[0])}"
    return description


def _unit(field: FieldInfo | None) -> str:
    """Return the SI unit of a field; empty if it has none."""
    return next((item.unit for item in _metadata(field) if isinstance(item, Unit)), "") if field is not None else ""


def _metadata(field: FieldInfo) -> Sequence[Any]:
    """Return the metadata of a field, or of the ``value`` of the entry that it holds."""
    models = _models(field.annotation)
    value = models[0].model_fields.get("value") if models else None
    return value.metadata if value else field.metadata


def _mapping_like(model: type[BaseModel]) -> str:
    needed = [name for name, field in _fields(model).items() if field.is_required()] or list(_fields(model))
    return f"a mapping with the {'key' if len(needed) == 1 else 'keys'} {', '.join(needed)}"


def _did_you_mean(word: str, known: Sequence[str], otherwise: str) -> str:
    near = get_close_matches(word, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else f"; {otherwise} {', '.join(known)}"
