"""Identity of a policy that was loaded from a checkpoint."""

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.configs.presets import TITLES


class TrainedPolicy:
    """A checkpoint with its name and the work cell of its training.

    Args:
        checkpoint: A ``policy`` checkpoint.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        manifest = checkpoint.manifest
        name = manifest["preset"].get("name", "policy")
        title = TITLES.get(name, name)
        self._cell = cell_of(manifest)
        self.checkpoint: str = checkpoint.sha256
        """SHA-256 of the checkpoint."""
        self.title = f"{title}, {manifest['step'] / 1e6:.2f} M steps"
        """Title of the preset and number of training steps."""
        self.cell = self._cell.name
        """Name of the work cell of the training."""
        self.cell_sha256 = self._cell.sha256
        """Identity of the content of that cell."""
