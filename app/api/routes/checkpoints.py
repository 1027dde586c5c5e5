"""Trained policies: list, read, download, upload, recalibrate, delete."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.api.description import FILE_BODY, set_stored, stored_responses
from app.api.registry import PolicyRegistry
from app.api.schemas.checkpoints import CheckpointList, CheckpointPublic, Recalibration
from app.api.services import Services, ServicesDep
from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    REACHING,
    SORTING,
    Checkpoint,
    purpose_of,
)
from app.policies.checkpoints.checkpoint import load as load_checkpoint
from app.policies.checkpoints.upload import MAX_FILE, read_upload, require_ranges
from app.policies.inference.recalibration import recalibrated
from app.store import checkpoints
from jobs.checkpoints import read_sound, to_store

router = APIRouter(prefix="/v1/checkpoints", tags=["checkpoints"])
FILES = {router.prefix: MAX_FILE}
"""Route that takes a file, and the largest one [bytes]."""
BODY: dict[str, Any] = {
    "requestBody": {
        **FILE_BODY["requestBody"],
        "description": "the manifest in one line of JSON, followed by the safetensors file",
    }
}
STORED = stored_responses(CheckpointPublic, "The same checkpoint")


@router.get("", summary="List the checkpoints")
def list_checkpoints(
    services: ServicesDep,
    job_id: Annotated[str | None, Query(description="only those this job made")] = None,
    cursor: Annotated[str | None, Query(description="next_cursor of the page before")] = None,
    limit: Annotated[int, Query(ge=1, le=200, description="length of the page")] = 50,
) -> CheckpointList:
    """Return one page, newest first, shipped ones included."""
    page = checkpoints.list_checkpoints(
        services.store, job_id=job_id, cursor=cursor, limit=limit
    )
    items = [CheckpointPublic.from_domain(one) for one in page.items]
    return CheckpointList(items=items, next_cursor=page.next_cursor)


@router.post(
    "",
    status_code=201,
    summary="Upload a checkpoint",
    openapi_extra=BODY,
    responses={
        **STORED,
        409: {
            "description": "Its format, layout or tensors are not of this version, or its "
            "networks give numbers that are not finite"
        },
    },
)
async def upload_checkpoint(
    request: Request,
    services: ServicesDep,
    response: Response,
    sha256: Annotated[
        str | None, Query(description="its expected id; refused where it has another")
    ] = None,
) -> CheckpointPublic:
    """Check a policy completely and store it; the same one again answers 200."""
    services.readiness.require()
    with services.upload():
        content = await request.body()
        return await run_in_threadpool(_store, content, sha256, services, response)


def _store(
    content: bytes, sha256: str | None, services: Services, response: Response
) -> CheckpointPublic:
    """Check an upload and store it."""
    found = read_upload(content)
    if sha256 not in (None, found.sha256):
        rule = f"is not the id of the uploaded checkpoint, {found.sha256}"
        raise InvalidInput("sha256", sha256, rule)
    registries: dict[str, PolicyRegistry[Any]] = {
        CHOOSING: services.task_policies,
        REACHING: services.reach_policies,
        SORTING: services.sorting_policies,
    }
    registries[purpose_of(found.manifest)].check(found.manifest, found.tensors)
    require_ranges(found.manifest)
    return _keep(found, services, response)


def _keep(found: Checkpoint, services: Services, response: Response) -> CheckpointPublic:
    """Store a checkpoint; set status and ``Location`` of the answer."""
    new = not checkpoints.stored_among(services.store, [found.sha256])
    record = services.checkpoints.put(to_store(found))
    set_stored(response, f"{router.prefix}/{record.sha256}", new=new)
    return CheckpointPublic.from_domain(record)


@router.post(
    "/{reference}/recalibration",
    status_code=201,
    summary="Recalibrate the outcome probabilities of a checkpoint",
    responses=STORED,
)
def recalibrate_checkpoint(
    reference: str, request: Recalibration, services: ServicesDep, response: Response
) -> CheckpointPublic:
    """Store a copy whose probabilities are corrected by outcomes observed in one cell.

    Its actions and values are unchanged. To use it, point an alias to it.
    """
    record, tensors = read_sound(services.store, reference)
    found = recalibrated(load_checkpoint(record.manifest, tensors), *request.to_domain())
    return _keep(found, services, response)


@router.get("/{reference}", summary="One checkpoint, by SHA-256 or alias")
def get_checkpoint(reference: str, services: ServicesDep) -> CheckpointPublic:
    """Return one checkpoint without its tensors."""
    record, _ = read_sound(services.store, reference)
    return CheckpointPublic.from_domain(record)


@router.delete(
    "/{reference}",
    status_code=204,
    summary="Delete an uploaded or recalibrated checkpoint",
    responses={
        409: {"description": "It is shipped, has an alias, was made by a job, or is in use"},
        507: {},
    },
)
def delete_checkpoint(reference: str, services: ServicesDep) -> None:
    """Delete a checkpoint; results of its evaluations stay.

    The checkpoints of a job are deleted with the job.
    """
    services.retention.delete_checkpoint(reference)


@router.get("/{reference}/manifest", summary="A checkpoint's manifest")
def get_checkpoint_manifest(reference: str, services: ServicesDep) -> dict[str, Any]:
    """Return the manifest of the tensors."""
    record, _ = read_sound(services.store, reference)
    return dict(record.manifest)


@router.get(
    "/{reference}/tensors",
    summary="Download a checkpoint's tensors",
    response_class=Response,
    responses={
        200: {"content": {"application/octet-stream": {}}, "description": "safetensors"},
        304: {"description": "`If-None-Match` has its `ETag`"},
    },
)
def get_checkpoint_tensors(reference: str, services: ServicesDep) -> Response:
    """Return the tensors as a safetensors file."""
    record, tensors = read_sound(services.store, reference)
    name = (*record.aliases, record.sha256[:12])[0]
    return Response(
        tensors,
        media_type="application/octet-stream",
        headers={
            "Content-Disposition": f'attachment; filename="{name}.safetensors"',
            "ETag": f'"{record.sha256}"',
        },
    )
