"""Results of jobs: evaluations; comparison of fields and curves with a band over seeds, CSV."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import HTMLResponse

from app.api.schemas.results import ComparisonPublic, EvaluationList, EvaluationPublic
from app.api.schemas.sweeps import TrialList
from app.api.services import ServicesDep
from app.errors import InvalidInput, NotFound, WrongState
from app.policies.evaluation.registry import PROTOCOLS
from app.policies.report.document import document
from app.store.jobs import get_job, list_evaluations
from jobs.comparison import MAX_JOBS, compare, curves_as_csv
from jobs.composed.sweeps import trials_of

JobIds = Annotated[
    list[str], Query(max_length=MAX_JOBS, description="id of a job; repeated, 1 to 20 times")
]
REPORT_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox"
NO_JOB: dict[int | str, dict[str, Any]] = {404: {"description": "There is no such job"}}

router = APIRouter(prefix="/v1", tags=["results"])


@router.get("/comparison", summary="Compare jobs", responses=NO_JOB)
def get_comparison(
    services: ServicesDep,
    job: JobIds,
    quantity: Annotated[
        str | None, Query(description="quantity of the curves; `success` where recorded")
    ] = None,
) -> ComparisonPublic:
    """Return the fields that differ, and the curves of jobs that differ in more than the seed.

    A curve is the mean over the seeds, with the least and greatest value at each step. Curves
    of more than 10,000 points, and more than 10,000 steps, are thinned evenly.
    """
    return ComparisonPublic.from_domain(compare(services.store, job, quantity))


@router.get(
    "/comparison/csv",
    summary="Download the curves of jobs",
    response_class=Response,
    responses={**NO_JOB, 200: {"content": {"text/csv": {}}, "description": "points by job"}},
)
def get_comparison_csv(services: ServicesDep, job: JobIds) -> Response:
    """Return the points of the jobs, one row per job and step, all quantities as columns.

    A curve of more than 10,000 points is thinned evenly; its last point is kept.
    """
    return Response(
        curves_as_csv(services.store, job),
        media_type="text/csv",
        headers={"Content-Disposition": 'attachment; filename="jobs.csv"'},
    )


@router.get("/evaluations", summary="List the evaluations")
def list_all_evaluations(
    services: ServicesDep,
    protocol: Annotated[str | None, Query(description="only of this protocol")] = None,
    checkpoint: Annotated[
        str | None, Query(description="only of this checkpoint, by SHA-256 or alias")
    ] = None,
    cursor: Annotated[str | None, Query(description="next_cursor of the page before")] = None,
    limit: Annotated[int, Query(ge=1, le=200, description="length of the page")] = 50,
) -> EvaluationList:
    """Return one page of the results of succeeded evaluations, newest first.

    A damaged result is left out.
    """
    if protocol is not None and protocol not in PROTOCOLS:
        raise InvalidInput("protocol", protocol, "is not a protocol", tuple(PROTOCOLS))
    sha256 = services.checkpoints.aliases.get(checkpoint or "", checkpoint)
    page = list_evaluations(
        services.store, protocol=protocol, checkpoint=sha256, cursor=cursor, limit=limit
    )
    items = filter(None, map(EvaluationPublic.from_domain, page.items))
    return EvaluationList(items=list(items), next_cursor=page.next_cursor)


@router.get("/jobs/{job_id}/trials", summary="The trials of a sweep")
def list_trials(job_id: str, services: ServicesDep) -> TrialList:
    """Return the trials with their drawn fields and values; `best` marks the best one."""
    job = get_job(services.store, job_id)
    return TrialList.from_domain(job, trials_of(services.store, job))


@router.get(
    "/jobs/{job_id}/report",
    summary="The page of a report",
    response_class=HTMLResponse,
    responses={409: {"description": "It has no page: it has not succeeded"}},
)
def get_report(job_id: str, services: ServicesDep) -> HTMLResponse:
    """Return the report as one HTML file with its figures."""
    job = get_job(services.store, job_id)
    if job.kind != "report":
        raise NotFound("report", job_id)
    if job.state != "succeeded" or job.result is None:
        rule = f"of job {job.number}: its page is written at its end"
        raise WrongState("state", job.state, rule, ("succeeded",))
    if "markdown" not in job.result:  # damaged
        raise NotFound("report", job_id)
    content = document(str(job.result["markdown"]), f"Tandem, report {job.number}")
    return HTMLResponse(content, headers={"Content-Security-Policy": REPORT_POLICY})


@router.get("/evaluations/{job_id}", summary="One evaluation")
def get_evaluation(job_id: str, services: ServicesDep) -> EvaluationPublic:
    """Return the result of a succeeded evaluation, by the id of its job."""
    job = get_job(services.store, job_id)
    found = EvaluationPublic.from_domain(job) if job.kind == "evaluate" else None
    if found is None:
        raise NotFound("evaluation", job_id)
    return found
