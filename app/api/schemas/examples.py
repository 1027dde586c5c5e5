"""Example requests of the OpenAPI document; a test posts each of them."""

from typing import Any

from pydantic import ConfigDict

from app.api.schemas.robot_state import ROS_NAMES

KEYPOINTS: list[list[float] | None] = [
    [0.0, 1.33, 0.81], [0.0, 1.45, 0.64], [-0.18, 1.45, 0.64], None, None,
    [0.18, 1.45, 0.64], [0.23, 1.41, 0.36], [0.26, 1.22, 0.19],
    [0.0, 1.45, 0.2], [-0.09, 1.45, 0.2], None, None, [0.09, 1.45, 0.2], *[None] * 12,
]  # fmt: skip
"""A person at the table of ``pick-and-place``, left hand forward [m]."""
TASK_SELECTION: dict[str, Any] = {
    "cell": "pick-and-place",
    "robot": {"q": [0.99, -2.33, 2.08, -1.32, -1.57, 0.0], "qd": [0.0] * 6},
    "people": [{"keypoints": KEYPOINTS}],
    "candidates": [
        {"id": "left", "position": [-0.5, 0.7, 0.12]},
        {"id": "right", "position": [0.3, 0.7, 0.12]},
    ],
}
RISK_MAP: dict[str, Any] = TASK_SELECTION | {
    "grid": {"x": [-0.5, 0.5], "y": [1.1, 1.5], "nx": 3, "ny": 2}
}
MOTION: dict[str, Any] = {
    "cell": "shared-workspace",
    "robot": {
        "names": sorted(ROS_NAMES),
        "q": [2.0, -2.5, 0.0, 0.0, 0.0, 0.0],
        "qd": [0.0, 0.0, 0.4, 0.0, 0.0, 0.0],
    },
    "people": [{"x": 0.3, "y": 1.6, "vx": 0.0, "vy": -0.5, "r": 0.3}],
    "goal": [0.05, 0.75, 0.31],
}
PLAN: dict[str, Any] = {
    "cell": "sorting-e0",
    "robot": {"q": [0.99, -2.33, 2.08, -1.32, -1.57, 0.0], "qd": [0.0] * 6},
    "people": [{"keypoints": KEYPOINTS}],
    "objects": [
        {"id": "a", "colour": "red", "size": "large", "at": "slot5"},
        {"id": "b", "colour": "red", "size": "large", "at": "slot9"},
        {"id": "c", "colour": "red", "size": "small", "at": "slot7"},
    ],
    "goal": {"red": ["large", "small"]},
}
SORTING: dict[str, Any] = {
    "cell": "sorting-e0",
    "objects": [
        {"id": "a", "colour": "red", "size": "large", "at": "slot2"},
        {"id": "b", "colour": "red", "size": "large", "at": "slot5"},
        {"id": "c", "colour": "blue", "size": "small", "at": "red", "level": 0},
    ],
    "goal": {"red": ["large"]},
    "decider": "planner",
}
TRACKER: dict[str, Any] = {"cell": "pick-and-place", "n_people": 1}
FRAME: dict[str, Any] = {"t": 12.3, "people": [{"keypoints": KEYPOINTS}]}

JOBS: dict[str, Any] = {
    "train": {
        "kind": "train",
        "preset": "pick-td3",
        "seed": 1,
        "overrides": {"learning": {"total_steps": 102400}},
    },
    "evaluate": {"kind": "evaluate", "protocol": "pick-single", "episodes": 100},
    "sweep": {
        "kind": "sweep",
        "preset": "pick-td3",
        "overrides": {"learning": {"total_steps": 1024000}},
        "ranges": {
            "learning.lr_start": {"low": 1e-4, "high": 1e-3, "log": True},
            "networks.width": {"choices": [128, 256]},
        },
        "trials": 20,
        "objective": {"protocol": "pick-single", "quantity": "success", "episodes": 1000},
    },
    "report": {"kind": "report"},
}
BUDGET: dict[str, Any] = {"step_budget": 204800, "time_budget_s": None}
LABELS: dict[str, Any] = {"name": "baseline", "notes": "to compare with", "priority": 5}
CHANGES: dict[str, Any] = {"seed": 2, "overrides": {"learning": {"gamma": 0.98}}}
COMMANDS: dict[str, Any] = {
    "pause": {"tag": "pause"},
    "move a person": {"tag": "move-person", "pelvis": [0.2, 1.4, -1.57]},
    "set the candidates": {"tag": "set-candidates", "ids": ["cube1", "cube2"]},
    "resume": {"tag": "resume"},
}
FOLLOW: dict[str, Any] = {"job": "69fed224-c62a-436c-921d-1da364e6d886"}
WORLD_CELL: dict[str, Any] = {"cell": "pick-and-place"}


def named(examples: dict[str, Any]) -> dict[str, Any]:
    """Return examples of a body of several kinds, for ``Body(openapi_examples=...)``."""
    return {name: {"value": value} for name, value in examples.items()}


def shows(example: dict[str, Any]) -> ConfigDict:
    """Return the configuration of a request with an example."""
    return ConfigDict(json_schema_extra={"examples": [example]})
