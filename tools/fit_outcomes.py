"""Fit the outcome probabilities of a shipped pick policy again, as its training does.

Actor and critics stay as they are. The files in ``app/policies/checkpoints/pretrained`` are
replaced; the id that is logged belongs into ``SHA256`` of that package.
"""

import logging
from importlib import resources
from pathlib import Path
from typing import Any

import torch

from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.files import write_files
from app.policies.checkpoints.model_state import versions, weights_of
from app.policies.inference.value_networks import pick_preset_of
from app.policies.networks.outcome import OutcomeHead
from app.policies.training.pick import outcomes_of
from app.policies.training.train import without_denormals
from app.provenance import describe
from app.sim.cells.cell import load_cell
from tools.arguments import parser_of

logger = logging.getLogger(__name__)
PICKS = ("pick", "pick-monitored")
"""Shipped policies that predict outcomes."""


def with_new_outcomes(checkpoint: Checkpoint) -> Checkpoint:
    """Return a checkpoint whose outcomes are fitted to new episodes of its policy.

    Raises:
        InvalidInput: The checkpoint belongs to another scenario.
        ValueError: Too few episodes ended within its number of training steps.
    """
    preset = pick_preset_of(checkpoint)
    with without_denormals():
        head = outcomes_of(checkpoint, preset, load_cell(preset.cell), lambda: False)
    if head is None:
        raise ValueError("too few episodes ended: outcomes need a longer training")
    commits = dict.fromkeys([*checkpoint.manifest["commits"], describe()["commit"]])
    fields = {"commits": [one for one in commits if one], "versions": versions()}
    return with_outcomes(checkpoint, head, fields)


def with_outcomes(
    checkpoint: Checkpoint, head: OutcomeHead, fields: dict[str, Any]
) -> Checkpoint:
    """Return a checkpoint with other outcome probabilities and some fields of the manifest."""
    kept = {
        name: array
        for name, array in checkpoint.arrays().items()
        if not name.startswith("outcome.")
    }
    return formats.pack(checkpoint.manifest | fields, kept | weights_of({"outcome": head}))


def main() -> None:
    """Fit the outcomes of one policy and replace its files."""
    parser = parser_of(__doc__)
    parser.add_argument("policy", choices=PICKS)
    policy = parser.parse_args().policy
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    torch.set_num_threads(1)
    found = with_new_outcomes(pretrained.load(policy))
    folder = Path(str(resources.files("app.policies.checkpoints.pretrained")))
    write_files(folder / f"{policy}.safetensors", found)
    logger.info("%s: %s", policy, found.sha256)


if __name__ == "__main__":
    main()
