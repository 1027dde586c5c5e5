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
