"""Operations with the tag results; written by ``make client``."""

from collections.abc import Sequence

from app.api.schemas.results import ComparisonPublic, EvaluationList, EvaluationPublic
from app.api.schemas.sweeps import TrialList
from app.client.transport import Transport


class ResultsOperations(Transport):
    """Operations with the tag results."""

    def get_comparison(
        self, *, job: Sequence[str], quantity: str | None = None
    ) -> ComparisonPublic:
        """Compare jobs."""
        return self._parsed(
            ComparisonPublic, "GET /v1/comparison", query={"job": job, "quantity": quantity}
        )

    def get_comparison_csv(self, *, job: Sequence[str]) -> str:
        """Download the curves of jobs."""
        return self._send("GET /v1/comparison/csv", query={"job": job}).text

    def list_all_evaluations(
        self,
        *,
        protocol: str | None = None,
        checkpoint: str | None = None,
        cursor: str | None = None,
        limit: int | None = None,
    ) -> EvaluationList:
        """List the evaluations."""
        return self._parsed(
            EvaluationList,
            "GET /v1/evaluations",
            query={
                "protocol": protocol,
                "checkpoint": checkpoint,
                "cursor": cursor,
                "limit": limit,
            },
        )

    def list_trials(self, job_id: str) -> TrialList:
        """The trials of a sweep."""
        return self._parsed(TrialList, "GET /v1/jobs/{}/trials", job_id)

    def get_report(self, job_id: str) -> str:
        """The page of a report."""
        return self._send("GET /v1/jobs/{}/report", job_id).text

    def get_evaluation(self, job_id: str) -> EvaluationPublic:
        """One evaluation."""
        return self._parsed(EvaluationPublic, "GET /v1/evaluations/{}", job_id)
