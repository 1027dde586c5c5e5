from fastapi.testclient import TestClient

from tests.api.answers import problem_of


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


def test_episodes_without_measuring_are_refused(client: TestClient) -> None:
    refused = client.post("/v1/jobs", json={"kind": "report", "episodes": 5})
    assert (refused.status_code, refused.json()["field"]) == (422, "episodes")
