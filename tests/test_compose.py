"""The compose file fits the settings and the image, whose build has every file it copies."""

import re
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import pytest
import yaml

from app.api.routes.health import HEALTH, READY
from app.cli.uvicorn_server import GRACE_S
from app.main import RAY_SHUTDOWN_S, STOP_S
from app.policies.report.page import RESULTS
from app.settings import Settings, check_access, load_settings
from app.traces import EXPORT_S
from jobs.timeouts import Timeouts

ROOT = Path(__file__).parents[1]
SECRETS = {"TANDEM_TOKEN": "0123456789abcdef", "POSTGRES_PASSWORD": "fedcba9876543210"}


@pytest.fixture
def services() -> dict[str, Any]:
    text = (ROOT / "compose.yaml").read_text()
    filled = re.sub(r"\$\{(\w+)[^}]*\}", lambda match: SECRETS[match[1]], text)
    found: dict[str, Any] = yaml.safe_load(filled)
    named = {
        mount.partition(":")[0]
        for one in found["services"].values()
        for mount in one["volumes"]
    }
    assert named == set(found["volumes"])
    return dict(found["services"])


def settings_of(service: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> Settings:
    image = re.findall(
        r"\b(TANDEM_\w+)=(\S+)", (ROOT / "Dockerfile").read_text().split("ENV ")[1]
    )
    for name, value in [*image, *service["environment"].items()]:
        monkeypatch.setenv(name, value)
    return load_settings()


def test_its_variables_are_settings_that_protect_the_service(
    services: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = settings_of(services["tandem"], monkeypatch)
    check_access(settings)
    assert settings.secret == SECRETS["TANDEM_TOKEN"] and not settings.is_loopback
    assert services["tandem"]["ports"] == [f"127.0.0.1:8000:{settings.port}"]
    assert services["tandem"]["volumes"] == [f"data:{settings.data}"]


@pytest.mark.parametrize("name", ["Dockerfile", "docs/setup.md"])
def test_shown_command_keeps_the_token_and_publishes_on_loopback(name: str) -> None:
    """A token that is generated within `docker run` is known to nobody."""
    before, _, run = (ROOT / name).read_text("utf-8").partition("docker run")
    run = run.partition(":/data tandem")[0]
    assert "-e TANDEM_TOKEN " in run and "-p 127.0.0.1:8000:8000" in run
    assert 'export TANDEM_TOKEN="$(' in before


def test_image_that_compiles_its_kernels_is_healthy() -> None:
    check = (ROOT / "Dockerfile").read_text().partition("HEALTHCHECK")[2]
    assert f"{HEALTH}'" in check and READY not in check


def test_its_database_is_the_one_that_it_starts(
    services: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = settings_of(services["tandem"], monkeypatch)
    database = services["database"]["environment"]
    user, name = database["POSTGRES_USER"], database["POSTGRES_DB"]
    password = database["POSTGRES_PASSWORD"]
    assert settings.database == f"postgresql://{user}:{password}@database/{name}"
    assert set(services["tandem"]["depends_on"]) == {"database"}


def test_container_is_not_killed_before_the_states_of_trainings_are_stored(
    services: dict[str, Any],
) -> None:
    longest_s = RAY_SHUTDOWN_S + GRACE_S + STOP_S + EXPORT_S
    assert float(services["tandem"]["stop_grace_period"].removesuffix("s")) > longest_s
    assert longest_s == 40.0  # docs/setup.md
    assert longest_s - RAY_SHUTDOWN_S + Timeouts().shutdown_s == 18.0


def is_sent_to_the_build(path: str) -> bool:
    """Return whether ``.dockerignore`` leaves a path: its last matching line counts."""
    parents = [path, *map(str, Path(path).parents)]
    sent = True
    for line in (ROOT / ".dockerignore").read_text().split():
        pattern = line.removeprefix("!").removeprefix("**/")
        if any(
            fnmatchcase(one, pattern) for one in parents if "/" not in one or "/" in pattern
        ):
            sent = line.startswith("!")
    return sent


def test_build_has_every_file_that_it_copies() -> None:
    copies = re.findall(r"^COPY ((?!--from).*) \S+$", (ROOT / "Dockerfile").read_text(), re.M)
    files = [one for line in copies for one in line.split() if one != "."]
    assert "Makefile" in files
    for one in files:
        assert (ROOT / one).is_file() and is_sent_to_the_build(one), one
    assert not is_sent_to_the_build("data/tandem.db")


def test_build_has_the_results_that_reports_state() -> None:
    files = [path.relative_to(ROOT).as_posix() for path in RESULTS.glob("*.json")]
    assert files and all(is_sent_to_the_build(one) for one in files)
    assert not is_sent_to_the_build("docs/setup.md")
