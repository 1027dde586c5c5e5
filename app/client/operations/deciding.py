"""Operations with the tag deciding; written by ``make client``."""

from collections.abc import Mapping
from typing import Any

from app.api.schemas.motion import MotionAnswer, MotionRequest
from app.api.schemas.plan import PlanAnswer, PlanRequest
from app.api.schemas.risk_map import RiskMapAnswer, RiskMapRequest
from app.api.schemas.sorting import SortingAnswer, SortingRequest
from app.api.schemas.task_selection import TaskSelection, TaskSelectionRequest
from app.client.transport import Transport


class DecidingOperations(Transport):
    """Operations with the tag deciding."""

    def select_task(self, body: TaskSelectionRequest | Mapping[str, Any]) -> TaskSelection:
        """Choose what the robot does next."""
        return self._parsed(TaskSelection, "POST /v1/task-selection", body=body)

    def choose_sorting_move(self, body: SortingRequest | Mapping[str, Any]) -> SortingAnswer:
        """Choose the next move of a sorting task."""
        return self._parsed(SortingAnswer, "POST /v1/sorting", body=body)

    def plan_move(self, body: PlanRequest | Mapping[str, Any]) -> PlanAnswer:
        """Choose the next move of a sorting task and its motion."""
        return self._parsed(PlanAnswer, "POST /v1/plan", body=body)

    def map_risk(self, body: RiskMapRequest | Mapping[str, Any]) -> RiskMapAnswer:
        """Map choice and risk over positions of a person."""
        return self._parsed(RiskMapAnswer, "POST /v1/risk-map", body=body)

    def decide_motion(self, body: MotionRequest | Mapping[str, Any]) -> MotionAnswer:
        """Decide how the robot moves next."""
        return self._parsed(MotionAnswer, "POST /v1/motion", body=body)
