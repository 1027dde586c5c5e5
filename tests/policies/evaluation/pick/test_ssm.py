"""``pick-ssm``: the same episodes with and without the safety layer."""

import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick import ssm
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.pick.ssm import CONDITIONS, run_condition
from app.policies.evaluation.registry import evaluate
from app.policies.evaluation.rows import EvaluationRequest
from tests.policies.untrained import shipped_pick_of

N = 40


@pytest.fixture(scope="module")
def found():
    return evaluate("pick-ssm", pretrained.load("pick"), episodes=N, seed=3)


def test_every_condition_is_a_row_and_states_its_assumptions(found):
    rows = {row["name"]: row for row in found["results"]}
    assert list(rows) == list(CONDITIONS)
    assert {row["n"] for row in rows.values()} == {N}
    stated = found["settings"]["safety"]
    assert stated["ssm"]["protective_distance [m]"] == 0.0
    assert stated["ssm-distance"]["protective_distance [m]"] == 0.3
    assert stated["pfl"]["pfl"] is True
    assert "no-ssm" not in stated
    assert found["settings"]["time_limit_s"] == 20.0


def test_layer_prevents_contacts_of_the_moving_robot_and_costs_time(found):
    rows = {row["name"]: row for row in found["results"]}
    assert rows["no-ssm"]["contacts_moving"] > 0
    assert rows["no-ssm"]["fastest_link_m_s"] > 0.01
    for name in ("ssm", "ssm-short-reaction", "ssm-distance", "choice-ssm", "pfl"):
        assert rows[name]["contacts_moving"] == 0
        assert rows[name]["fastest_link_m_s"] == 0.0
    assert rows["ssm"]["success"]["mean"] > 0.9
    assert rows["ssm"]["time_lost_s"]["mean"] > 1.0
    assert rows["ssm"]["contact_at_rest"]["mean"] > 0.1
    assert rows["no-ssm"]["override"] == pytest.approx(1.0)
    assert rows["no-ssm"]["stopped"] == 0.0
    assert rows["no-ssm"]["time_lost_s"] is None
    stopped = [rows[name]["stopped"] for name in ("ssm-distance", "ssm", "ssm-short-reaction")]
    assert stopped == sorted(stopped, reverse=True)
    assert stopped[-1] > rows["pfl"]["stopped"]


def test_every_episode_has_one_end(found):
    for row in found["results"]:
        ends = ("success", "contact_moving", "contact_admissible", "contact_cell", "timeout")
        assert sum(row[key]["mean"] for key in ends) == pytest.approx(1.0)


def test_layer_is_compared_on_the_same_episodes(found):
    rows = {row["name"]: row for row in found["results"]}
    assert [one["name"] for one in found["paired"]] == [
        f"{name} - {'choice-' if name.startswith('choice') else ''}no-ssm"
        for name in rows
        if not name.endswith("no-ssm")
    ]
    for one in found["paired"]:
        first, second = (rows[name] for name in one["name"].split(" - "))
        gain = first["success"]["mean"] - second["success"]["mean"]
        assert one["difference"] == pytest.approx(gain)
        assert one["only_first"] - one["only_second"] == round(N * gain)


def test_chunks_equal_one_batch(monkeypatch):
    bench = PickBench(pretrained.load("pick"), EvaluationRequest(episodes=12, seed=5))
    whole = run_condition(bench, CONDITIONS["ssm"])
    monkeypatch.setattr(ssm, "CHUNK", 5)
    parts = run_condition(bench, CONDITIONS["ssm"])
    assert whole.seconds.tolist() == parts.seconds.tolist()
    assert whole.override.tolist() == parts.override.tolist()


def test_two_stations_leave_no_choice():
    found = evaluate("pick-ssm", shipped_pick_of("cube0", "dock1"), episodes=2, seed=3)
    names = [row["name"] for row in found["results"]]
    assert names == ["no-ssm", "ssm", "ssm-short-reaction", "ssm-distance", "pfl"]
    assert set(found["settings"]["safety"]) == set(names) - {"no-ssm"}
