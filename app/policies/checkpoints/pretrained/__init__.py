"""The shipped checkpoints, each as tensors, manifest and model card of one name."""

import json
from importlib import resources

from app.errors import Damaged, NotFound, ServiceError
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints.checkpoint import Checkpoint

SHA256 = {
    "pick": "7565621f985090e11ec1c3e052fe6896b028bf3e0cd565bc1f98a6b7fd12f735",
    "sorting-e0": "7946cf565e6e963d18cfd27ce21e11b93fc8708eebe318a80e9f20da91d7cbdb",
    "sorting-e1": "75f5cceef540e55ac1175b35a774d8a1c9e97a5dba1f88a678f167f0837fe978",
    "reach": "95cb0e5cd14c2937cf04b8c55d6085b7e47c73b65def0650327bdc349b6f31e8",
}
"""Names of the shipped checkpoints and their ids."""
ALIASES = tuple(SHA256)
"""Names of the shipped checkpoints."""


def load(alias: str) -> Checkpoint:
    """Return a shipped checkpoint.

    Raises:
        NotFound: None is shipped under that alias.
        Damaged: The package's file is not the one that was shipped.
    """
    if alias not in ALIASES:
        raise NotFound("shipped checkpoint", alias, ALIASES)
    folder = resources.files("app.policies.checkpoints.pretrained")
    try:
        manifest = json.loads((folder / f"{alias}.json").read_bytes())
        found = formats.load(manifest, (folder / f"{alias}.safetensors").read_bytes())
        if found.sha256 == SHA256[alias]:
            return found
    except (OSError, ValueError, ServiceError):
        pass  # what cannot be read is damaged as well
    remedy = "install the package again"
    raise Damaged("shipped checkpoint", alias, remedy, SHA256[alias])
