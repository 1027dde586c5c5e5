"""``/docs``: the API description as one static page without external scripts.

Swagger's page loads its scripts from a content delivery network, which needs internet access
and is forbidden by the security headers. ``/openapi.json`` is the machine-readable description.
"""

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

from fastapi import APIRouter, Request
from starlette.responses import HTMLResponse

from app.errors import digits

router = APIRouter(include_in_schema=False)

Node = Mapping[str, Any]
MAX_DEPTH = 4

STYLE = """
:root { color-scheme: light dark; --faint: light-dark(#5a6472, #9aa5b4);
  --line: light-dark(#dde3ea, #2c3440); --tint: light-dark(#f4f7fa, #171d25);
  --accent: light-dark(#0a726b, #35c4b5); }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto;
  padding: 0 1.2rem; background: light-dark(#fff, #10151c);
  color: light-dark(#1b222c, #e3e9f1) }
h1 { font-size: 1.5rem; margin: 0 } h2 { font-size: 1.05rem; margin: 2.2rem 0 .5rem;
  text-transform: capitalize } p { margin: .3rem 0 } .faint { color: var(--faint) }
details { border: 1px solid var(--line); border-radius: 8px; margin: .4rem 0 }
summary { padding: .5rem .8rem; cursor: pointer } details > div { padding: .2rem .8rem .8rem;
  border-top: 1px solid var(--line) } code { font: 13px ui-monospace, monospace }
.method { display: inline-block; min-width: 4.6rem; font-weight: 600; color: var(--accent) }
table { border-collapse: collapse; width: 100%; margin: .3rem 0 }
td { padding: .2rem .6rem .2rem 0; vertical-align: top; border-bottom: 1px solid var(--line) }
td:first-child { white-space: nowrap } h3 { font-size: .85rem; margin: .8rem 0 0;
  color: var(--faint); font-weight: 600 } a { color: var(--accent) }
:is(p, td, code) { overflow-wrap: anywhere }
@media (max-width: 48rem) { td { min-width: 5.2rem } td:first-child { white-space: normal } }
"""


@router.get("/docs")
async def docs(request: Request) -> HTMLResponse:
    """Return the page."""
    return HTMLResponse(render(request.app.openapi()))


def render(api: Node) -> str:
    """Return an OpenAPI description as HTML."""
    groups: dict[str, list[str]] = {}
    for path, methods in api["paths"].items():
        for method, operation in methods.items():
            tag = operation.get("tags", ["other"])[0]
            groups.setdefault(tag, []).append(_operation(api, method, path, operation))
    info = api["info"]
    sections = "".join(
        f"<h2>{escape(tag)}</h2>{''.join(parts)}" for tag, parts in groups.items()
    )
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(info['title'])} "
        "API</title><meta name=viewport content='width=device-width'>"
        "<link rel=icon href='static/favicon.svg'>"
        f"<style>{STYLE}</style><body><h1>{escape(info['title'])} API "
        f"<span class=faint>{escape(info['version'])}</span></h1>"
        f"<p>{escape(info['description'])}</p><p class=faint>For programs: "
        f"<a href='openapi.json'>openapi.json</a></p>{sections}</body></html>"
    )


def _operation(api: Node, method: str, path: str, operation: Node) -> str:
    parts = [f"<p>{escape(operation.get('description', ''))}</p>"]
    parameters = operation.get("parameters", [])
    if parameters:
        rows = "".join(
            _row(f"{one['name']} ({one['in']})", one["schema"], one.get("description", ""))
            for one in parameters
        )
        parts.append(f"<h3>Parameters</h3><table>{rows}</table>")
    if body := operation.get("requestBody"):
        parts.append(f"<h3>Body</h3>{_text(body)}{_content(api, body)}")
    for status, answer in operation["responses"].items():
        if status.startswith("2"):
            parts.append(f"<h3>Answer {escape(status)}</h3>{_content(api, answer)}")
    refusals = "".join(
        f"<tr><td>{status}<td>{escape(_resolved(api, answer)['description'])}</tr>"
        for status, answer in operation["responses"].items()
        if status >= "4"
    )
    parts.append(f"<h3>Problems</h3><table>{refusals}</table>")
    return (
        f"<details><summary><span class=method>{method.upper()}</span>"
        f"<code>{escape(path)}</code> <span class=faint>{escape(operation['summary'])}</span>"
        f"</summary><div>{''.join(parts)}</div></details>"
    )


def _content(api: Node, message: Node) -> str:
    """Return what a body or an answer holds: fields of JSON, or the types of a file."""
    content = message.get("content", {})
    if "application/json" not in content:
        unstated: Node = {"type": ""}
        rows = (_row(kind, one.get("schema", unstated), "") for kind, one in content.items())
        return f"<table>{''.join(rows)}</table>"
    schema = content["application/json"]["schema"]
    return f"{_text(schema)}<table>{''.join(_fields(api, schema))}</table>"


def _text(node: Node) -> str:
    """Return the description of a body or schema as a paragraph; nothing without one."""
    text = node.get("description")
    return f"<p>{escape(text)}</p>" if text else ""


def _fields(api: Node, schema: Node, prefix: str = "", depth: int = 0) -> Iterator[str]:
    """Yield one row per field of a schema, nested ones with their path."""
    schema = _resolved(api, _given(schema))
    for variant in schema.get("oneOf", []):
        yield from _fields(api, variant, prefix, depth)
    required = schema.get("required", [])
    for name, member in schema.get("properties", {}).items():
        path = f"{prefix}{name}"
        text = member.get("description", "")
        yield _row(path if name in required else f"{path} ?", member, text)
        if depth < MAX_DEPTH:
            yield from _fields(api, _inside(api, member), f"{path}.", depth + 1)


def _inside(api: Node, member: Node) -> Node:
    """Return the object schema of a member: itself, its items, or its non-null choice."""
    member = _resolved(api, _given(member))
    return _resolved(api, member.get("items", member))


def _given(schema: Node) -> Node:
    """Return the first choice of a schema that is not null; the schema without choices."""
    choices = (one for one in schema.get("anyOf", ()) if one.get("type") != "null")
    return next(choices, schema)


def _resolved(api: Node, schema: Node) -> Node:
    reference = schema.get("$ref")
    if reference is None:
        return schema
    _, _, kind, name = reference.split("/")
    found: Node = api["components"][kind][name]
    return found


def _row(name: str, schema: Node, text: str) -> str:
    rule = " ".join(part for part in (_kind(schema), _limits(_given(schema))) if part)
    return (
        f"<tr><td><code>{escape(name)}</code><td class=faint>{escape(rule)}"
        f"<td>{escape(text)}</tr>"
    )


def _kind(schema: Node) -> str:
    if "const" in schema:
        return repr(schema["const"])
    if "enum" in schema:
        return " | ".join(repr(one) for one in schema["enum"])
    if "anyOf" in schema:
        return " | ".join(_kind(one) for one in schema["anyOf"])
    if "$ref" in schema:
        return "object"
    if schema.get("format") == "binary":
        return "bytes"
    kind = str(schema.get("type", "any"))
    if "prefixItems" in schema:
        return "[" + ", ".join(_kind(one) for one in schema["prefixItems"]) + "]"
    return f"{kind} of {_kind(schema['items'])}" if kind == "array" else kind


def _limits(schema: Node) -> str:
    names = {
        "minimum": ">=",
        "maximum": "<=",
        "exclusiveMinimum": ">",
        "minItems": "length >=",
        "maxItems": "length <=",
    }
    found = [f"{sign} {digits(schema[name])}" for name, sign in names.items() if name in schema]
    return ", ".join(found)
