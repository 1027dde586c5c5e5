"""Commands under tables and in the report give the tables."""

import json
from pathlib import Path

from app.policies.report.commands import command_of, writing_command

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "results"


def written(name: str) -> str:
    return writing_command(name, json.loads((RESULTS / f"{name}.json").read_bytes()))


def test_commands_name_policy_recordings_numbers_and_file() -> None:
    start = "python -m app"
    numbers = "--episodes 2000 --seed 11 --json > docs/results"
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
