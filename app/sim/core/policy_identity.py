"""Interface common to all trained policies: their identity."""

from typing import Protocol


class PolicyIdentity(Protocol):
    """Identity of a trained policy."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"reach-td3, 7.7 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell of its training."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""
