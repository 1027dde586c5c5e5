"""Identity of a policy that was loaded from a checkpoint."""

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of


class TrainedPolicy:
    """A checkpoint with its name and the work cell of its training.

    Args:
        checkpoint: A ``policy`` checkpoint.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        self._checkpoint = checkpoint
        self._cell = cell_of(checkpoint.manifest)
        self._cell_sha256 = self._cell.sha256

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""
        return self._checkpoint.sha256

    @property
    def title(self) -> str:
        """Name of the preset and number of training steps."""
        manifest = self._checkpoint.manifest
        name = manifest["preset"].get("name", "policy")
        return f"{name}, {manifest['step'] / 1e6:.2f} M steps"

    @property
    def cell(self) -> str:
        """Name of the work cell of the training."""
        return self._cell.name

    @property
    def cell_sha256(self) -> str:
        """Identity of the content of that cell."""
        return self._cell_sha256
