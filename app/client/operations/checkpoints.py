"""Operations with the tag checkpoints; written by ``make client``."""

from collections.abc import Mapping
from typing import Any

from app.api.schemas.checkpoints import (
    Alias,
    AliasList,
    AliasTarget,
    CheckpointList,
    CheckpointPublic,
    Recalibration,
)
from app.client.transport import Transport


class CheckpointsOperations(Transport):
    """Operations with the tag checkpoints."""

    def list_checkpoints(
        self, *, job_id: str | None = None, cursor: str | None = None, limit: int | None = None
    ) -> CheckpointList:
        """List the checkpoints."""
        return self._parsed(
            CheckpointList,
            "GET /v1/checkpoints",
            query={"job_id": job_id, "cursor": cursor, "limit": limit},
        )

    def upload_checkpoint(
        self, content: bytes, *, sha256: str | None = None
    ) -> CheckpointPublic:
        """Upload a checkpoint."""
        return self._parsed(
            CheckpointPublic, "POST /v1/checkpoints", content=content, query={"sha256": sha256}
        )

    def recalibrate_checkpoint(
        self, reference: str, body: Recalibration | Mapping[str, Any]
    ) -> CheckpointPublic:
        """Recalibrate the outcome probabilities of a checkpoint."""
        return self._parsed(
            CheckpointPublic, "POST /v1/checkpoints/{}/recalibration", reference, body=body
        )

    def get_checkpoint(self, reference: str) -> CheckpointPublic:
        """One checkpoint, by SHA-256 or alias."""
        return self._parsed(CheckpointPublic, "GET /v1/checkpoints/{}", reference)

    def delete_checkpoint(self, reference: str) -> None:
        """Delete an uploaded or recalibrated checkpoint."""
        self._send("DELETE /v1/checkpoints/{}", reference)

    def get_checkpoint_manifest(self, reference: str) -> dict[str, Any]:
        """A checkpoint's manifest."""
        return dict(self._send("GET /v1/checkpoints/{}/manifest", reference).json())

    def get_checkpoint_tensors(self, reference: str) -> bytes:
        """Download a checkpoint's tensors."""
        return self._send("GET /v1/checkpoints/{}/tensors", reference).content

    def list_aliases(self) -> AliasList:
        """List the aliases."""
        return self._parsed(AliasList, "GET /v1/aliases")

    def get_alias(self, name: str) -> Alias:
        """One alias."""
        return self._parsed(Alias, "GET /v1/aliases/{}", name)

    def set_alias(self, name: str, body: AliasTarget | Mapping[str, Any]) -> Alias:
        """Point an alias to a checkpoint."""
        return self._parsed(Alias, "PUT /v1/aliases/{}", name, body=body)

    def remove_alias(self, name: str) -> None:
        """Remove an alias."""
        self._send("DELETE /v1/aliases/{}", name)
