"""Recordings of human motion: import a file, list, show, remove."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response
from starlette.concurrency import run_in_threadpool

from app.api.description import FILE_BODY, set_stored, stored_responses
from app.api.schemas.recordings import RecordingItem, RecordingList, RecordingPublic
from app.api.services import ServicesDep
from app.sim.mocap.importer import FORMATS, MAX_BYTES
from app.sim.mocap.read_options import UNITS, UP_AXES, ReadOptions, name_map
from jobs.recording_catalog import checked_names

router = APIRouter(prefix="/v1/recordings", tags=["recordings"])

FILES = {router.prefix: MAX_BYTES}
"""Route that takes files, and the largest file [bytes]."""
UNIT = f"{', '.join(UNITS)}, or metres per unit"
"""Choices of a unit."""


def read_options(
    unit: Annotated[
        str | None, Query(description=f"unit of the lengths: {UNIT}; detected if omitted")
    ] = None,
    root_unit: Annotated[
        str | None, Query(description=f"unit of the root's path, if another: {UNIT}")
    ] = None,
    up: Annotated[
        str | None,
        Query(description=f"axis that points up: {', '.join(UP_AXES)}; detected if omitted"),
    ] = None,
    names: Annotated[
        list[str] | None,
        Query(
            alias="map",
            description="a joint or column, as name in the file=our name, such as "
            "LeftForeArm2=elbow_l; may be repeated",
        ),
    ] = None,
) -> ReadOptions:
    """Return the options by which the file of a request is read."""
    return ReadOptions(unit=unit, root_unit=root_unit, up=up, names=name_map(names or []))


@router.get("", summary="List the recordings")
def list_recordings(services: ServicesDep) -> RecordingList:
    """Return every recording with its measures and the error of its import."""
    return RecordingList(
        items=[RecordingItem.from_domain(one) for one in services.recordings.all()]
    )


@router.get("/{name}", summary="One recording")
def get_recording(name: str, services: ServicesDep) -> RecordingPublic:
    """Return one recording with its clean runs and the artifacts cut out of it."""
    record, _ = services.recordings.with_runs(name)
    return RecordingPublic.from_domain(record)


@router.post(
    "",
    status_code=201,
    summary="Import a recording",
    openapi_extra=FILE_BODY,
    responses={
        **stored_responses(RecordingPublic, "The same file"),
        409: {"description": "Another file has the name, or too many are stored"},
    },
)
async def create_recording(
    request: Request,
    services: ServicesDep,
    response: Response,
    options: Annotated[ReadOptions, Depends(read_options)],
    file_name: Annotated[
        str, Query(description=f"name of the file; ends with {', '.join(FORMATS)}")
    ],
    name: Annotated[
        str | None,
        Query(description="name of the recording, a-z 0-9 -; made from the file's if missing"),
    ] = None,
) -> RecordingPublic:
    """Import the file in the body and store it; the same file again answers 200."""
    checked_names(file_name, name)  # before the file is read
    with services.upload():
        content, add = await request.body(), services.recordings.add
        record, new = await run_in_threadpool(add, content, file_name, name, options)
    set_stored(response, f"{router.prefix}/{record.name}", new=new)
    return RecordingPublic.from_domain(record)


@router.delete(
    "/{name}",
    status_code=204,
    summary="Remove a recording",
    responses={409: {"description": "A job that has not ended evaluates with it"}, 507: {}},
)
def delete_recording(name: str, services: ServicesDep) -> None:
    """Remove a recording."""
    services.recordings.remove(name)
