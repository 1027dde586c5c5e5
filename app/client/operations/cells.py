"""Operations with the tag cells; written by ``make client``."""

from collections.abc import Mapping
from typing import Any

from app.api.schemas.cells import CellList, CellPublic
from app.client.transport import Transport


class CellsOperations(Transport):
    """Operations with the tag cells."""

    def list_cells(self) -> CellList:
        """List the work cells."""
        return self._parsed(CellList, "GET /v1/cells")

    def create_cell(self, body: Mapping[str, Any]) -> CellPublic:
        """Add a work cell of your own."""
        return self._parsed(CellPublic, "POST /v1/cells", body=body)

    def get_cell(self, name: str) -> CellPublic:
        """One work cell."""
        return self._parsed(CellPublic, "GET /v1/cells/{}", name)

    def delete_cell(self, name: str) -> None:
        """Remove a work cell of your own."""
        self._send("DELETE /v1/cells/{}", name)
