"""Operations with the tag checkpoints; written by ``make client``."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

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
            self._send(
                "GET",
                "/v1/checkpoints",
                query={"job_id": job_id, "cursor": cursor, "limit": limit},
            ),
        )

    def upload_checkpoint(
        self, content: bytes, *, sha256: str | None = None
    ) -> CheckpointPublic:
        """Upload a checkpoint."""
        return self._parsed(
            CheckpointPublic,
            self._send("POST", "/v1/checkpoints", content=content, query={"sha256": sha256}),
        )

    def recalibrate_checkpoint(
        self, reference: str, body: Recalibration | Mapping[str, Any]
    ) -> CheckpointPublic:
        """Recalibrate the outcome probabilities of a checkpoint."""
        return self._parsed(
            CheckpointPublic,
            self._send(
                "POST", f"/v1/checkpoints/{quote(reference, safe='')}/recalibration", body=body
            ),
        )

    def get_checkpoint(self, reference: str) -> CheckpointPublic:
        """One checkpoint, by SHA-256 or alias."""
        return self._parsed(
            CheckpointPublic, self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}")
        )

    def get_checkpoint_manifest(self, reference: str) -> dict[str, Any]:
        """A checkpoint's manifest."""
        return dict(
            self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}/manifest").json()
        )

    def get_checkpoint_tensors(self, reference: str) -> bytes:
        """Download a checkpoint's tensors."""
        return self._send("GET", f"/v1/checkpoints/{quote(reference, safe='')}/tensors").content

    def list_aliases(self) -> AliasList:
        """List the aliases."""
        return self._parsed(AliasList, self._send("GET", "/v1/aliases"))

    def get_alias(self, name: str) -> Alias:
        """One alias."""
        return self._parsed(Alias, self._send("GET", f"/v1/aliases/{quote(name, safe='')}"))

    def set_alias(self, name: str, body: AliasTarget | Mapping[str, Any]) -> Alias:
        """Point an alias to a checkpoint."""
        return self._parsed(
            Alias, self._send("PUT", f"/v1/aliases/{quote(name, safe='')}", body=body)
        )

    def remove_alias(self, name: str) -> None:
        """Remove an alias."""
        self._send("DELETE", f"/v1/aliases/{quote(name, safe='')}")
