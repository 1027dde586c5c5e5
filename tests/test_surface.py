"""README, set-up page and HTTP page agree with the service."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from typer.main import get_command

from app.api.schemas.task_selection import TaskSelectionRequest
from app.cli.entry import app as command_line
from app.main import create_app
from app.settings import PREFIX, Settings
from app.sim.envs import IDS
from jobs.spec import parse_spec

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
SETUP = (ROOT / "docs/setup.md").read_text(encoding="utf-8")
HTTP = (ROOT / "docs/http.md").read_text(encoding="utf-8")
METHODS = ("get", "post", "put", "patch", "delete")


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    return create_app(Settings(data=tmp_path_factory.mktemp("data")))


def commands() -> Iterator[list[str]]:
    for block in re.findall(r"```sh\n(.*?)```", README + SETUP, re.DOTALL):
        # One command runs on over ends of line that are quoted or escaped.
        text = ""
        for line in block.splitlines(keepends=True):
            text += line
            try:
                words = shlex.split(text, comments=True)
            except ValueError:
                continue
            if text.endswith("\\\n"):
                continue
            text = ""
            if words:
                yield words


def requests() -> dict[str, Any]:
    found = {}
    for words in commands():
        if words[0] == "curl":
            (url,) = (word for word in words if word.startswith("http"))
            found[url.removeprefix("http://127.0.0.1:8000")] = json.loads(words[-1])
    return found


def check_call(words: list[str]) -> None:
    command: Any = get_command(command_line)
    while hasattr(command, "commands"):
        if words[0] in {name for one in command.params for name in one.opts}:
            return  # an option before any command
        name, *words = words
        command = command.commands[name]
    command.make_context(None, words)


def without_names(path: str) -> str:
    return re.sub(r"\{[^}]*\}", "{}", path)


def test_readme_is_at_most_160_lines() -> None:
    assert len(README.splitlines()) <= 160


def test_setup_page_lists_every_setting_and_no_other() -> None:
    known = {PREFIX + name.upper() for name in Settings.model_fields}
    assert set(re.findall(r"^\| `(TANDEM_\w+)`", SETUP, re.MULTILINE)) == known
    assert set(re.findall(r"TANDEM_[A-Z_]+", README + SETUP)) == known


def test_http_page_lists_every_route_and_no_other(app: FastAPI) -> None:
    paths = app.openapi()["paths"]
    offered = {
        (method.upper(), without_names(path))
        for path, operations in paths.items()
        for method in operations
        if method in METHODS and path.startswith("/v1/")
    }
    table = HTTP.split("## Routes\n")[1].split("\n## ")[0]
    listed = {
        (method, without_names(path))
        for method, path in re.findall(r"`(GET|POST|PUT|PATCH|DELETE) (/v1/[^`]+)`", table)
    }
    assert listed == offered


def test_routes_without_method_exist(app: FastAPI) -> None:
    for path in ("/healthz", "/readyz"):
        assert f"`{path}`" in HTTP
        assert path in app.openapi()["paths"]
    assert "`/docs`" in README
    assert TestClient(app, base_url="http://127.0.0.1").get("/docs").status_code == 200


def test_readme_commands_are_ones_that_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for words in commands():
        if words[0] == "make":
            assert words[1] in targets
        elif words[:3] == ["python", "-m", "app"]:
            check_call(words[3:])
        else:
            assert words[0] in ("git", "curl", "docker", "export")


def test_readme_requests_are_ones_the_service_takes() -> None:
    bodies = requests()
    job = parse_spec(bodies["/v1/jobs"]).new_job()
    assert (job.kind, job.preset) == ("train", "pick-td3")
    state = TaskSelectionRequest.model_validate(bodies["/v1/task-selection"])
    _, _, candidates = state.to_domain()
    assert len(state.people) == 1
    assert [one.id for one in candidates] == ["left", "right"]


def test_readme_names_every_environment_and_its_python_runs() -> None:
    rows = re.findall(r"^\| (`tandem/[^|]*)\|", README, re.MULTILINE)
    names = {
        name.split("/")[-1].removesuffix("-v0")
        for name in re.findall(r"`([^`]+)`", "".join(rows))
    }
    assert names == {one.split("/")[1].removesuffix("-v0") for one in IDS}
    (block,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    found: dict[str, Any] = {}
    exec(block, found)
    assert len(found["env"].reset(seed=1)[0]) > 0
    assert found["batch"].reset(seed=1)[0].shape[0] == 128
