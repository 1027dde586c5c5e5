"""The page and what it loads: packed, kept by browsers, and below the path of a proxy."""

import gzip
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from websockets.sync.client import connect

import web
from app.main import create_app
from app.settings import Settings
from tests.api.conftest import ADDRESS
from tests.api.live_server import running, wait_until_ready
from tests.support import patient_http
from tests.support.sub_path_proxy import PREFIX, below_path

STATIC = Path(web.__file__).parent / "page"
FILES = sorted(
    str(path.relative_to(STATIC))
    for path in STATIC.rglob("*")
    if path.suffix in (".js", ".css")
)
TOKEN = "a-token-of-some-length"
FORM = {"Content-Type": "application/x-www-form-urlencoded"}


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a service behind a proxy, below its path."""
    app = create_app(Settings(data=tmp_path_factory.mktemp("below")))
    with running(app, root_path=PREFIX) as (_, address):
        wait_until_ready(address)
        outside_paths: list[str] = []
        with below_path(address, outside_paths) as shown:
            yield shown
        assert outside_paths == []


@pytest.fixture
def below(client: TestClient) -> TestClient:
    return TestClient(
        client.app, base_url=ADDRESS, root_path=PREFIX, headers={"Accept-Encoding": "identity"}
    )


@pytest.mark.parametrize("name", FILES)
def test_files_of_the_page_are_packed_and_asked_for_again(
    client: TestClient, name: str
) -> None:
    content = (STATIC / name).read_bytes()
    with client.stream("GET", f"/static/{name}", headers={"Accept-Encoding": "gzip"}) as answer:
        sent = b"".join(answer.iter_raw())
    if len(content) >= 500:
        assert answer.headers["content-encoding"] == "gzip"
        assert "accept-encoding" in answer.headers["vary"].lower()
        assert gzip.decompress(sent) == content
        assert len(sent) < len(content)
    assert answer.headers["cache-control"] == "no-cache"
    headers = {"If-None-Match": answer.headers["etag"]}
    again = client.get(f"/static/{name}", headers=headers)
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["cache-control"] == "no-cache"
    assert client.get(f"/static/{name}", headers={"If-None-Match": '"other"'}).is_success


@pytest.mark.parametrize(
    ("accepted", "packed"),
    [
        ("gzip", True),
        ("br, GZIP;q=0.001", True),
        ("gzip ; q=1.0, *;q=0", True),
        ("*", True),
        ("gzip;q=0", False),
        ("gzip;q=0, *", False),
        ("deflate, gzip; q=0.000", False),
        ("*;q=0", False),
        ("br", False),
        ("", False),
    ],
)
@pytest.mark.parametrize("path", ["/viewer/main/", "/static/app.js"])
def test_gzip_is_sent_to_clients_that_do_not_refuse_it(
    client: TestClient, path: str, accepted: str, packed: bool
) -> None:
    answer = client.get(path, headers={"Accept-Encoding": accepted})
    assert (answer.headers.get("content-encoding") == "gzip") is packed
    assert "accept-encoding" in answer.headers["vary"].lower()
    assert answer.content


@pytest.mark.parametrize("path", ["/", "/viewer/main/"])
def test_pages_are_asked_for_again(client: TestClient, path: str) -> None:
    answer = client.get(path)
    assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-cache")
    again = client.get(path, headers={"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize("form", ["{}", "W/{}", '"other", {}', "*"])
def test_answer_that_a_client_has_is_not_sent_again(client: TestClient, form: str) -> None:
    for path in ("/v1/checkpoints/pick/tensors", "/viewer/main/", "/static/app.js"):
        etag = client.get(path).headers["etag"]
        headers = {"If-None-Match": form.format(etag)}
        for ask in (client.get, client.head):
            again = ask(path, headers=headers)
            assert (again.status_code, again.content) == (304, b"")
            assert again.headers["etag"] == etag
        other = client.get(path, headers={"If-None-Match": '"other"'})
        assert other.is_success and other.content


def test_events_and_fonts_are_not_packed(client: TestClient) -> None:
    font = client.get("/static/vendor/inter-latin-wght-normal.woff2")
    assert font.is_success
    assert "content-encoding" not in font.headers


def test_nothing_in_the_page_names_a_path_from_the_root() -> None:
    for name in ("index.html", *(one for one in FILES if "vendor" not in one)):
        text = (STATIC / name).read_text(encoding="utf-8")
        assert re.findall(r"""["'`(]/(?:v1|static|docs|viewer|session|readyz)\b""", text) == []


def test_page_and_its_files_are_found_below_a_path(page: str) -> None:
    index = patient_http.get(f"{page}/")
    assert index.is_success
    names = re.findall(r'(?:href|src)="([^"]+)"', index.text)
    assert len(names) > 5
    for name in (*names, "docs", "openapi.json", "viewer/main/", "v1/presets", "readyz"):
        assert patient_http.get(f"{page}/{name}").status_code == 200, name


def test_places_in_answers_are_below_the_path(page: str) -> None:
    made = patient_http.post(f"{page}/v1/trackers", json={"cell": "pick-and-place"})
    assert made.status_code == 201
    assert made.headers["location"] == f"{PREFIX}/v1/trackers/{made.json()['id']}"
    assert (
        patient_http.get(f"{page}/viewer/main").headers["location"] == f"{PREFIX}/viewer/main/"
    )
    missing = patient_http.get(f"{page}/v1/cells/none")
    assert (missing.status_code, missing.json()["instance"]) == (404, f"{PREFIX}/v1/cells/none")
    assert patient_http.get(f"{page}/openapi.json").json()["servers"] == [{"url": PREFIX}]


def test_sockets_and_events_pass_below_the_path(page: str) -> None:
    with connect(
        page.replace("http", "ws", 1) + "/viewer/main/",
        subprotocols=["viser-v1.1.1"],
        max_size=None,
    ) as viewer:
        assert viewer.recv()
    with patient_http.stream("GET", f"{page}/v1/worlds/main/events") as events:
        assert next(events.iter_lines())
        assert "content-encoding" not in events.headers


def test_rules_on_bodies_hold_below_the_path(below: TestClient) -> None:
    text = below.post(f"{PREFIX}/v1/jobs", content="a", headers={"Content-Type": "text/plain"})
    assert text.status_code == 415
    large = below.post(f"{PREFIX}/v1/jobs", json={"x": "a" * (1 << 20)})
    assert large.status_code == 413
    motion = below.post(f"{PREFIX}/v1/recordings?file_name=a.bvh", content=b"a" * (2 << 20))
    assert motion.status_code == 422


def test_signing_in_works_below_the_path(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path, token=TOKEN))
    below = TestClient(app, base_url=ADDRESS, root_path=PREFIX, follow_redirects=False)
    asked = below.get(f"{PREFIX}/v1/jobs", headers={"Accept": "text/html"})
    assert asked.status_code == 401
    assert f'action="{PREFIX}/session"' in asked.text
    assert f'href="{PREFIX}/favicon.ico"' in asked.text
    assert below.get(f"{PREFIX}/favicon.ico").headers["content-type"] == "image/x-icon"
    signed = below.post(f"{PREFIX}/session", content=f"token={TOKEN}", headers=FORM)
    assert (signed.status_code, signed.headers["location"]) == (303, f"{PREFIX}/")
    assert f"Path={PREFIX};" in signed.headers["set-cookie"]
    assert below.get(f"{PREFIX}/").status_code == 200
    assert below.get(f"{PREFIX}/static/app.js").status_code == 200
