from html.parser import HTMLParser

from fastapi.testclient import TestClient


class Links(HTMLParser):
    """Collects every address that a page would load or lead to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [value or "" for name, value in attrs if name in ("src", "href")]


def test_docs_describe_every_route_without_outside_help(client: TestClient) -> None:
    page = client.get("/docs")
    for path in client.get("/openapi.json").json()["paths"]:
        assert path in page.text
    links = Links()
    links.feed(page.text)
    assert links.found == ["static/favicon.svg", "openapi.json"]


def operation(client: TestClient, method: str, path: str) -> str:
    """Return the part of the page that describes an operation."""
    for part in client.get("/docs").text.split("<details>"):
        if f"<span class=method>{method}</span><code>{path}</code>" in part:
            return part
    raise AssertionError(f"{method} {path} is not described")


def test_docs_describe_the_body_of_every_operation(client: TestClient) -> None:
    resume = operation(client, "POST", "/v1/jobs/{job_id}/resume")
    assert "<p>changed budgets; without one they stay</p>" in resume
    budget = "<code>step_budget ?</code><td class=faint>integer | null &gt;= 1, &lt;="
    assert budget in resume
    clone = operation(client, "POST", "/v1/jobs/{job_id}/clone")
    assert "<p>fields that differ from the job&#x27;s spec, as a JSON merge patch" in clone
    for method, path in (
        ("POST", "/v1/recordings"),
        ("POST", "/v1/checkpoints"),
        ("PUT", "/v1/jobs/{job_id}/attempts/{attempt}/files/{sha256}"),
    ):
        part = operation(client, method, path)
        body = "<code>application/octet-stream</code><td class=faint>bytes"
        assert body in part.partition("<h3>Body</h3>")[2].partition("<h3>Answer")[0]
    assert "followed by the safetensors file" in operation(client, "POST", "/v1/checkpoints")


def test_units_reach_the_description(client: TestClient) -> None:
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    assert "[rad/s]" in schemas["RobotState"]["properties"]["qd"]["description"]


def test_page_of_the_cell_is_served(client: TestClient) -> None:
    page = client.get("/")
    assert page.headers["content-type"].startswith("text/html")
    links = Links()
    links.feed(page.text)
    for address in links.found:
        assert client.get(address).status_code == 200, address
