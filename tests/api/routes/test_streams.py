import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx

from app.main import create_app
from app.settings import Settings
from tests.api.live_server import running, wait_until_ready
from tests.support import patient_http


def events(response: httpx.Response) -> Iterator[tuple[str, str, Any]]:
    """Yield name, id and data of the events of a stream."""
    fields: dict[str, str] = {}
    for line in response.iter_lines():
        if not line and "data" in fields:
            yield fields.get("event", ""), fields.get("id", ""), json.loads(fields["data"])
            fields = {}
        elif line and not line.startswith(":"):
            name, _, text = line.partition(": ")
            fields[name] = text


def test_world_streams_light_snapshots_as_time_goes_on(address: str) -> None:
    with patient_http.stream("GET", f"{address}/v1/worlds/main/events") as response:
        assert response.headers["content-type"].startswith("text/event-stream")
        stream = events(response)
        seen = [next(stream) for _ in range(3)]
    ticks = [data["tick"] for _, _, data in seen]
    assert ticks == sorted(set(ticks))
    assert all(name == "snapshot" for name, _, _ in seen)
    assert {"chosen", "candidates", "message", "clearance_m"} <= seen[0][2].keys()


def test_stream_tells_of_the_people_without_their_joints(address: str) -> None:
    with patient_http.stream("GET", f"{address}/v1/worlds/main/events") as response:
        _, _, data = next(events(response))
    (person,) = data["people"]
    assert (person["id"], person["mode"], person["anthropometry"]["stature"]) == (
        0,
        "auto",
        50.0,
    )
    assert "q" not in person


def test_stream_of_a_world_ends_when_it_is_restarted(address: str) -> None:
    with patient_http.stream("GET", f"{address}/v1/worlds/main/events") as response:
        stream = events(response)
        next(stream)
        world = f"{address}/v1/worlds/main"
        patient_http.put(f"{world}/cell", json={"cell": "pick-and-place"})
        assert [name for name, _, _ in stream][-1] == "end"
    assert patient_http.get(world).json()["tick"] >= 0


def test_job_streams_its_curve_without_gap_or_duplicate_and_then_ends(address: str) -> None:
    learning = {
        "total_steps": 1280,
        "progress_steps": 128,
        "checkpoint_steps": 640,
        "buffer_size": 2048,
        "learning_starts": 640,
        "batch_size": 16,
    }
    overrides = {"learning": learning, "networks": {"width": 16}}
    body = {"kind": "train", "preset": "pick-td3", "seed": 1, "overrides": overrides}
    job = patient_http.post(f"{address}/v1/jobs", json=body).json()["id"]
    with patient_http.stream("GET", f"{address}/v1/jobs/{job}/events") as response:
        seen = list(events(response))
    assert [data["state"] for name, _, data in seen if name == "state"][-1] == "succeeded"
    steps = [data["step"] for name, _, data in seen if name == "progress"]
    assert steps == list(range(128, 1281, 128))
    stored = patient_http.get(f"{address}/v1/jobs/{job}/metrics?after_step=640").json()["items"]
    assert [row["step"] for row in stored] == list(range(768, 1281, 128))
    made = patient_http.get(f"{address}/v1/checkpoints?job_id={job}").json()["items"]
    assert {one["step"] for one in made} == {640, 1280}


def test_open_streams_do_not_hold_up_the_end(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path / "data"))
    with running(app) as (server, address):
        wait_until_ready(address)
        open_stream, ended = threading.Event(), threading.Event()

        def follow() -> None:
            with patient_http.stream("GET", f"{address}/v1/worlds/main/events") as response:
                for _ in events(response):
                    open_stream.set()
            ended.set()

        threading.Thread(target=follow).start()
        assert open_stream.wait(20.0)
        server.handle_exit(0, None)
        assert ended.wait(10.0)
