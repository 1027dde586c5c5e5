"""Operations with the tag trackers; written by ``make client``."""

from collections.abc import Mapping
from typing import Any

from app.api.schemas.trackers import (
    EstimatesPublic,
    FrameCreate,
    TrackerCreate,
    TrackerList,
    TrackerPublic,
)
from app.client.transport import Transport


class TrackersOperations(Transport):
    """Operations with the tag trackers."""

    def list_trackers(self) -> TrackerList:
        """List the trackers."""
        return self._parsed(TrackerList, "GET /v1/trackers")

    def create_tracker(self, body: TrackerCreate | Mapping[str, Any]) -> TrackerPublic:
        """Open a tracker."""
        return self._parsed(TrackerPublic, "POST /v1/trackers", body=body)

    def submit_frame(
        self, tracker_id: str, body: FrameCreate | Mapping[str, Any]
    ) -> EstimatesPublic:
        """Submit a frame."""
        return self._parsed(
            EstimatesPublic, "POST /v1/trackers/{}/frames", tracker_id, body=body
        )

    def get_tracker(self, tracker_id: str, *, t: float | None = None) -> EstimatesPublic:
        """Estimates of a tracker's people."""
        return self._parsed(EstimatesPublic, "GET /v1/trackers/{}", tracker_id, query={"t": t})

    def delete_tracker(self, tracker_id: str) -> None:
        """Delete a tracker."""
        self._send("DELETE /v1/trackers/{}", tracker_id)
