"""The generated client against a real server."""

from collections.abc import Iterator

import pytest

from app.api.schemas.trackers import TrackerCreate
from app.client import Client, Refused
from app.live.commands import PauseClock, ResumeClock
from jobs.spec import EvaluateSpec
from tests.api.live_server import served
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
