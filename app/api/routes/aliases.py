"""Aliases: names that point to checkpoints and can be pointed to others."""

from typing import Any

from fastapi import APIRouter, Response

from app.api.description import CREATED
from app.api.schemas.checkpoints import Alias, AliasList, AliasTarget
from app.api.services import ServicesDep
from app.errors import NotFound, WrongState
from app.policies.checkpoints import pretrained

router = APIRouter(prefix="/v1/aliases", tags=["checkpoints"])
RESERVED: dict[int | str, dict[str, Any]] = {
    409: {"description": "It is the name of a shipped checkpoint"},
    507: {},
}


@router.get("", summary="List the aliases")
def list_aliases(services: ServicesDep) -> AliasList:
    """Return every alias with its checkpoint, in alphabetical order."""
    known = services.checkpoints.aliases.items()
    return AliasList(items=[Alias.of(name, sha256) for name, sha256 in known])


@router.get("/{name}", summary="One alias")
def get_alias(name: str, services: ServicesDep) -> Alias:
    """Return the checkpoint of an alias."""
    known = services.checkpoints.aliases
    if name not in known:
        raise NotFound("alias", name, tuple(known))
    return Alias.of(name, known[name])


@router.put(
    "/{name}",
    summary="Point an alias to a checkpoint",
    responses={201: {"model": Alias, "description": "It is new", **CREATED}, **RESERVED},
)
def set_alias(name: str, body: AliasTarget, services: ServicesDep, response: Response) -> Alias:
    """Create an alias, or point it to another checkpoint in one step.

    Its name can be used wherever a checkpoint is named; requests in progress, live worlds and
    posted jobs keep the checkpoint that it named before.
    """
    _require_own(name, "choose another name")
    record, _ = services.checkpoints.read(body.checkpoint)
    if name not in services.checkpoints.aliases:
        response.status_code = 201
        response.headers["Location"] = f"{router.prefix}/{name}"
    services.checkpoints.point(name, record.sha256)
    return Alias.of(name, record.sha256)


@router.delete("/{name}", status_code=204, summary="Remove an alias", responses=RESERVED)
def remove_alias(name: str, services: ServicesDep) -> None:
    """Remove an alias; its checkpoint stays."""
    _require_own(name, "shipped aliases cannot be deleted")
    services.checkpoints.remove(name)


def _require_own(name: str, remedy: str) -> None:
    if name in pretrained.ALIASES:
        raise WrongState("name", name, f"is the alias of a shipped checkpoint: {remedy}")
