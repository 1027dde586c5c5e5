"""Jobs of workers on other machines: read the job of an attempt, report, end it.

Every request carries the number of the attempt, which fences it: once the job was started
again, cancelled or ended, requests of an earlier attempt are refused with 409.
"""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Path, Query, Request
from fastapi.encoders import jsonable_encoder
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.description import FILE_BODY
from app.api.schemas.jobs import (
    AttemptEnd,
    AttemptHeartbeat,
    AttemptProgress,
    AttemptStart,
    JobPublic,
)
from app.api.schemas.results import EvaluationResult
from app.api.services import ServicesDep
from app.api.validation import BodyFault
from app.errors import NotFound
from app.policies.checkpoints.upload import join
from app.policies.configs import presets
from app.store.cursors import MAX_INTEGER, MAX_NUMBER
from app.store.records import Claim
from jobs.access import EndOfAttempt, StoreAccess
from jobs.remote.uploads import MAX_MEMORY_FILE, MAX_UPLOAD, pack_state, require_sha256

STALE_ATTEMPT: dict[int | str, dict[str, Any]] = {
    409: {"description": "The attempt no longer holds the job"},
}
WRITE_RESPONSES: dict[int | str, dict[str, Any]] = {**STALE_ATTEMPT, 507: {}}
FILE = "application/octet-stream"
FILE_RESPONSES: dict[int | str, dict[str, Any]] = {
    **STALE_ATTEMPT,
    200: {"content": {FILE: {}}, "description": "the file"},
}
router = APIRouter(prefix="/v1/jobs/{job_id}/attempts/{attempt}", tags=["attempts"])
FILES = {
    f"{router.prefix}/checkpoints": MAX_UPLOAD,
    f"{router.prefix}/files/{{sha256}}": MAX_MEMORY_FILE,
}
"""Routes that take a file, and the largest one [bytes]."""


async def claim_of_path(
    job_id: str,
    attempt: Annotated[int, Path(ge=1, le=MAX_NUMBER, description="number of the attempt")],
) -> Claim:
    """Return the claim that the path names."""
    return Claim(job_id=job_id, attempt=attempt)


ClaimDep = Annotated[Claim, Depends(claim_of_path)]


async def access_of(claim: ClaimDep, services: ServicesDep) -> StoreAccess:
    """Return the access of the attempt that the path names."""
    return StoreAccess(services.store, services.data, claim)


AccessDep = Annotated[StoreAccess, Depends(access_of)]


@router.get("", summary="The job of an attempt", responses=STALE_ATTEMPT)
def get_attempt(access: AccessDep) -> JobPublic:
    """Return the job, as long as the attempt holds it."""
    return JobPublic.from_domain(access.job())


@router.post("/heartbeat", summary="Record a heartbeat", responses=WRITE_RESPONSES)
def record_heartbeat(body: AttemptHeartbeat, access: AccessDep) -> JobPublic:
    """Record that the worker runs; return the job with `cancel_requested`."""
    return JobPublic.from_domain(access.heartbeat(body.waiting, body.run_s))


@router.post(
    "/progress", status_code=204, summary="Add a point to a curve", responses=WRITE_RESPONSES
)
def record_progress(body: AttemptProgress, access: AccessDep) -> None:
    """Add a point beyond the last one."""
    access.record_progress(body.step, body.values, body.total_steps)


@router.post("/start", status_code=204, summary="Start from a state", responses=WRITE_RESPONSES)
def start_attempt(body: AttemptStart, access: AccessDep) -> None:
    """Start from an earlier state than the job states, where a later one is damaged.

    The same start again has no effect; another one is refused once something is recorded.
    """
    access.resume_earlier(body.step)


@router.post("/end", status_code=204, summary="End an attempt", responses=WRITE_RESPONSES)
def end_attempt(body: AttemptEnd, access: AccessDep, services: ServicesDep) -> None:
    """Record the end of the attempt with its result or error."""
    if body.state == "succeeded" and access.job().kind == "evaluate":
        _require_evaluation(body.result)
    access.end(EndOfAttempt(**dict(body)))
    services.supervisor.wake()


@router.get("/cell", summary="The cell of a training", responses=STALE_ATTEMPT)
def get_attempt_cell(access: AccessDep, services: ServicesDep) -> dict[str, Any]:
    """Return the definition of the cell that the job trains in."""
    job = access.job()
    if job.preset is None:
        raise NotFound("cell of job", job.id)
    preset = presets.resolve(job.preset, job.overrides)
    return dict(services.cells.to_train_in(preset).definition())


@router.get(
    "/recordings/{name}",
    summary="A recording with its runs",
    response_class=Response,
    responses=FILE_RESPONSES,
)
def get_attempt_recording(name: str, access: AccessDep, services: ServicesDep) -> Response:
    """Return a line of JSON, the recording, followed by its runs as a safetensors file."""
    access.job()
    record, tensors = services.recordings.with_runs(name)
    return Response(join(jsonable_encoder(record), tensors), media_type=FILE)


@router.get(
    "/state",
    summary="A state to resume from",
    response_class=Response,
    responses=FILE_RESPONSES,
)
def get_attempt_state(
    access: AccessDep,
    claim: ClaimDep,
    below: Annotated[
        int, Query(ge=0, le=MAX_INTEGER, description="only a state of an earlier step")
    ] = MAX_INTEGER,
) -> Response:
    """Return the newest undamaged state: a line of JSON and a safetensors file."""
    access.job()
    state = access.load_resume(lambda one: one.step < below)
    if state is None:
        raise NotFound("state of job", claim.job_id)
    return Response(pack_state(state), media_type=FILE)


@router.post(
    "/checkpoints",
    status_code=204,
    summary="Store a policy and a state",
    openapi_extra=FILE_BODY,
    responses={
        **WRITE_RESPONSES,
        409: {"description": "The attempt no longer holds the job, or the format is another"},
    },
)
async def record_checkpoint(
    request: Request,
    claim: ClaimDep,
    services: ServicesDep,
    step: Annotated[int, Query(ge=0, le=MAX_INTEGER, description="environment steps done")],
    policy_bytes: Annotated[
        int, Query(ge=0, le=MAX_UPLOAD, description="length of the policy's part [bytes]")
    ],
    sha256: Annotated[str, Query(description="SHA-256 of the body")],
) -> None:
    """Store a policy and the state that follows it, each a line of JSON and safetensors."""
    with services.upload():
        content = await request.body()

        def store() -> None:
            require_sha256(sha256, content)
            services.worker_uploads.record(claim, step, content, policy_bytes)

        await run_in_threadpool(store)


@router.put(
    "/files/{sha256}",
    status_code=204,
    summary="Store a file of a replay memory",
    openapi_extra=FILE_BODY,
    responses=WRITE_RESPONSES,
)
async def put_attempt_file(
    request: Request, sha256: str, claim: ClaimDep, services: ServicesDep
) -> None:
    """Store a safetensors file under its SHA-256; the same one again has no effect."""
    with services.upload():
        content = await request.body()
        await run_in_threadpool(services.worker_uploads.write_file, claim, sha256, content)


@router.get(
    "/files/{sha256}",
    summary="A file of a replay memory",
    response_class=Response,
    responses=FILE_RESPONSES,
)
def get_attempt_file(sha256: str, claim: ClaimDep, services: ServicesDep) -> Response:
    """Return a file that an attempt of the job has stored."""
    return Response(services.worker_uploads.read_file(claim, sha256), media_type=FILE)


def _require_evaluation(result: dict[str, Any] | None) -> None:
    """Check the result of a succeeded evaluation.

    Raises:
        BodyFault: Members are missing or of another type.
    """
    try:
        EvaluationResult.model_validate(result)
    except ValidationError as error:
        faults = [{**one, "loc": ("result", *one["loc"])} for one in error.errors()]
        raise BodyFault(faults, AttemptEnd) from None
