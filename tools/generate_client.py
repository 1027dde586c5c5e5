"""Writes ``app/client/operations/`` from the OpenAPI document: ``make client``."""

import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from app.main import create_app
from app.settings import Settings
from tools.arguments import parser_of

TARGET = Path(__file__).parents[1] / "app" / "client" / "operations"
MAX_VARIANTS = 4
"""Kinds of a body up to which each is named; above, their common base class."""
FOR_WORKERS = {"attempts"}
"""Tags of operations that are left out: only the process of an attempt can use them."""
PLAIN = {"integer": "int", "number": "float", "boolean": "bool", "string": "str"}
HEAD = '''"""Operations with the tag {tag}; written by ``make client``."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

{imports}

class {name}(Transport):
    """Operations with the tag {tag}."""

'''
CLIENT = '''"""One method per operation of the OpenAPI document; written by ``make client``.

Bodies are the service's own schemas, or mappings of their JSON. A problem raises ``Refused``.
"""

{imports}

__all__ = ["Client"]


class Client({names}):
    """The operations of a server."""
'''

Node = Mapping[str, Any]


def models() -> dict[str, type[BaseModel]]:
    """Return the models of the service by name; a class name exists once."""

    def below(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
        for one in model.__subclasses__():
            yield one
            yield from below(one)

    return {
        one.__name__: one
        for one in below(BaseModel)
        if one.__module__.startswith(("app.", "jobs."))
    }


class Writer:
    """Writes methods, and collects the models that they name."""

    def __init__(self, document: Node) -> None:
        self._document = document
        self._models = models()
        self._used: set[type] = set()

    def modules(self) -> dict[str, str]:
        """Return the text of each module by its name."""
        methods: dict[str, list[str]] = {}
        for path, operations in self._document["paths"].items():
            for method, operation in operations.items():
                if not FOR_WORKERS & set(operation["tags"]):
                    methods.setdefault(operation["tags"][0], []).append(f"{method} {path}")
        names = {tag: _module(tag) for tag in sorted(methods)}
        found = {names[tag]: self._module(tag, of) for tag, of in sorted(methods.items())}
        imports = "\n".join(
            f"from app.client.operations.{name} import {_class(tag)}"
            for tag, name in names.items()
        )
        text = CLIENT.replace("{imports}", imports)
        text = text.replace("{names}", ", ".join(map(_class, names)))
        return {"__init__": _formatted(text), **found}

    def _module(self, tag: str, operations: list[str]) -> str:
        """Return the module of a tag; ``operations`` are method and path of each."""
        self._used = set()
        methods = []
        for one in operations:
            method, _, path = one.partition(" ")
            methods.append(self._method(method, path, self._document["paths"][path][method]))
        imports = "\n".join(
            f"from {one.__module__} import {one.__name__}"
            for one in sorted(self._used, key=lambda one: (one.__module__, one.__name__))
        )
        imports += "\nfrom app.client.transport import StreamEvent, Transport\n"
        head = HEAD.replace("{imports}", imports).replace("{name}", _class(tag))
        return _formatted(head.replace("{tag}", tag) + "\n".join(methods))

    def _method(self, method: str, path: str, operation: Node) -> str:
        parameters = operation.get("parameters", [])
        of_path = [one["name"] for one in parameters if one["in"] == "path"]
        named = [one for one in parameters if one["in"] != "path"]
        arguments = ["self", *(f"{name}: str" for name in of_path)]
        parts = []
        if (body := operation.get("requestBody")) is not None:
            media = body["content"].get("application/json")
            kind = "content: bytes" if media is None else f"body: {self._body(media)}"
            arguments.append(kind if body.get("required") else f"{kind} | None = None")
            parts.append("content=content" if media is None else "body=body")
        if named:
            arguments.append("*")
            ordered = sorted(named, key=lambda one: not one.get("required", False))
            arguments += [self._argument(one) for one in ordered]
        for place, word in (("query", "query"), ("header", "headers")):
            pairs = [f'"{one["name"]}": {_name(one)}' for one in named if one["in"] == place]
            if pairs:
                parts.append(f"{word}={{{', '.join(pairs)}}}")
        for name in of_path:
            path = path.replace(f"{{{name}}}", "{}")
        given = [*of_path, *parts]
        kind, ending = self._answer(operation, method.upper(), path, given)
        return (
            f"    def {operation['operationId']}({', '.join(arguments)}) -> {kind}:\n"
            f'        """{operation["summary"]}."""\n        {ending}\n'
        )

    def _answer(
        self, operation: Node, method: str, path: str, given: list[str]
    ) -> tuple[str, str]:
        """Return the type of an answer, and the statement that returns it."""
        call = ", ".join([f'"{method} {path}"', *given])
        send = f"self._send({call})"
        status = next(one for one in operation["responses"] if one.startswith("2"))
        content = operation["responses"][status].get("content", {})
        if "text/event-stream" in content:
            address = ", ".join([f'"{path}"', *given])
            return "Iterator[StreamEvent]", f"return self._events({address})"
        if not content:
            return "None", send
        if "application/json" not in content:
            is_text = next(iter(content)).startswith("text/")
            return (
                ("str", f"return {send}.text")
                if is_text
                else ("bytes", f"return {send}.content")
            )
        model = self._model(content["application/json"]["schema"])
        if model is None:
            return "dict[str, Any]", f"return dict({send}.json())"
        return model, f"return self._parsed({model}, {call})"

    def _body(self, media: Node) -> str:
        """Return the type of a JSON body."""
        schema = media["schema"]
        variants = schema.get("oneOf", schema.get("anyOf", [schema]))
        names = [one for one in map(self._model, variants) if one]
        if len(names) > MAX_VARIANTS:
            lines = [self._models[name].__mro__ for name in names]
            base = next(one for one in lines[0] if all(one in line for line in lines))
            self._used -= {self._models[name] for name in names}
            self._used.add(base)
            names = [base.__name__]
        return " | ".join([*names, "Mapping[str, Any]"])

    def _model(self, schema: Node) -> str | None:
        name = str(schema.get("$ref", "")).rpartition("/")[2]
        name = name.removesuffix("-Input").removesuffix("-Output")
        if name not in self._models:
            return None
        self._used.add(self._models[name])
        return name

    def _argument(self, parameter: Node) -> str:
        kind, default = _type(parameter["schema"]), ""
        if not parameter.get("required", False):
            default = " = None"
            kind = kind if kind.endswith("None") else f"{kind} | None"
        return f"{_name(parameter)}: {kind}{default}"


def _module(tag: str) -> str:
    return tag.replace(" ", "_").replace("-", "_")


def _class(tag: str) -> str:
    return "".join(word.capitalize() for word in _module(tag).split("_")) + "Operations"


def _name(parameter: Node) -> str:
    return str(parameter["name"]).replace("-", "_")


def _type(schema: Node) -> str:
    """Return the type of a parameter."""
    if "anyOf" in schema:
        return " | ".join(_type(one) for one in schema["anyOf"])
    if "enum" in schema:
        return f"Literal[{', '.join(map(repr, schema['enum']))}]"
    if schema.get("type") == "array":
        return f"Sequence[{_type(schema['items'])}]"
    return PLAIN.get(schema.get("type", ""), "None")


def _formatted(text: str) -> str:
    """Return a module as ``ruff`` formats it, without unused imports."""
    name = ["--stdin-filename", str(TARGET / "module.py"), "-"]
    for command in (["check", "--quiet", "--fix-only"], ["format", "--quiet"]):
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *command, *name],
            input=text,
            capture_output=True,
            text=True,
            check=True,
        )
        text = done.stdout
    return text


def render() -> dict[str, str]:
    """Return the text of each module of the package, by its name, for the present service."""
    return Writer(create_app(Settings.model_validate({"data": "nowhere"})).openapi()).modules()


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    modules = render()
    TARGET.mkdir(exist_ok=True)
    for stale in TARGET.glob("*.py"):
        stale.unlink()
    for name, text in modules.items():
        (TARGET / f"{name}.py").write_text(text, "utf-8")
        print(f"wrote {name}: {len(text.splitlines())} lines")
