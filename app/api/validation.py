"""Conversion of pydantic's validation errors to field, value, rule and choices.

Pydantic's locations are inside our models; fields are paths in the JSON of the request.
Parameters of an address that FastAPI ignores or repairs are errors here.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar, get_args, get_origin

from fastapi.dependencies.utils import get_flat_params
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from fastapi.params import Query
from pydantic import BaseModel, Tag, ValidationError
from starlette.requests import HTTPConnection, Request

MAX_VALUE_CHARACTERS = 200
MAX_LISTED_ITEMS = 8
NOTHING = "nothing"
_SCALARS = (
    "int",
    "float",
    "str",
    "bool",
    "constrained-int",
    "constrained-float",
    "constrained-str",
)
"""Branches of a union of scalars in pydantic's locations, which no body has as a field."""
_SHOULD = re.compile(r"^[A-Z][a-z]+ should ")
"""Start of pydantic's messages: ``String should have at most 80 characters``."""
_WORDS = {
    "an instance of Sequence": "a valid list",
    "greater than or equal to": "at least",
    "less than or equal to": "at most",
    "greater than": "above",
    "less than": "below",
}
"""Pydantic's words, and ours."""
_PLAIN: dict[object, tuple[re.Pattern[str], str]] = {
    int: (re.compile(r"[^-0-9A-Za-z]"), "must be a whole number in plain digits"),
    float: (re.compile(r"[^-+.0-9A-Za-z]|^\+"), "must be a number in plain digits"),
}
"""Characters that pydantic takes in numbers of an address (``1_0``, ``1.0``), and the rule."""

Member = dict[str, object]
M = TypeVar("M", bound=BaseModel)


def dotted(location: Sequence[str | int]) -> str:
    """Return a pydantic location as a path: ``("body", "robot", "q", 3)`` -> ``robot.q[3]``."""
    path = ""
    for part in location[1:] or location:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part}" if path else part
    return path


def shown(value: object) -> str:
    """Return a value as text of limited length."""
    if isinstance(value, list | tuple | dict) and len(value) > MAX_LISTED_ITEMS:
        return f"<{type(value).__name__} of {len(value)}>"
    if isinstance(value, bytes):
        return f"<{len(value)} bytes>"
    text = repr(value)
    if len(text) > MAX_VALUE_CHARACTERS:
        text = text[: MAX_VALUE_CHARACTERS - 3] + "..."
    return text


def validation_member(error: Mapping[str, Any], body: type[BaseModel] | None) -> Member:
    """Return field, value, rule and choices of a validation error."""
    kind, context = str(error["type"]), error.get("ctx", {})
    place, inside, inner = without_inner_tags(error["loc"], body)
    location, value = tuple(place), error.get("input")
    rule = _in_our_words(str(error["msg"]))
    choices: list[str] = []
    if kind == "json_invalid":
        rule = f"must be JSON: {context['error']}"
        return member("body", f"character {location[-1]}", rule)
    if kind.startswith("union_tag_"):
        return _tag_member(location, context)
    if kind == "missing":
        return member(dotted(location), NOTHING, "is required")
    if kind in ("model_attributes_type", "model_type", "dict_type"):
        return member(dotted(location), shown(value), "must be a JSON object")
    if kind in ("literal_error", "enum"):
        choices = _listed(context["expected"])
        rule = "must be one of the choices"
    elif kind == "extra_forbidden":
        rule, choices = "is not a known field", known_fields(inside, inner[:-1])
    elif kind in ("too_short", "too_long"):
        side, bound = ("at least", "min") if kind == "too_short" else ("at most", "max")
        limit = context[bound + "_length"]
        rule = f"must have {side} {limit} {'item' if limit == 1 else 'items'}"
        rule += f", not {context['actual_length']}" if context.get("actual_length") else ""
    elif "choices" in context:
        choices = list(context["choices"])
    elif isinstance(value, float) and not math.isfinite(value):
        rule = "must be a finite number"
    return member(dotted(location), shown(value), rule, choices)


def _in_our_words(message: str) -> str:
    """Return a message of pydantic as a rule: ``must be at least 0``."""
    rule = _SHOULD.sub("must ", message)
    for theirs, ours in _WORDS.items():
        rule = rule.replace(f"must be {theirs}", f"must be {ours}")
    return rule


def member(field: str, value: str, rule: str, choices: Sequence[str] = ()) -> Member:
    """Return the four members of bad input."""
    return {"field": field, "value": value, "rule": rule, "choices": list(choices)}


def fault_text(fault: Mapping[str, Any]) -> str:
    """Return a fault as a sentence with the value, the rule and the choices."""
    given = "" if fault["value"] == NOTHING else f" = {fault['value']}"
    choices = f"; choices: {', '.join(fault['choices'])}" if fault["choices"] else ""
    return f"{fault['field']}{given} {fault['rule']}{choices}"


def merged(faults: Sequence[Member]) -> list[Member]:
    """Return faults with those of one field, the branches of a union, as one."""
    found: dict[object, Member] = {}
    for fault in faults:
        first = found.setdefault(fault["field"], fault)
        if first["rule"] != fault["rule"]:
            found[fault["field"]] = {**first, "rule": f"{first['rule']} or {fault['rule']}"}
    return list(found.values())


def _tag_member(location: tuple[str | int, ...], context: Mapping[str, Any]) -> Member:
    """Return the fault of a missing or unknown discriminator."""
    field = dotted((*location, context["discriminator"].strip("'")))
    if "tag" not in context:
        return member(field, NOTHING, "is required")
    rule = "must be one of the choices"
    return member(field, shown(context["tag"]), rule, _listed(context["expected_tags"]))


def _listed(expected: str) -> list[str]:
    return [part.strip(" '") for part in expected.replace(" or ", ", ").split(",")]


def known_fields(model: type[BaseModel] | None, path: Sequence[str | int]) -> list[str]:
    """Return the fields of the model at ``path`` inside ``model``; empty where unknown."""
    for part in path:
        if model is None or isinstance(part, int):
            continue
        field = model.model_fields.get(part)
        models = list(_models(field.annotation)) if field else []
        model = models[0] if models else None
    return list(model.model_fields) if model else []


def _tagged(annotation: Any) -> dict[str, type[BaseModel]]:
    """Return the models of an annotation's tagged union, by tag."""
    found: dict[str, type[BaseModel]] = {}
    tags = [one.tag for one in get_args(annotation) if isinstance(one, Tag)]
    for argument in get_args(annotation):
        if tags and isinstance(argument, type) and issubclass(argument, BaseModel):
            found[tags[0]] = argument
        found |= _tagged(argument)
    return found


def without_inner_tags(
    location: Sequence[str | int], model: type[BaseModel] | None
) -> tuple[list[str | int], type[BaseModel] | None, list[str | int]]:
    """Remove the tags and scalar branches of unions inside a body from a location.

    Args:
        location: Location of the error; those outside the body have no tags.

    Returns:
        The location; the model of the last tag, or the body's; the path inside that model.
    """
    if location[0] != "body":
        return list(location), None, []
    place, inner = list(location[:1]), list[str | int]()
    variants = dict[str, type[BaseModel]]()
    for part in location[1:]:
        if isinstance(part, str) and part in variants:
            model, inner, variants = variants[part], [], {}
            continue
        place.append(part)
        inner.append(part)
        if isinstance(part, str):
            field = model.model_fields.get(part) if model else None
            variants = _tagged(field.annotation) if field else {}
    if place[-1] in _SCALARS:
        place.pop()
        inner.pop()
    return place, model, inner


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models in an annotation."""
    for one in _parts(annotation):
        if isinstance(one, type) and issubclass(one, BaseModel):
            yield one


def _parts(annotation: Any) -> Iterator[Any]:
    """Yield an annotation and its arguments at any depth."""
    yield annotation
    for argument in get_args(annotation):
        yield from _parts(argument)


def without_tag(
    error: dict[str, Any], variants: Sequence[type[BaseModel]]
) -> tuple[dict[str, Any], type[BaseModel] | None]:
    """Return an error without the tag of a body's union, and the tag's variant."""
    location = error["loc"]
    if len(variants) < 2 or len(location) < 2 or location[0] != "body":
        return error, variants[0] if variants else None
    for variant in variants:
        for field in variant.model_fields.values():
            if location[1] in get_args(field.annotation):
                return {**error, "loc": (location[0], *location[2:])}, variant
    return error, None


class BodyFault(RequestValidationError):
    """A body does not match a model that its route has chosen."""

    def __init__(self, errors: Sequence[Mapping[str, Any]], model: type[BaseModel]) -> None:
        super().__init__([{**one, "loc": ("body", *one["loc"])} for one in errors])
        self.model = model


def validated(model: type[M], body: Mapping[str, Any]) -> M:
    """Return a body as the model that a route has chosen.

    Raises:
        BodyFault: It does not match.
    """
    try:
        return model.model_validate(body)
    except ValidationError as error:
        raise BodyFault(error.errors(), model) from None


def body_models(request: Request) -> list[type[BaseModel]]:
    """Return the possible models of a request's body."""
    field = getattr(request.scope.get("route"), "body_field", None)
    return list(_models(field.field_info.annotation)) if field else []


async def check_query(connection: HTTPConnection) -> None:
    """Check that the route has the parameters of an address; each is given once, as text.

    Raises:
        RequestValidationError: One is unknown, repeated without being a list, or a number
            that is not written in plain digits.
        WebSocketRequestValidationError: Likewise, of a socket.
    """
    if not connection.scope["query_string"]:
        return
    parameters = get_flat_params(connection.scope["route"].dependant)
    known = {one.alias: one for one in parameters if isinstance(one.field_info, Query)}
    faults = list[dict[str, Any]]()
    for name in connection.query_params:
        values, context = connection.query_params.getlist(name), dict[str, Any]()
        parts = list(_parts(known[name].field_info.annotation)) if name in known else []
        odd, plain = next((_PLAIN[one] for one in (int, float) if one in parts), (None, ""))
        if name not in known:
            rule = "is not a parameter" if known else "is not a parameter: the route has none"
            context = {"choices": list(known)}
        elif len(values) > 1 and list not in [get_origin(one) for one in parts]:
            rule = "must be given once"
        elif odd is not None and any(map(odd.search, values)):
            rule = plain
        else:
            continue
        value = values if len(values) > 1 else values[0]
        kind, place = "invalid_parameter", ("query", name)
        faults.append({"type": kind, "loc": place, "msg": rule, "input": value, "ctx": context})
    if faults:
        is_socket = connection.scope["type"] == "websocket"
        raise (WebSocketRequestValidationError if is_socket else RequestValidationError)(faults)
