"""Protocols of evaluations, with the inputs of each."""

from fastapi import APIRouter

from app.api.schemas.protocols import ProtocolList, ProtocolPublic
from app.policies.evaluation.registry import PROTOCOLS

router = APIRouter(prefix="/v1/protocols", tags=["jobs"])


@router.get("", summary="List the protocols")
def list_protocols() -> ProtocolList:
    """Return every protocol of evaluations with its policy, recordings and episodes."""
    return ProtocolList(items=[ProtocolPublic.from_name(name) for name in PROTOCOLS])
