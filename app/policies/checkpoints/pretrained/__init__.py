"""Shipped checkpoints: tensors, manifest and model card of each."""

import json
from importlib import resources

from app.errors import Damaged, NotFound, ServiceError
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints.checkpoint import Checkpoint

SHA256 = {
    "pick": "056dc971847b749bfc306bf0cca70ef9a8df849a5fd31405143106037fdf0f05",
    "pick-monitored": "1bb1ece65bea9796d8d662fa1d4c2e353c28b1bf88d0e21998452a433d716a37",
    "sorting-e0": "7f1ffee69a2a4e1ab6eda76b5b4ff158a7b35ac23c60adecb4a3b5d0cbcb9555",
    "sorting-e1": "932b690abc9780c13a1a3eb5287f4d0f0d5715c846c23ae7f89bcfb7f68d9b9a",
    "reach": "2b95d1957f4b7d51b6c5f7bb3f02a6992d64940d37505005569d532755ffa7ce",
}
"""Names of the shipped checkpoints and their ids."""
ALIASES = tuple(SHA256)
"""Names of the shipped checkpoints."""


def load(alias: str) -> Checkpoint:
    """Return a shipped checkpoint.

    Raises:
        NotFound: No shipped checkpoint has that alias.
        Damaged: The file of the package is not the shipped one.
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
        pass  # an unreadable file is damaged, too
    remedy = "install the package again"
    raise Damaged("shipped checkpoint", alias, remedy, SHA256[alias])
