"""Reader of work cells from untrusted bytes.

The result is a :class:`~app.sim.cells.cell.Cell`, or one :class:`~app.errors.BadCell` that
lists all faults with place, value and rule. Unreadable stations, obstacles or people do not
prevent the checks of the rest.
"""

import copy
import difflib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

from pydantic import BaseModel, ValidationError

from app.errors import BadCell, Fault
from app.one_line import ONE_LINE
from app.sim.cell_validation.checks import check_cell
from app.sim.cell_validation.units import MAX_SHOWN, cut, fault
from app.sim.cells.cell import LIMITS, Cell, load_cell
from app.sim.cells.parts import (
    CellSafety,
    GoalRegion,
    Obstacle,
    RobotMount,
    Station,
    TableGeometry,
)
from app.sim.cells.people import ConstantWalker, FixedSpeedWalker, Walker, Worker

_TEXT_RULE = "must be text without control characters"
MAX_BYTES = 256 * 1024
"""Largest file that is read [bytes]."""
MAX_DEPTH = 16
"""Deepest nesting that is read; a cell needs five levels."""
MAX_FAULTS = 200
"""Most faults that one answer lists."""
MAX_PLACE = 200
"""Longest place that a fault names [characters]."""

_PARTS: Mapping[str, type[BaseModel]] = {
    "table": TableGeometry,
    "robot": RobotMount,
    "goal_region": GoalRegion,
    "safety": CellSafety,
    "stations": Station,
    "obstacles": Obstacle,
}
_PEOPLE: Mapping[str, type[BaseModel]] = {
    "worker": Worker,
    "walker": Walker,
    "constant": ConstantWalker,
    "fixed-speed": FixedSpeedWalker,
}
_RULES = {
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "string_type": "must be text in quotes",
    "bool_type": "must be true or false",
    "tuple_type": "must be a list in [ ]",
    "model_type": "must be an object in { }",
    "model_attributes_type": "must be an object in { }",
    "string_too_short": "must not be empty",
    "string_unicode": "must be text",
}


class _Object(dict[str, Any]):
    """A JSON object that remembers its repeated keys."""

    repeated_keys: tuple[str, ...] = ()


def read_cell(content: bytes) -> Cell:
    """Return the cell in a JSON file.

    Raises:
        BadCell: It is no cell; the error lists every fault.
    """
    raw = _parse(content)
    faults = [*islice(_tree_faults(raw, ""), MAX_FAULTS), *_cut(raw)]
    cell, found = _validate(raw)
    faults += found
    if cell is not None:
        faults += check_cell(cell, faults)
    if faults or cell is None:
        raise BadCell(list(dict.fromkeys(faults))[:MAX_FAULTS])
    return cell


def _parse(content: bytes) -> dict[str, Any]:
    def refuse(value: str, rule: str, hint: str = "") -> BadCell:
        return BadCell([fault("file", value, rule, hint)])

    if len(content) > MAX_BYTES:
        rule = f"must have at most {MAX_BYTES} bytes (256 kB)"
        raise refuse(f"<{len(content)} bytes>", rule)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        value = f"<byte {content[error.start]:#04x} at {error.start}>"
        hint = "save the file with the encoding UTF-8"
        raise refuse(value, "must be text in UTF-8", hint) from error
    try:
        raw = json.loads(text, object_pairs_hook=_pairs)
    except json.JSONDecodeError as error:
        value = f"<line {error.lineno}, column {error.colno}>"
        raise refuse(value, f"must be JSON: {error.msg}") from error
    except RecursionError as error:
        rule = f"must be nested at most {MAX_DEPTH} deep"
        raise refuse("<deep nesting>", rule) from error
    except ValueError as error:
        rule = "must be JSON with numbers of at most 4300 digits"
        raise refuse("<a very long number>", rule) from error
    if not isinstance(raw, dict):
        raise refuse(_shown(raw), "must be one JSON object in { }, a work cell")
    if _is_deep(raw):
        raise refuse("<deep nesting>", f"must be nested at most {MAX_DEPTH} deep")
    return raw


def _is_deep(raw: dict[str, Any]) -> bool:
    level: list[Any] = [raw]
    for _ in range(MAX_DEPTH):
        insides = [node.values() if isinstance(node, dict) else node for node in level]
        level = [one for inside in insides for one in inside if isinstance(one, dict | list)]
    return bool(level)


def _cut(raw: dict[str, Any]) -> Iterator[Fault]:
    """Truncate lists that are too long."""
    for name, most in LIMITS.items():
        items = raw.get(name)
        if isinstance(items, list) and len(items) > most:
            yield fault(name, f"<{len(items)} of them>", f"must be at most {most}")
            raw[name] = items[:most]


def _pairs(pairs: list[tuple[str, Any]]) -> _Object:
    made = _Object(pairs)
    if len(made) < len(pairs):
        counts = Counter(name for name, _ in pairs)
        made.repeated_keys = tuple(name for name, count in counts.items() if count > 1)
    return made


def _tree_faults(node: object, place: str) -> Iterator[Fault]:
    """Return the faults of repeated keys and of invalid text."""
    if isinstance(node, str) and not _is_text(node):
        yield fault(place, ascii(node)[:MAX_SHOWN], _TEXT_RULE)
    if isinstance(node, _Object):
        for name in node.repeated_keys:
            path = f"{place}.{name}".lstrip(".")[:MAX_PLACE]
            hint = "only the last one would count"
            yield fault(path, "", "is given twice in one object", hint)
        for name, value in node.items():
            yield from _tree_faults(value, f"{place}.{name}".lstrip(".")[:MAX_PLACE])
    elif isinstance(node, list):
        for index, value in enumerate(node):
            yield from _tree_faults(value, (place + _item(value, index))[:MAX_PLACE])


def _is_text(text: str) -> bool:
    if not re.fullmatch(ONE_LINE, text):
        return False
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _item(value: object, index: int) -> str:
    name = value.get("id") if isinstance(value, dict) else None
    return f".{name}" if isinstance(name, str) and _is_text(name) else f"[{index}]"


def _validate(raw: dict[str, Any]) -> tuple[Cell | None, list[Fault]]:
    """Return the readable parts of a cell and the faults of types."""
    try:
        return _model(raw), []
    except ValidationError as error:
        errors = error.errors(include_url=False)[:MAX_FAULTS]
    faults = [_fault(raw, one) for one in errors]
    rest = _without(raw, [tuple(one["loc"]) for one in errors])
    if rest is None:
        return None, faults
    try:
        return _model(rest), faults
    except ValidationError:
        return None, faults


def _model(raw: dict[str, Any]) -> Cell:
    return Cell.model_validate_json(json.dumps(raw, default=str))


def _without(raw: dict[str, Any], places: Sequence[tuple[Any, ...]]) -> dict[str, Any] | None:
    """Return the cell without unreadable parts; None if required parts are missing.

    Fields of robot and table that cannot be read take the values of a shipped cell, so that
    their neighbours can be checked; ``check_cell`` excludes them.
    """
    rest, dropped = copy.deepcopy(dict(raw)), set()
    spare = load_cell().definition()
    for loc in places:
        head = loc[0] if loc else None
        if head is None:
            return None
        if head in LIMITS and len(loc) > 1:
            dropped.add((head, loc[1]))
        elif head in ("table", "robot") and len(loc) > 1:
            _replace(rest[head], loc[1], spare[head])
        elif head in ("table", "robot", "name", "title"):
            rest[head] = spare[head]
        else:
            rest.pop(head, None)
    for name in LIMITS:
        items = rest.get(name)
        if isinstance(items, list):
            rest[name] = [one for k, one in enumerate(items) if (name, k) not in dropped]
    return rest


def _replace(part: dict[str, Any], name: str, spare: Any) -> None:
    """Replace an unreadable field by the value of a shipped cell; drop unknown fields."""
    part.pop(name, None)
    if name in spare:
        part[name] = spare[name]


def _fault(raw: dict[str, Any], error: Any) -> Fault:
    place, loc = _place(raw, error["loc"])
    kind, context, value = error["type"], error.get("ctx", {}), _shown(error.get("input"))
    if kind == "json_invalid":
        return fault("file", "", f"must be JSON: {context.get('error')}")
    if kind == "missing":
        return fault(place, "", "is missing", _description(raw, loc))
    if kind == "extra_forbidden":
        rule = "is not a known field"
        return fault(place, value, rule, _known(raw, loc))
    if kind == "union_tag_not_found":
        return fault(f"{place}.kind", "", f"is missing: {', '.join(_PEOPLE)}")
    if kind == "union_tag_invalid":
        rule = f"must be one of {', '.join(_PEOPLE)}"
        return fault(f"{place}.kind", repr(context["tag"])[:MAX_SHOWN], rule)
    return fault(place, value, _rule(kind, context, str(error["msg"])))


def _rule(kind: str, context: Mapping[str, Any], message: str) -> str:
    if kind in _RULES:
        return _RULES[kind]
    if kind == "literal_error":
        return f"must be {context['expected']}"
    if kind == "string_pattern_mismatch":
        more = "0-9, - and _" if "_" in context["pattern"] else "0-9 and -"
        most = 32 if "_" in context["pattern"] else 64
        return f"must begin with a-z and go on with a-z, {more}; at most {most} characters"
    if kind == "string_too_long":
        return f"must have at most {context['max_length']} characters"
    if kind == "too_long":
        return f"must hold {context['max_length']} numbers, not {context['actual_length']}"
    return message.replace("Input should be ", "must be ")


def _place(raw: object, loc: Sequence[Any]) -> tuple[str, tuple[Any, ...]]:
    """Return a location as people write it, and without the tags of unions."""
    place, node, clean = "", raw, []
    for part in loc:
        if isinstance(node, dict) and part in _PEOPLE and part == node.get("kind"):
            continue
        clean.append(part)
        inner = None
        if isinstance(node, dict):
            inner = node.get(part)
        elif isinstance(node, list) and isinstance(part, int) and part < len(node):
            inner = node[part]
        if isinstance(part, int):
            place += _item(inner, part)
        else:
            place += f".{part}" if place else str(part)
        node = inner
    return place[:MAX_PLACE] or "file", tuple(clean)


def _owner(raw: Mapping[str, Any], loc: tuple[Any, ...]) -> type[BaseModel] | None:
    """Return the model whose field the location names last."""
    if len(loc) == 1:
        return Cell
    if loc[0] == "people" and len(loc) > 1:
        person = raw["people"][loc[1]]
        return _PEOPLE.get(str(person.get("kind"))) if isinstance(person, dict) else None
    return _PARTS.get(str(loc[0]))


def _description(raw: Mapping[str, Any], loc: tuple[Any, ...]) -> str:
    names = [part for part in loc if isinstance(part, str)]
    owner = _owner(raw, loc)
    field = owner.model_fields.get(names[-1]) if owner and names else None
    text = field.description or "" if field else ""
    return f"one number per entry: {text}" if text and isinstance(loc[-1], int) else text


def _known(raw: Mapping[str, Any], loc: tuple[Any, ...]) -> str:
    owner, name = _owner(raw, loc), str(loc[-1])
    if owner is None:
        return ""
    if owner is Cell and name == "human":
        return 'people stand in the list "people"; this one is of "kind": "worker"'
    known = list(owner.model_fields)
    near = difflib.get_close_matches(name, known, 1)
    return f"is {near[0]} meant?" if near else f"known are {', '.join(known)}"


def _shown(value: object) -> str:
    if isinstance(value, dict):
        return f"<object of {len(value)} fields>"
    try:
        text = json.dumps(value, default=str, ensure_ascii=False)
    except ValueError:  # an integer with too many digits to be written
        return "<a very long number>"
    if not _is_text(text):
        text = ascii(text)
    return cut(text)
