"""Operations with the tag cells; written by ``make client``."""

from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from app.api.schemas.cells import CellList, CellPublic
from app.client.transport import Transport


class CellsOperations(Transport):
    """Operations with the tag cells."""

    def list_cells(self) -> CellList:
        """List the work cells."""
        return self._parsed(CellList, self._send("GET", "/v1/cells"))

    def create_cell(self, body: Mapping[str, Any]) -> CellPublic:
        """Add a work cell of your own."""
        return self._parsed(CellPublic, self._send("POST", "/v1/cells", body=body))

    def get_cell(self, name: str) -> CellPublic:
        """One work cell."""
        return self._parsed(CellPublic, self._send("GET", f"/v1/cells/{quote(name, safe='')}"))

    def delete_cell(self, name: str) -> None:
        """Remove a work cell of your own."""
        self._send("DELETE", f"/v1/cells/{quote(name, safe='')}")
