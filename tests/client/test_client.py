"""The generated client against a real server."""

import math
import socket
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime

import httpx
import pytest

from app.api.schemas.task_selection import TaskSelectionRequest
from app.api.schemas.trackers import TrackerCreate
from app.client import Client, Refused, transport
from app.live.commands import PauseClock, ResumeClock
from jobs.spec import EvaluateSpec
from tests.api.live_server import served
from tests.sim.recorded_person import csv_text, working
from tests.support.workshop import definition
from tools.generate_client import TARGET, render

TOKEN = "a-token-of-some-length"


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with served(tmp_path_factory.mktemp("client"), token=TOKEN) as found:
        yield found


@pytest.fixture
def client(address: str) -> Iterator[Client]:
    with Client(address, token=TOKEN) as one:
        yield one


@pytest.fixture
def silent() -> Iterator[str]:
    """Yield the address of a server that takes connections and never answers."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"


def test_operations_are_those_of_the_document() -> None:
    written = {one.stem: one.read_text("utf-8") for one in TARGET.glob("*.py")}
    assert written == render(), "run `make client`"


def test_schema_and_mapping_are_bodies_alike(client: Client) -> None:
    for body in (TrackerCreate(cell="pick-and-place"), {"cell": "pick-and-place"}):
        tracker = client.create_tracker(body)
        assert tracker.n_people == 1
        assert client.get_tracker(tracker.id, t=1.0).tracker == tracker.id
        client.delete_tracker(tracker.id)
        assert tracker.id not in [one.id for one in client.list_trackers().items]


def test_tag_of_a_command_is_sent(client: Client) -> None:
    assert client.command_world("main", PauseClock()).tag == "pause"
    assert client.command_world("main", ResumeClock()).tag == "resume"


def test_stream_ends_with_its_job(client: Client) -> None:
    spec = EvaluateSpec(kind="evaluate", protocol="pick-single", episodes=1)
    job = client.create_job(spec, idempotency_key="once")
    assert client.create_job(spec, idempotency_key="once").id == job.id
    client.cancel_job(job.id)
    found = list(client.stream_job(job.id))
    assert found[-1].event == "end"
    rest = list(client.stream_job(job.id, last_event_id=int(found[-2].id)))
    assert [one.event for one in rest] == ["end"]
    assert job.id in [one.id for one in client.list_jobs(limit=200).items]


def test_stream_of_nothing_is_refused(client: Client) -> None:
    with pytest.raises(Refused, match="404 Not Found: no job 'nothing'"):
        list(client.stream_job("nothing"))


def test_cell_is_kept_and_removed(client: Client) -> None:
    assert client.create_cell(definition()).name == "workshop"
    with pytest.raises(Refused) as refused:
        client.create_cell(definition(title="Another"))
    assert refused.value.problem.status == 409
    client.delete_cell("workshop")


def test_tensors_are_bytes(client: Client) -> None:
    tensors = client.get_checkpoint_tensors("pick")
    assert len(tensors) == client.get_checkpoint("pick").size


def test_refused_value_has_its_rule(client: Client) -> None:
    with pytest.raises(Refused) as refused:
        client.list_jobs(limit=0)
    assert refused.value.problem.field == "limit"


def test_token_is_sent(address: str) -> None:
    with Client(address) as stranger, pytest.raises(Refused, match="401"):
        stranger.list_worlds()


def test_missing_key_points_are_sent_as_nan(client: Client) -> None:
    points = {"neck": [0.0, 1.45, 0.64], "mid_hip": [0.0, 1.45, 0.2], "wrist_r": [math.nan] * 3}
    body = {
        "cell": "pick-and-place",
        "robot": {"q": [0.99, -2.33, 2.08, -1.32, -1.57, 0.0], "qd": [0.0] * 6},
        "people": [{"keypoints": points}],
        "candidates": [{"id": "left", "position": [-0.5, 0.7, 0.12]}],
    }
    for request in (body, TaskSelectionRequest.model_validate(body)):
        (person,) = client.select_task(request).people
        assert "wrist_r" in person.missing
        assert person.unusable == []


@pytest.mark.parametrize("name", [".", "..", "../worlds"])
def test_dots_of_a_name_lead_to_no_other_route(client: Client, name: str) -> None:
    with pytest.raises(Refused) as refused:
        client.get_job(name)
    assert refused.value.problem.status == 404


def test_redirection_is_no_success(client: Client) -> None:
    with pytest.raises(httpx.HTTPStatusError, match="307"):
        client._send("GET /viewer/{}", "main")  # redirected to the one with a slash


def test_a_file_has_more_time_than_other_requests(address: str, silent: str) -> None:
    with Client(silent, timeout_s=1e-3) as hasty, pytest.raises(httpx.ReadTimeout):
        hasty.list_recordings()
    content = csv_text(working(60)).encode()
    with Client(address, token=TOKEN, timeout_s=1e-3) as hasty:
        assert hasty.create_recording(content, file_name="clip.csv", name="nods").name == "nods"
    with Client(address, token=TOKEN) as client:
        client.delete_recording("nods")


def test_time_to_ask_again_is_given_in_seconds_or_as_a_date() -> None:
    later = format_datetime(datetime.now(UTC) + timedelta(seconds=90), usegmt=True)
    found = transport.retry_after_s(later)
    assert found is not None and 80.0 < found <= 90.0
    assert transport.retry_after_s("Fri, 27 Nov 1998 12:00:00 GMT") == 0.0
    assert transport.retry_after_s(" 7 ") == 7.0
    for header in (None, "", "soon", "-1", "Fri, 27 Nov"):
        assert transport.retry_after_s(header) is None


def test_stream_without_a_byte_fails(monkeypatch: pytest.MonkeyPatch, silent: str) -> None:
    monkeypatch.setattr(transport, "SILENCE_S", 0.2)
    with Client(silent, timeout_s=0.2) as one, pytest.raises(httpx.ReadTimeout):
        next(one.stream_world("main"))
