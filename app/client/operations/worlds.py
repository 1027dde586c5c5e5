"""Operations with the tag worlds; written by ``make client``."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.api.schemas.worlds import (
    CommandAccepted,
    FollowPublic,
    FollowRequest,
    WorldCell,
    WorldList,
    WorldSummary,
)
from app.client.transport import StreamEvent, Transport
from app.live.commands import LiveCommand


class WorldsOperations(Transport):
    """Operations with the tag worlds."""

    def list_worlds(self) -> WorldList:
        """List the live worlds."""
        return self._parsed(WorldList, "GET /v1/worlds")

    def get_world(self, world_id: str) -> dict[str, Any]:
        """One live world, with the state a decision needs."""
        return dict(self._send("GET /v1/worlds/{}", world_id).json())

    def command_world(
        self, world_id: str, body: LiveCommand | Mapping[str, Any]
    ) -> CommandAccepted:
        """Change a live world."""
        return self._parsed(CommandAccepted, "POST /v1/worlds/{}/commands", world_id, body=body)

    def stream_world(self, world_id: str) -> Iterator[StreamEvent]:
        """Stream a live world, ten times a second."""
        return self._events("/v1/worlds/{}/events", world_id)

    def set_world_cell(
        self, world_id: str, body: WorldCell | Mapping[str, Any]
    ) -> WorldSummary:
        """Start a live world again in another cell."""
        return self._parsed(WorldSummary, "PUT /v1/worlds/{}/cell", world_id, body=body)

    def follow_training(
        self, world_id: str, body: FollowRequest | Mapping[str, Any]
    ) -> FollowPublic:
        """Let a live world follow a training."""
        return self._parsed(FollowPublic, "PUT /v1/worlds/{}/follow", world_id, body=body)

    def stop_following(self, world_id: str) -> None:
        """Follow a training no longer."""
        self._send("DELETE /v1/worlds/{}/follow", world_id)
