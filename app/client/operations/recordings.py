"""Operations with the tag recordings; written by ``make client``."""

from collections.abc import Sequence

from app.api.schemas.recordings import RecordingList, RecordingPublic
from app.client.transport import Transport


class RecordingsOperations(Transport):
    """Operations with the tag recordings."""

    def list_recordings(self) -> RecordingList:
        """List the recordings."""
        return self._parsed(RecordingList, "GET /v1/recordings")

    def create_recording(
        self,
        content: bytes,
        *,
        file_name: str,
        name: str | None = None,
        unit: str | None = None,
        root_unit: str | None = None,
        up: str | None = None,
        map: Sequence[str] | None = None,
    ) -> RecordingPublic:
        """Import a recording."""
        return self._parsed(
            RecordingPublic,
            "POST /v1/recordings",
            content=content,
            query={
                "file_name": file_name,
                "name": name,
                "unit": unit,
                "root_unit": root_unit,
                "up": up,
                "map": map,
            },
        )

    def get_recording(self, name: str) -> RecordingPublic:
        """One recording."""
        return self._parsed(RecordingPublic, "GET /v1/recordings/{}", name)

    def delete_recording(self, name: str) -> None:
        """Remove a recording."""
        self._send("DELETE /v1/recordings/{}", name)
