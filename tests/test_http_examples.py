"""The commands of the documents, run as written against a real server."""

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.registry import PROTOCOLS
from tests.api.live_server import served

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "http.md").read_text("utf-8")
SHELL = re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)
JOB = next(k for k, text in enumerate(SHELL) if "my-first-job" in text)
"""The example that posts a job; the first, SORT and the last have tests of their own, too."""
SORT = next(k for k, text in enumerate(SHELL) if "/v1/sorting" in text)
OTHERS = [text for k, text in enumerate(SHELL[:-1]) if k not in (0, JOB, SORT)]
DECIDES = re.compile(
    r"/v1/(task-selection|motion|sorting|plan|risk-map|trackers/\$\w+/frames)(?![\w/])"
)
DECISIONS = [
    text
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
    for text in re.findall(r"```sh\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    if DECIDES.search(text)
]
PYTHON = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
SAMPLES = [json.loads(one) for one in re.findall(r"```json\n(.*?)```", TEXT, re.DOTALL)]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    if shutil.which("curl") is None:
        pytest.skip("needs curl")
    with served(tmp_path_factory.mktemp("examples")) as found:
        yield found


def shell(text: str, address: str) -> str:
    script = text.replace("http://127.0.0.1:8000", address)
    done = subprocess.run(
        ["bash", "-ec", script], capture_output=True, text=True, timeout=60.0, check=True
    )
    return done.stdout


def shape(value: Any) -> Any:
    """Return the names and kinds of a JSON value, without its numbers and texts."""
    if isinstance(value, dict):
        return {name: shape(member) for name, member in value.items()}
    if isinstance(value, list):
        return [shape(member) for member in value]
    return "number" if isinstance(value, int | float) else type(value).__name__


def assert_same_outcome(answered: Any, shown: Any) -> None:
    for what in ("success", "contact"):
        assert answered[what] == pytest.approx(shown[what], abs=0.02)
    assert answered["time_s"] == pytest.approx(shown["time_s"], abs=0.1)


def flagged(value: Any, place: str = "") -> list[str]:
    """Return what an answer flags: where, and what."""
    if isinstance(value, list):
        return [one for k, item in enumerate(value) for one in flagged(item, f"{place}[{k}]")]
    if not isinstance(value, dict):
        return []
    found = [
        f"{place}.{name} = {value[name]}"
        for name in ("flags", "outside", "state_outside", "unfeasible", "outliers")
        if value.get(name)
    ]
    return found + [
        one for name, item in value.items() for one in flagged(item, f"{place}.{name}")
    ]


def test_every_route_that_decides_is_documented_by_a_request() -> None:
    found = {one.split("/")[0] for text in DECISIONS for one in DECIDES.findall(text)}
    assert found == {"task-selection", "motion", "sorting", "plan", "risk-map", "trackers"}


@pytest.mark.parametrize("text", DECISIONS)
def test_documented_request_is_answered_without_a_flag(text: str, address: str) -> None:
    output = shell(text.replace("curl -s ", "curl -sf "), address)
    answer = json.loads(output)
    assert flagged(answer) == []


@pytest.mark.parametrize("text", PYTHON)
def test_python_example_runs(
    text: str, address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    exec(compile(text.replace("http://127.0.0.1:8000", address), "example", "exec"), {})
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("cube")
    assert lines[-2] == "end {'state': 'cancelled'}"
    assert lines[-1].startswith("preset is not a preset ['pick-td3'")


def test_what_is_flagged_is_found_wherever_it_is() -> None:
    answer = {"people": [{"flags": []}, {"flags": ["far"]}], "outside": [{"field": "x"}]}
    assert flagged(answer) == [".outside = [{'field': 'x'}]", ".people[1].flags = ['far']"]


def test_task_selection_answers_in_the_shape_that_is_shown(address: str) -> None:
    answer = json.loads(shell(SHELL[0], address))
    assert shape(answer) == shape(SAMPLES[0])
    assert answer["chosen"] == SAMPLES[0]["chosen"]
    for one, shown in zip(answer["candidates"], SAMPLES[0]["candidates"], strict=True):
        assert one["value"] == pytest.approx(shown["value"], abs=0.02)
        assert_same_outcome(one["outcome"], shown["outcome"])


def test_motion_answers_as_is_shown(address: str) -> None:
    (command,) = (one for one in SHELL if "8000/v1/motion " in one)
    (shown,) = (sample for sample in SAMPLES if "commanded" in sample)
    answer = json.loads(shell(command, address))
    assert answer["checkpoint"].startswith(shown["checkpoint"])
    assert answer["act"] == pytest.approx(shown["act"], abs=0.02)
    for one, two in zip(
        answer["commanded"]["coefficients"], shown["commanded"]["coefficients"], strict=True
    ):
        assert one == pytest.approx(two, abs=1e-3)


def test_plan_answers_as_is_shown(address: str) -> None:
    (command,) = (one for one in SHELL if "8000/v1/plan " in one)
    (shown,) = (sample for sample in SAMPLES if "symbol" in sample)
    answer = json.loads(shell(command, address))
    assert shape(answer) == shape(shown)
    assert (answer["symbol"], answer["move"]) == (shown["symbol"], shown["move"])
    for one, two in zip(answer["moves"], shown["moves"], strict=True):
        for motion in ("to_object", "to_place"):
            assert one[motion]["value"] == pytest.approx(two[motion]["value"], abs=0.02)
            assert_same_outcome(one[motion]["outcome"], two[motion]["outcome"])


def test_risk_map_answers_as_is_shown(address: str) -> None:
    (command,) = (one for one in SHELL if "8000/v1/risk-map " in one)
    (shown,) = (sample for sample in SAMPLES if "reason" in sample)
    answer = json.loads(shell(command, address))
    assert shape(answer) == shape(shown)
    assert (answer["chosen"], answer["reason"]) == (shown["chosen"], shown["reason"])
    for what in ("success", "contact"):
        for one, two in zip(answer[what], shown[what], strict=True):
            assert one == pytest.approx(two, abs=0.02)


def test_every_protocol_is_listed() -> None:
    section = TEXT.split("## Evaluate a policy")[1].split("\n## ")[0]
    assert {name for name in PROTOCOLS if f"`{name}`" not in section} == set()


def test_samples_are_of_shipped_checkpoints() -> None:
    shown = [sample["checkpoint"] for sample in SAMPLES if sample.get("checkpoint")]
    assert len(shown) >= 2
    for one in shown:
        assert any(sha256.startswith(one) for sha256 in pretrained.SHA256.values())


def test_sorting_answers_as_is_shown_but_for_the_moves_left_out(address: str) -> None:
    answer, shown = json.loads(shell(SHELL[SORT], address)), SAMPLES[1]
    assert [one for one in shown["moves"] if one in answer["moves"]] == shown["moves"]
    left_out = ("moves", "elapsed_ms")
    assert {name: answer[name] for name in answer if name not in left_out} == {
        name: shown[name] for name in shown if name not in left_out
    }


def test_refused_job_is_the_problem_that_is_shown(address: str) -> None:
    problem, shown = json.loads(shell(SHELL[-1], address)), SAMPLES[-1]
    assert problem.keys() == shown.keys()
    assert problem | {"request_id": shown["request_id"]} == shown


def test_training_job_is_accepted_with_its_place(address: str) -> None:
    answer = shell(SHELL[JOB], address)
    assert answer.startswith("HTTP/1.1 202")
    job = json.loads(answer.split("\n\n", 1)[1])
    assert f"location: /v1/jobs/{job['id']}" in answer
    shell(f"curl -sf -X POST http://127.0.0.1:8000/v1/jobs/{job['id']}/cancel", address)


@pytest.mark.parametrize("text", OTHERS)
def test_command_is_answered(text: str, address: str) -> None:
    assert shell(text.replace("curl -s ", "curl -sf "), address).startswith("{")


def test_people_of_the_examples_are_answered_without_flags(address: str) -> None:
    examples = [text for text in OTHERS if '"keypoints"' in text]
    assert len(examples) == 2
    for text in examples:
        answer = json.loads(shell(text, address))
        seen = [one for one in answer["people"] if one.get("age_s") is not None]
        assert len(seen) == 1 and seen[0]["flags"] == []
