"""Comparison of jobs: fields that differ, curves with a band over seeds, CSV."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response

from app.api.schemas.comparison import ComparisonPublic
from app.api.services import ServicesDep
from jobs.comparison import MAX_JOBS, compare, curves_as_csv

JobIds = Annotated[
    list[str], Query(max_length=MAX_JOBS, description="id of a job; repeated, 1 to 20 times")
]
NO_JOB: dict[int | str, dict[str, Any]] = {404: {"description": "There is no such job"}}

router = APIRouter(prefix="/v1/comparison", tags=["jobs"])


@router.get("", summary="Compare jobs", responses=NO_JOB)
def get_comparison(
    services: ServicesDep,
    job: JobIds,
    quantity: Annotated[
        str | None, Query(description="quantity of the curves; `success` where recorded")
    ] = None,
) -> ComparisonPublic:
    """Return the fields that differ, and the curves of jobs that differ in more than the seed.

    A curve is the mean over the seeds, with the least and greatest value at each step.
    """
    return ComparisonPublic.from_domain(compare(services.store, job, quantity))


@router.get(
    "/csv",
    summary="Download the curves of jobs",
    response_class=Response,
    responses={**NO_JOB, 200: {"content": {"text/csv": {}}, "description": "points by job"}},
)
def get_comparison_csv(services: ServicesDep, job: JobIds) -> Response:
    """Return every point of the jobs, one row per job and step, all quantities as columns."""
    return Response(
        curves_as_csv(services.store, job),
        media_type="text/csv",
        headers={"Content-Disposition": 'attachment; filename="jobs.csv"'},
    )
