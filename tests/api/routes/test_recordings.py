import json
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from urllib.parse import urlencode

import pytest
from fastapi.testclient import TestClient

from app.api.services import MAX_UPLOADS
from app.sim.human.model import Q_MAX
from app.sim.mocap.importer import MAX_BYTES
from tests.api.answers import problem_of
from tests.api.conftest import services_of
from tests.sim.mocap.test_importer import with_leap
from tests.sim.recorded_person import bvh_text, csv_text, working

CLIP = bvh_text(working(200)).encode()
UNDECLARED = csv_text(working(100)).partition("\n")[2].encode()
FILE = {"Content-Type": "application/octet-stream"}


def post(client: TestClient, content: bytes, **asked: str) -> Any:
    return client.post("/v1/recordings", params=asked, content=content, headers=FILE)


@pytest.fixture(scope="module")
def posted(client: TestClient) -> Iterator[dict[str, Any]]:
    """The answer to a recording that was posted; the recording is removed in the end."""
    answer = post(client, with_leap(slice(100, 103)).encode(), file_name="Leap 1.bvh")
    assert answer.status_code == 201
    assert answer.headers["Location"] == "/v1/recordings/leap-1"
    yield answer.json()
    client.delete("/v1/recordings/leap-1")


def test_without_recordings_the_list_is_empty(client: TestClient) -> None:
    assert client.get("/v1/recordings").json() == {"items": []}


def test_posted_recording_says_what_was_found(posted: dict[str, Any]) -> None:
    assert (posted["name"], posted["file_name"]) == ("leap-1", "Leap 1.bvh")
    assert (posted["format"], posted["unit"], posted["frames"]) == ("bvh", "mm", 200)
    assert posted["duration_s"] == pytest.approx(3.98)
    first, second = posted["clean_runs"]
    assert (first["first"], second["last"], posted["n_runs"]) == (0, 199, 2)
    assert first["duration_s"] == pytest.approx(0.02 * first["last"])
    n_clean = sum(run["last"] - run["first"] + 1 for run in posted["clean_runs"])
    assert posted["clean_frames"] == n_clean < 200
    (artifact,) = posted["artifacts"]
    assert "wrist_r" in artifact["parts"] and artifact["speed"] > 3.0
    assert 0.0 <= posted["error_mm"]["wrists"]["p99"] < 1.0
    assert posted["body_m"]["forearm_r"] == pytest.approx(0.26)


def test_posted_recording_is_kept_and_listed(
    client: TestClient, posted: dict[str, Any]
) -> None:
    assert client.get("/v1/recordings/leap-1").json() == posted
    (item,) = client.get("/v1/recordings").json()["items"]
    assert item == {k: v for k, v in posted.items() if k not in ("clean_runs", "artifacts")}


def test_runs_of_a_posted_recording_are_there_for_the_service(
    client: TestClient, posted: dict[str, Any]
) -> None:
    services = services_of(client)
    runs = services.recordings.get(posted["name"])
    assert [run.first_frame for run in runs] == [run["first"] for run in posted["clean_runs"]]
    assert all(run.q.shape == (len(run.times), 18) for run in runs)


def test_unit_and_up_axis_can_be_stated(client: TestClient) -> None:
    answer = post(client, CLIP, file_name="stated.bvh", unit="0.0011", up="y")
    client.delete("/v1/recordings/stated")
    assert answer.status_code == 201
    assert answer.json()["options"] == {"unit": "0.0011", "up": "y"}
    assert answer.json()["body_m"]["forearm_r"] == pytest.approx(0.286)


def test_columns_can_be_mapped(client: TestClient) -> None:
    text = csv_text(working(100)).replace("elbow_r", "coude d").replace("elbow_l", "coude g")
    asked = {"file_name": "coude.csv", "map": ["coude d=elbow_r", "coude g=elbow_l"]}
    answer = client.post("/v1/recordings", params=asked, content=text.encode(), headers=FILE)
    client.delete("/v1/recordings/coude")
    assert answer.status_code == 201, answer.json()
    assert answer.json()["options"] == {"names": {"coude d": "elbow_r", "coude g": "elbow_l"}}


@pytest.mark.parametrize(
    ("pairs", "text"),
    [
        (["coude d"], "must be theirs=ours"),
        (["a=elbow_l", "b=elbow_l"], "must be the only name for elbow_l"),
        (["elbow_l=ellbow"], "choices: time, pelvis_x"),
        (["ellbow_l=elbow_l"], "nearly the same: elbow_l"),
        (["\ud800=elbow_l"], "is the name of no column"),
        (["a\x07=elbow_l"], "must have only characters that can be shown"),
    ],
)
def test_map_that_does_not_fit_is_a_problem(
    client: TestClient, pairs: list[str], text: str
) -> None:
    content = csv_text(working(100)).encode()
    query = urlencode(
        [("file_name", "a.csv"), *(("map", one) for one in pairs)], errors="surrogatepass"
    )
    answer = client.post(f"/v1/recordings?{query}", content=content, headers=FILE)
    assert answer.status_code == 422
    assert text in json.dumps(answer.json(), ensure_ascii=False)


@pytest.mark.parametrize("field", ["unit", "root_unit", "up"])
def test_option_that_is_none_is_refused_with_the_choices(
    client: TestClient, field: str
) -> None:
    problem = problem_of(post(client, CLIP, file_name="stated.bvh", **{field: "furlong"}))
    assert problem["field"] == field and problem["choices"]


def test_joints_beyond_their_limits_are_reported(client: TestClient) -> None:
    q = working(100)
    q[:, 13] = Q_MAX[13] + 0.2
    answer = post(client, csv_text(q).encode(), file_name="bent.csv")
    client.delete("/v1/recordings/bent")
    beyond = answer.json()["beyond_limits"]["elbow_r"]
    assert beyond == {"share": 1.0, "farthest_rad": pytest.approx(0.2, abs=1e-6)}


def test_same_file_again_is_fine_and_another_one_a_conflict(
    client: TestClient, posted: dict[str, Any]
) -> None:
    content = with_leap(slice(100, 103)).encode()
    again = post(client, content, file_name="Leap 1.bvh")
    assert (again.status_code, again.json()) == (200, posted)
    other = post(client, CLIP, file_name="leap-1.bvh")
    assert other.status_code == 409
    assert "'leap-1' from another file is stored: remove it first" in other.json()["detail"]
    assert (other.json()["field"], other.json()["value"]) == ("name", "'leap-1'")
    named = post(client, CLIP, file_name="leap-1.bvh", name="leap-2")
    client.delete("/v1/recordings/leap-2")
    assert named.status_code == 201


def test_same_file_posted_by_two_at_once_is_stored_once(client: TestClient) -> None:
    with ThreadPoolExecutor(2) as pool:
        both = [pool.submit(post, client, CLIP, file_name="twice.bvh") for _ in range(2)]
        answers = [one.result() for one in both]
    client.delete("/v1/recordings/twice")
    assert sorted(one.status_code for one in answers) == [200, 201]
    assert answers[0].json() == answers[1].json()


def test_unknown_recording_is_not_found_with_the_known_ones(
    client: TestClient, posted: dict[str, Any]
) -> None:
    for name, status in (("walk", 404), ("..%2Fleap-1", 404), ("%00", 422)):
        answer = client.get(f"/v1/recordings/{name}")
        assert answer.status_code == status
    assert client.get("/v1/recordings/walk").json()["known"] == [posted["name"]]


TWICE = CLIP.replace(b"Frames: 200", b"Frames: 300")
BAD_NUMBER = CLIP.rpartition(b" ")[0] + b" north\n"
IN_RADIANS = csv_text(working(100), degrees=False).replace("radians", "degrees").encode()


@pytest.mark.parametrize(
    ("content", "file_name", "field", "rule"),
    [
        (b"", "a.bvh", "file", "is empty"),
        (b"\n \n", "a.csv", "file", "is empty"),
        (b"\xff\xfd", "a.bvh", "file", "must be text in UTF-8"),
        (b"\x80\x04K\x01.", "a.csv", "file", "must be text in UTF-8"),
        (b"\x00" * 5000, "a.bvh", "line 1", "has no line MOTION"),
        (CLIP, "a.c3d", "file_name", "must end with .bvh, .mot, .sto, .csv"),
        (CLIP, "a", "file_name", "must end with"),
        (CLIP, "a.csv", "line 1", "lacks the columns pelvis_x"),
        (UNDECLARED, "a.csv", "angles", "must be declared in a comment"),
        (CLIP[: len(CLIP) // 2], "a.bvh", "line ", "must hold"),
        (CLIP[:400], "a.bvh", "line ", "has no line MOTION"),
        (TWICE, "a.bvh", "frames, last line ", "must be the 300 that the head"),
        (BAD_NUMBER, "a.bvh", "line ", "must be a number"),
        (IN_RADIANS, "a.csv", "column ", "radians"),
        (bvh_text(working(25)).encode(), "a.bvh", "frames", "has no run of 1 s"),
        (CLIP, "a\n.bvh", "file_name", "characters that can be shown"),
        (CLIP, "", "file_name", "must name a file"),
        (CLIP, "动作.bvh", "name", "must be given"),
    ],
)
def test_file_that_is_no_recording_is_named_with_place_and_rule(
    client: TestClient, content: bytes, file_name: str, field: str, rule: str
) -> None:
    stored = client.get("/v1/recordings").json()
    problem = problem_of(post(client, content, file_name=file_name))
    assert problem["field"].startswith(field)
    assert rule in problem["rule"] + str(problem.get("errors", ""))
    assert {"value", "choices"} <= problem.keys()
    assert client.get("/v1/recordings").json() == stored


@pytest.mark.parametrize("pair", ["spine=pelvis_xyz", "nobody=pelvis_x"])
def test_wrong_name_map_is_named_as_its_parameter(client: TestClient, pair: str) -> None:
    problem = problem_of(
        post(client, csv_text(working(100)).encode(), file_name="a.csv", map=pair)
    )
    assert problem["field"] == "map" and problem["value"] and problem["rule"]


def test_unknown_unit_is_named(client: TestClient) -> None:
    content = bvh_text(working(200), unit=0.000_001).encode()
    assert "unit" in problem_of(post(client, content, file_name="tiny.bvh"))["detail"]


def test_name_that_cannot_be_one_is_refused(client: TestClient) -> None:
    assert problem_of(post(client, CLIP, file_name="a.bvh", name="A b"))["field"] == "name"


def test_file_name_is_asked_for(client: TestClient) -> None:
    problem = problem_of(client.post("/v1/recordings", content=CLIP, headers=FILE))
    assert (problem["field"], problem["rule"]) == ("file_name", "is required")


def test_file_over_the_limit_is_refused(client: TestClient) -> None:
    length = {**FILE, "Content-Length": str(MAX_BYTES + 1)}
    answer = client.post("/v1/recordings?file_name=a.bvh", content=b"x", headers=length)
    problem = problem_of(answer, 413)
    assert problem["field"] == "body" and str(MAX_BYTES) in problem["rule"]
    chunks = (b" " * (1 << 20) for _ in range(33))
    answer = client.post("/v1/recordings?file_name=a.bvh", content=chunks, headers=FILE)
    chunked = problem_of(answer, 413)
    assert chunked.keys() == problem.keys() and answer.headers["Connection"] == "close"
    assert [chunked[one] for one in ("type", "field", "value", "rule")] == [
        "urn:tandem:problem:body-too-large",
        "body",
        f"more than {MAX_BYTES} bytes",
        problem["rule"],
    ]


def test_file_over_the_limit_of_json_is_read(client: TestClient) -> None:
    answer = post(client, b" " * (2 << 20), file_name="a.bvh")
    assert (answer.status_code, answer.json()["rule"]) == (422, "is empty")


def test_form_is_no_file(client: TestClient) -> None:
    answer = client.post("/v1/recordings?file_name=a.bvh", files={"file": CLIP})
    problem = problem_of(answer, 415)
    assert problem["field"] == "Content-Type"
    assert "application/octet-stream" in problem["choices"]


def test_file_of_no_stated_type_is_taken_and_removed(client: TestClient) -> None:
    answer = client.post("/v1/recordings?file_name=plain.bvh", content=CLIP)
    assert "content-type" not in answer.request.headers
    assert answer.status_code == 201
    assert client.delete("/v1/recordings/plain").status_code == 204
    assert client.get("/v1/recordings/plain").status_code == 404
    assert client.delete("/v1/recordings/plain").status_code == 404


def test_only_so_many_files_are_taken_in_at_once(client: TestClient) -> None:
    uploads = services_of(client).uploads
    for _ in range(MAX_UPLOADS):
        assert uploads.acquire(blocking=False)
    try:
        answer = post(client, CLIP, file_name="late.bvh")
    finally:
        uploads.release(MAX_UPLOADS)
    assert answer.headers["Retry-After"] == "2"
    assert "4 files are being read" in problem_of(answer, 503)["detail"]


def test_refused_files_leave_room_for_the_next(client: TestClient) -> None:
    for _ in range(MAX_UPLOADS + 1):
        assert post(client, b"", file_name="a.bvh").status_code == 422
    chunks = (b" " * (1 << 20) for _ in range(33))
    client.post("/v1/recordings?file_name=a.bvh", content=chunks, headers=FILE)
    uploads = services_of(client).uploads
    for _ in range(MAX_UPLOADS):
        assert uploads.acquire(blocking=False)
    uploads.release(MAX_UPLOADS)


def test_description_of_the_api_tells_the_units(client: TestClient) -> None:
    api = client.get("/openapi.json").json()
    body = api["paths"]["/v1/recordings"]["post"]["requestBody"]["content"]
    assert set(body) == {"application/octet-stream", "text/plain", "text/csv"}
    fields = api["components"]["schemas"]["RecordingPublic"]["properties"]
    assert "[mm]" in fields["error_mm"]["description"]
    assert "[m]" in fields["body_m"]["description"]
