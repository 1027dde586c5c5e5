"""Tests of the pick protocols: equal episodes for all rules, complete rows, stated people."""

import numpy as np
import pytest

from app.errors import InvalidInput, NotFound
from app.policies.checkpoints import pretrained
from app.policies.configs.pick import THESIS
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import PickBench, SelectionInput, observe_exactly
from app.policies.evaluation.registry import evaluate
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.training.pick import start
from app.sim.cells.cell import load_cell
from tests.policies.untrained import shipped_pick_of


@pytest.fixture(scope="module")
def evaluator():
    request = EvaluationRequest(episodes=24, seed=99)
    bench = PickBench(pretrained.load("pick"), request)
    return bench.evaluator(bench.usual)


def view(values, chosen, first=False):
    values = np.array(values, dtype=np.float32)
    n = len(values)
    return SelectionInput(
        values=values,
        distances=np.where(np.isfinite(values), np.arange(values.shape[1])[None] + 1.0, np.inf),
        outcomes=None,
        clearances=np.where(np.isfinite(values), 0.1 - 0.01 * values, -np.inf),
        chosen=np.array(chosen),
        first=first,
        rows=np.arange(n),
    )


def test_every_episode_ends_and_rates_sum_to_one(evaluator):
    row = evaluator.run(selection_rules.critic(0.2)).row("critic")
    total = sum(row[end]["mean"] for end in ("success", "collision", "timeout"))
    assert total == pytest.approx(1.0)
    assert row["n"] == 24


def test_the_same_rule_twice_gives_the_same_episodes(evaluator):
    one, two = (evaluator.run(selection_rules.critic(0.2)) for _ in range(2))
    assert np.array_equal(one.outcome, two.outcome)
    assert np.array_equal(one.duration_s, two.duration_s)


def test_a_fixed_choice_never_switches(evaluator):
    assert evaluator.run(selection_rules.fixed(1)).switches.sum() == 0


def test_hysteresis_keeps_and_zero_follows_the_best():
    seen = view([[1.0, 1.1, -np.inf]], [0])
    assert selection_rules.critic(0.2)(seen).tolist() == [0]
    assert selection_rules.critic(0.0)(seen).tolist() == [1]


def test_random_draws_only_candidates_that_exist():
    seen = view([[0.0, 0.0, -np.inf]] * 500, [0] * 500, first=True)
    drawn = selection_rules.at_random(3, 500)(seen)
    assert set(drawn.tolist()) == {0, 1}


def test_a_result_states_people_and_rechecks_contacts():
    result = evaluate("pick-single", pretrained.load("pick"), episodes=12, seed=4)
    assert result["episodes"] == 12
    assert result["settings"]["hand_speed_median_m_s"] >= 0.4
    assert result["settings"]["hand_speed_p99_m_s"] >= 1.5
    assert result["fcl_recheck"]["missed_contacts"] == 0
    assert result["fcl_recheck"]["poses"] > 100


def test_an_unknown_protocol_names_the_known_ones():
    with pytest.raises(NotFound, match="pick-choice"):
        evaluate("pick-dance", pretrained.load("pick"))


def test_no_episodes_is_refused():
    with pytest.raises(InvalidInput, match="episodes"):
        evaluate("pick-single", pretrained.load("pick"), episodes=0)


def test_the_observation_model_sees_running_rows_only_and_changes_episodes(evaluator):
    running = []

    def no_person(batch, rows):
        running.append(batch.state.outcome[rows])
        observed = observe_exactly(batch, rows)
        q = observed.q.copy()
        q[:, :2] = 100.0
        return observed._replace(q=q, qd=np.zeros_like(q))

    blind = evaluator.run(selection_rules.critic(0.2), observe=no_person)
    assert not np.concatenate(running).any()
    assert not np.array_equal(
        blind.duration_s, evaluator.run(selection_rules.critic(0.2)).duration_s
    )


def test_clearest_and_once_follow_clearances_and_the_first_choice():
    seen = view([[1.0, 2.0, -np.inf]], [0])
    assert selection_rules.clearest(seen).tolist() == [0]
    assert selection_rules.critic_once(seen).tolist() == [0]
    assert selection_rules.critic_once(
        view([[1.0, 2.0, -np.inf]], [0], first=True)
    ).tolist() == [1]


def test_choices_are_compared_on_the_same_episodes():
    result = evaluate("pick-choice", pretrained.load("pick"), episodes=30, seed=5)
    names = [row["name"] for row in result["results"]]
    assert names[0] == "critic" and names[-1] == "oracle"
    rate = {row["name"]: row["success"]["mean"] for row in result["results"]}
    assert [row["name"] for row in result["paired"]] == [f"critic - {one}" for one in names[1:]]
    for row, name in zip(result["paired"], names[1:], strict=True):
        assert row["difference"] == pytest.approx(rate["critic"] - rate[name])
        assert row["only_first"] - row["only_second"] == round(30 * row["difference"])
    assert rate["oracle"] >= max(rate.values())
    assert result["settings"]["grasp"]["close_s"] == 1.25


def test_the_oracle_of_harder_choices_covers_every_target():
    result = evaluate("pick-choice-hard", pretrained.load("pick"), episodes=4, seed=5)
    rate = {row["name"]: row["success"]["mean"] for row in result["results"]}
    numbers = {"two-people": [2, 3], "two-people-4-to-6-targets": [4, 6]}
    for name, candidates in numbers.items():
        assert result["settings"][name]["candidates"] == candidates
        assert rate[f"{name} oracle"] >= rate[f"{name} random"]
        assert time_limits(result["settings"], name) == [12.0, 14.0, 20.0]
        longest = result["settings"][f"{name}-20-s"]
        assert longest["candidates"] == candidates


def test_harder_choices_offer_no_more_targets_than_the_cell_has():
    policy = shipped_pick_of("cube0", "cube2", "cube4", "dock1")
    result = evaluate("pick-choice-hard", policy, episodes=2, seed=5)
    assert set(result["settings"]) == {
        "two-people",
        "faster",
        "two-people-faster",
        "two-people-14-s",
        "two-people-20-s",
        "hysteresis",
    }
    assert time_limits(result["settings"], "two-people") == [12.0, 14.0, 20.0]


def time_limits(settings: Json, name: str) -> list[float]:
    return [settings[f"{name}{end}"]["time_limit_s"] for end in ("", "-14-s", "-20-s")]


def test_cases_count_each_clause_and_keep_the_values_over_time():
    result = evaluate("pick-cases", pretrained.load("pick"), episodes=6, seed=5)
    assert [row["name"] for row in result["results"]] == [f"case-{k}" for k in (1, 2, 3, 4)]
    for row in result["results"]:
        least = min(row[clause]["mean"] for clause in ("first", "switches", "end", "success"))
        assert row["as_expected"]["mean"] <= least
        curve = result["curves"][row["name"]]
        assert curve["t_s"][0] == 0.0 and curve["running"][0] == 1.0
        assert {len(goal) for goal in curve["values"].values()} == {len(curve["t_s"])}


def test_people_at_rest_do_not_move_and_timeouts_have_their_causes():
    result = evaluate("pick-rest", pretrained.load("pick"), episodes=10, seed=5)
    kinds = ("library", "off-task", "reaches", "stops", "works")
    names = [name for kind in kinds for name in (kind, f"{kind}, planner")]
    assert [row["name"] for row in result["results"]] == names
    assert [one["name"] for one in result["paired"]] == [f"{k}, planner - {k}" for k in kinds]
    moves = ["hand_moving_share" in one for one in result["settings"].values()]
    assert moves == [kind in ("stops", "works") for kind in kinds]
    for row in result["results"]:
        assert row["timeout_blocked"]["mean"] <= row["timeout"]["mean"]
        assert row["timeout_alone"]["mean"] <= row["timeout"]["mean"]


def test_reaching_is_evaluated_within_10_s_and_20_s():
    policy = start(THESIS, 4, load_cell(THESIS.cell))[0].policy()
    single = evaluate("pick-single", policy, episodes=12, seed=3)
    assert [row["name"] for row in single["results"]] == ["policy", "20 s policy"]
    assert single["settings"]["time_limit_s"] == 10.0
    assert single["settings"]["grasp"] == "reach only"
    short, long = single["results"]
    assert long["timeout"]["mean"] <= short["timeout"]["mean"]
    assert single["fcl_recheck"]["episodes"] == 12
    choice = evaluate("pick-choice", policy, episodes=4, seed=3)
    names = [row["name"] for row in choice["results"]]
    assert names[0] == "critic" and names[len(names) // 2] == "20 s critic"
    assert {row["name"].split(" - ")[0] for row in choice["paired"]} == {
        "critic",
        "20 s critic",
    }
