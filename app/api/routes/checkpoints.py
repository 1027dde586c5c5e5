"""Trained policies: list, read, download."""

from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import Response

from app.api.schemas.checkpoints import CheckpointList, CheckpointPublic
from app.api.services import ServicesDep
from app.store import checkpoints
from jobs.checkpoints import read_sound

router = APIRouter(prefix="/v1/checkpoints", tags=["checkpoints"])


@router.get("", summary="List the checkpoints")
def list_checkpoints(
    services: ServicesDep,
    job_id: Annotated[str | None, Query(description="only those this job made")] = None,
    cursor: Annotated[str | None, Query(description="next_cursor of the page before")] = None,
    limit: Annotated[int, Query(description="length of the page, 1 to 200")] = 50,
) -> CheckpointList:
    """Return one page, newest first, shipped ones included."""
    page = checkpoints.list_checkpoints(
        services.store, job_id=job_id, cursor=cursor, limit=limit
    )
    return CheckpointList.from_domain(page)


@router.get("/{reference}", summary="One checkpoint, by SHA-256 or alias")
def get_checkpoint(reference: str, services: ServicesDep) -> CheckpointPublic:
    """Return one checkpoint without its tensors."""
    record, _ = read_sound(services.store, reference)
    return CheckpointPublic.from_domain(record)


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
        200: {"content": {"application/octet-stream": {}}, "description": "safetensors"}
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
