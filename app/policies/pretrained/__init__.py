"""The shipped checkpoints, each as tensors, manifest and model card of one name."""

import json
from importlib import resources

from app.errors import NotFound
from app.policies import checkpoint as formats
from app.policies.checkpoint import Checkpoint

ALIASES = ("pick", "sorting-e0", "sorting-e1", "reach")
"""Names of the shipped checkpoints."""


def load(alias: str) -> Checkpoint:
    """Return a shipped checkpoint.

    Raises:
        NotFound: None is shipped under that alias.
    """
    if alias not in ALIASES:
        raise NotFound("shipped checkpoint", alias, ALIASES)
    folder = resources.files("app.policies.pretrained")
    manifest = json.loads((folder / f"{alias}.json").read_text("utf-8"))
    return formats.load(manifest, (folder / f"{alias}.safetensors").read_bytes())
