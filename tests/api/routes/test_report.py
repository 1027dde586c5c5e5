from pathlib import Path

from fastapi.testclient import TestClient

from app.store import composed_jobs, jobs
from app.store.engine import Store
from app.store.records import NewJob
from tests.api.answers import problem_of
from tests.api.conftest import ADDRESS
from tests.support.idle_service import app_of, idle_service


def test_report_is_a_page_with_figures_that_loads_nothing(client: TestClient) -> None:
    job = client.post("/v1/jobs", json={"kind": "report", "name": "<b>x</b>"}).json()
    client.get(f"/v1/jobs/{job['id']}/events")  # ends with the job
    answer = client.get(f"/v1/jobs/{job['id']}/report")
    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'") and "sandbox" in policy
    assert f"<title>Tandem, report {job['number']}</title>" in answer.text
    assert "Table 4.3" in answer.text and "data:image/png;base64," in answer.text
    assert "<b>x</b>" not in answer.text


def test_report_without_a_page_and_other_jobs_are_refused(client: TestClient) -> None:
    body = {"kind": "report", "measure": True, "priority": -100}
    report = client.post("/v1/jobs", json=body).json()
    assert problem_of(client.get(f"/v1/jobs/{report['id']}/report"), 409)["field"] == "state"
    client.post(f"/v1/jobs/{report['id']}/cancel")
    client.get(f"/v1/jobs/{report['id']}/events")  # ends with its evaluations
    evaluation = {"kind": "evaluate", "protocol": "pick-single", "priority": -100}
    other = client.post("/v1/jobs", json=evaluation).json()
    client.post(f"/v1/jobs/{other['id']}/cancel")
    for job_id in (other["id"], "nothing"):
        assert client.get(f"/v1/jobs/{job_id}/report").status_code == 404


def test_report_whose_result_is_damaged_has_no_page(store: Store, tmp_path: Path) -> None:
    job = jobs.create_job(store, NewJob(kind="report", spec={"kind": "report"}))
    composed_jobs.start(store, job.id)
    composed_jobs.end(store, job.id, "succeeded", result={})
    with TestClient(app_of(idle_service(store, tmp_path)), base_url=ADDRESS) as idle:
        refused = idle.get(f"/v1/jobs/{job.id}/report")
    assert problem_of(refused, 404)["name"] == job.id


def test_episodes_without_measuring_are_refused(client: TestClient) -> None:
    refused = client.post("/v1/jobs", json={"kind": "report", "episodes": 5})
    assert (refused.status_code, refused.json()["field"]) == (422, "episodes")
