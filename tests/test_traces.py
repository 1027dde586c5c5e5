import threading
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.export import BatchSpanProcessor, SimpleSpanProcessor
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

from app.main import create_app
from app.settings import Settings
from app.traces import VARIABLES, finish, provider_of_environment
from tests.api.conftest import wait_until_ready
from tests.api.live_server import running
from tests.jobs.machinery import wait_until
from tests.support import patient_http

ADDRESS = "http://127.0.0.1:8000"


def test_request_decision_and_job_attempt_have_spans(tmp_path: Path) -> None:
    exporter, provider = InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(SimpleSpanProcessor(exporter))
    with TestClient(create_app(Settings(data=tmp_path), provider), base_url=ADDRESS) as client:
        wait_until_ready(client)
        state: dict[str, Any] = client.get("/v1/worlds/main").json()["state"]
        client.post("/v1/task-selection", json=state)
        job = client.post("/v1/jobs", json={"kind": "evaluate", "protocol": "pick-single"})
        wait_until(lambda: client.get(job.headers["location"]).json()["attempt"])
        client.post(job.headers["location"] + "/cancel")
    spans = {span.name: span for span in exporter.get_finished_spans()}
    request, decision = spans["POST /v1/task-selection"], spans["decision"]
    assert request.context is not None and decision.context is not None
    assert decision.context.trace_id == request.context.trace_id
    attributes = spans["job attempt"].attributes or {}
    assert (attributes["job_id"], attributes["attempt"]) == (job.json()["id"], 1)


def test_spans_of_the_end_are_exported(tmp_path: Path) -> None:
    exporter, provider = InMemorySpanExporter(), TracerProvider()
    provider.add_span_processor(BatchSpanProcessor(exporter, schedule_delay_millis=3.6e6))
    app = create_app(Settings(data=tmp_path), provider)
    with running(app, traces=provider) as (_, address):
        patient_http.get(f"{address}/healthz")
        assert not exporter.get_finished_spans()
    assert "GET /healthz" in {span.name for span in exporter.get_finished_spans()}


def test_receiver_that_does_not_answer_delays_the_end_briefly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answered = threading.Event()
    provider = TracerProvider(shutdown_on_exit=False)
    monkeypatch.setattr(provider, "shutdown", answered.wait)
    monkeypatch.setattr("app.traces.EXPORT_S", 0.01)
    finish(provider)
    assert not answered.is_set()
    answered.set()


def test_traces_are_off_without_an_endpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    assert provider_of_environment() is None


def test_traces_are_on_with_an_endpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLES[0], "http://127.0.0.1:1")
    provider = provider_of_environment()
    assert isinstance(provider, TracerProvider)
    provider.shutdown()
