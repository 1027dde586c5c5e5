from fastapi.testclient import TestClient


def test_cells_are_listed_with_stations_and_case_studies(client: TestClient) -> None:
    cell = client.get("/v1/cells").json()["items"][0]
    assert cell["name"] == "pick-and-place"
    names = [station["id"] for station in cell["stations"]]
    assert {"cube0", "cube5", "dock0", "dock1"} <= set(names)
    assert [case["id"] for case in cell["cases"]] == ["case-1", "case-2", "case-3", "case-4"]
    assert client.get("/v1/cells/pick-and-place").json() == cell


def test_unknown_cell_is_not_found_with_the_known_ones(client: TestClient) -> None:
    answer = client.get("/v1/cells/kitchen")
    assert answer.status_code == 404
    assert answer.json()["known"] == ["pick-and-place"]
