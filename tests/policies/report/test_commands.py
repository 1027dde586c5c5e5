"""Commands under tables and in the report give the tables."""

import json
from pathlib import Path

from app.policies.report.commands import command_of, training_of, writing_command

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "results"


def written(name: str) -> str:
    return writing_command(name, json.loads((RESULTS / f"{name}.json").read_bytes()))


def test_commands_name_policy_recordings_numbers_and_file() -> None:
    start = "python -m app"
    numbers = "--episodes 4000 --seed 21 --json > docs/results"
    assert written("pick-single") == f"{start} evaluate pick-single {numbers}/pick-single.json"
    assert written("pick-mocap").startswith(f"{start} evaluate pick-mocap FILE ... {numbers}")
    assert "pick-ssm --checkpoint pick-monitored --episodes" in written("pick-ssm-monitored")
    assert "sorting-grid --checkpoint sorting-e1 --episodes" in written("sorting-grid-e1")
    assert "pick-single --checkpoint FILE --episodes" in written("thesis-pick-single")
    assert written("sockets") == f"{start} bench sockets --json > docs/results/sockets.json"
    assert written("kill-campaign") == "python -m tests.jobs.kill_campaign FOLDER"


def test_a_protocol_without_policy_names_none() -> None:
    found = {"protocol": "safety-ssm", "episodes": 10, "seed": 1}
    assert command_of(found) == "python -m app evaluate safety-ssm"


def test_curves_name_their_training_with_fields_seeds_and_commits() -> None:
    fields = {"learning.gradient_steps": 10}
    curves = [
        {"name": "sorting-e0-thesis, four", "seed": n, "fields": fields, "commits": [commit]}
        for n, commit in ((1, "b"), (2, "a"), (3, "b"))
    ]
    said = training_of({"curves": curves}, "sorting-e0-thesis, four")
    training = "python -m tools.docs.training_curves sorting-e0-thesis"
    assert f"`{training} --set learning.gradient_steps=10 --seed SEED --output RUN`" in said
    assert said.endswith("seeds 1, 2, 3, commits `a`, `b`")
    older = [{"task": task, "name": "p", "seed": 4} for task in ("e0", "e1")]
    assert training_of({"curves": older}, "p", "e1").endswith("seeds 4, commits not stored")
