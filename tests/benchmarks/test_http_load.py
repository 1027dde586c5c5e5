import pytest

from tests.api.live_server import running
from tests.benchmarks.http_load import Request, load
from tests.benchmarks.http_servers import bare_app

TASK = {"id": "left", "position": [-0.5, 0.7, 0.12]}


def test_every_client_posts_again_until_the_time_is_over() -> None:
    with running(bare_app()) as (_, address):
        found = load(address, Request(path="/", body=TASK), clients=4, seconds=0.0)
        assert len(found.times_ms) == 4
        found = load(address, Request(path="/", body=TASK), clients=4, seconds=0.2)
    assert len(found.times_ms) >= 4
    assert (found.times_ms > 0.0).all() and found.per_second > 0.0


def test_an_answer_other_than_200_ends_the_load() -> None:
    with running(bare_app()) as (_, address):
        with pytest.raises(RuntimeError, match="status 422.*position"):
            load(address, Request(path="/", body={"id": "left"}), clients=2, seconds=1.0)
        with pytest.raises(RuntimeError, match="status 404"):
            load(address, Request(path="/v1/jobs"), clients=1, seconds=1.0)
