"""Pages state the constants and fields that the code has."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.special import logit

from app.api.problems import MAX_LISTED_ERRORS, Problem
from app.policies.configs.pick import PICK
from app.policies.configs.presets import PRESETS
from app.policies.configs.sorting import SORTING_PRESETS
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.networks.outcome import MEMBERS, N_OUT, combine
from app.sim.mocap.faults import MAX_FAULTS
from app.sim.sorting.kernels.reward import distance_cost
from app.sim.sorting.near_optimal_moves import MARGIN
from app.store.cells import MAX_CELLS

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES = [page for page in sorted(DOCS.glob("**/*.md")) if "notebook" not in page.parts]
FIELD = re.compile(
    r"\b((?:learning|networks|exploration|episode|people|action|reward|expert)\.[a-z_]+)\s*="
)


def section(page: str, number: str) -> str:
    """Text of a section of a page, without those below it."""
    return re.split(rf"^#+ {re.escape(number)} .*\n", page, flags=re.MULTILINE)[1].split(
        "\n## "
    )[0]


def rows(text: str) -> dict[str, list[str]]:
    """Cells of the tables of a text by the first cell."""
    found = re.findall(r"^\| (.+) \|$", text, re.MULTILINE)
    return {line.split(" | ")[0]: line.split(" | ")[1:] for line in found}


METHOD = (DOCS / "method.md").read_text("utf-8")


def test_the_glossary_states_the_margins_of_selections() -> None:
    glossary = rows((DOCS / "glossary.md").read_text("utf-8"))
    assert float(glossary["hysteresis"][1]) == HYSTERESIS
    assert f" {MARGIN:g} " in glossary["near-optimal move"][0]


def test_errors_are_stated_with_the_number_that_is_listed() -> None:
    page = " ".join((DOCS / "http.md").read_text("utf-8").split())
    described = Problem.model_fields["errors"].description or ""
    assert MAX_LISTED_ERRORS == MAX_FAULTS
    assert f"faults of a body or of the parameters, at most {MAX_LISTED_ERRORS}," in page
    assert f"at most {MAX_LISTED_ERRORS}" in described


def test_the_method_states_the_reward_of_sorting() -> None:
    stated = rows(section(METHOD, "1.3"))
    presets = {preset.name: preset.reward for preset in SORTING_PRESETS}
    for column, name in enumerate(("sorting-e0-dqn", "sorting-e0-thesis"), start=1):
        for term, field in (("empty", "empty"), ("fail", "fail"), ("back", "back")):
            cell = stated[f"$r_{{{term}}}$"][column]
            assert float(cell) == -getattr(presets[name], f"c_{field}")
        assert float(stated["$w_{dist}$"][column]) == presets[name].c_distance


def test_the_sorting_page_states_the_cost_of_a_level() -> None:
    page = (DOCS / "sorting.md").read_text("utf-8")
    (cost,) = re.findall(r"^\| each level .* \| -([0-9.]+) / `K` \|$", page, re.MULTILINE)
    towers, goal = np.zeros((2, 2, 10), dtype=np.int8)
    goal[0, 0] = 1
    weights = SORTING_PRESETS[0].reward.weights
    assert distance_cost(towers, goal, 3, weights) == pytest.approx(float(cost) / 10)


def test_the_sorting_results_state_the_throughput_that_they_list() -> None:
    stored = json.loads((DOCS / "results/sorting-cycle-time.json").read_text("utf-8"))
    parts = {row["name"]: row["parts_per_hour"]["mean"] for row in stored["results"]}
    lost = {name: 1.0 - parts[name] / parts["alone"] for name in parts}
    page = " ".join((DOCS / "results/sorting.md").read_text("utf-8").split())
    policy, nearest, straight = re.findall(
        r"costs the policy (\d+) % of .* \((\d+) % with the nearest object first\) "
        r"and straight moves (\d+) %",
        page,
    )[0]
    assert int(policy) == round(100 * lost["policy"])
    assert int(nearest) == round(100 * lost["policy-nearest"])
    assert int(straight) == round(100 * lost["planner"])


def test_the_http_page_states_how_many_cells_are_stored() -> None:
    (most,) = re.findall(r"or (\d+) cells are stored", (DOCS / "http.md").read_text("utf-8"))
    assert int(most) == MAX_CELLS


def test_the_method_states_the_reward_of_picks() -> None:
    stated, reward = rows(section(METHOD, "3.3")), PICK.reward
    assert float(stated["$c_d$"][1]) == reward.c_d
    assert float(stated["$c_\\theta$"][1]) == reward.c_th
    assert stated["$c_c$"][1].startswith(f"{reward.c_c:g}, growing to {reward.c_c_end:g} ")
    assert float(stated["$c_{step}$"][1]) == reward.c_step
    assert float(stated["$c_s$"][1]) == reward.c_s


def test_the_method_states_the_interval_of_outcome_probabilities() -> None:
    scores = np.random.default_rng(1).normal(size=(MEMBERS, 5, N_OUT)).astype(np.float32)
    shares = np.exp(scores[..., :-1])
    shares /= shares.sum(axis=-1, keepdims=True)
    between = np.array([[-0.3, 0.2], [-0.5, 0.9], [-0.7, 0.0]], dtype=np.float32)
    found = combine(scores, 1.0, between)
    (stated,) = re.findall(r"\\sigma = ([0-9.]+) \\frac{s}{p", section(METHOD, "3.6"))
    mean = shares.mean(axis=0)
    spread = float(stated) * shares.std(axis=0, ddof=1) / (mean * (1.0 - mean))
    for end, side, offset in zip((found.low, found.high), (-1.0, 1.0), between.T, strict=True):
        odds = logit(mean) + side * np.hypot(spread, offset)
        np.testing.assert_allclose(logit(end), odds, rtol=1e-4, atol=1e-4)


def test_fields_of_presets_that_pages_name_exist() -> None:
    known = {
        f"{group}.{name}"
        for preset in PRESETS.values()
        for group, fields in preset.model_dump().items()
        if isinstance(fields, dict)
        for name in fields
    }
    named = {(page.name, found) for page in PAGES for found in FIELD.findall(page.read_text())}
    assert len(named) > 10
    assert {one for one in named if one[1] not in known} == set()
