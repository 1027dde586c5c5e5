"""Operations with the tag trackers; written by ``make client``."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

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
        return self._parsed(TrackerList, self._send("GET", "/v1/trackers"))

    def create_tracker(self, body: TrackerCreate | Mapping[str, Any]) -> TrackerPublic:
        """Open a tracker."""
        return self._parsed(TrackerPublic, self._send("POST", "/v1/trackers", body=body))

    def submit_frame(
        self, tracker_id: str, body: FrameCreate | Mapping[str, Any]
    ) -> EstimatesPublic:
        """Submit a frame."""
        return self._parsed(
            EstimatesPublic,
            self._send("POST", f"/v1/trackers/{quote(tracker_id, safe='')}/frames", body=body),
        )

    def get_tracker(self, tracker_id: str, *, t: float | None = None) -> EstimatesPublic:
        """Estimates of a tracker's people."""
        return self._parsed(
            EstimatesPublic,
            self._send("GET", f"/v1/trackers/{quote(tracker_id, safe='')}", query={"t": t}),
        )

    def delete_tracker(self, tracker_id: str) -> None:
        """Delete a tracker."""
        self._send("DELETE", f"/v1/trackers/{quote(tracker_id, safe='')}")
