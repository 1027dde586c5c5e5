"""Convert the manifests of the shipped checkpoints to the present names, without retraining.

    python tools/convert_manifests.py

Flat presets become groups of fields, and renamed fields, values and observation groups get
their present names. The tensors stay as they are. A manifest is part of a checkpoint's
identity, so that the SHA-256 changes; it is replaced in every text file of the repository.
Converted manifests stay as they are.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.policies.checkpoints import checkpoint as formats  # noqa: E402 - the line above lets it be found
from app.policies.checkpoints.checkpoint import CHOOSING, SORTING, purpose_of  # noqa: E402
from app.policies.configs.fields import FieldGroup, TrainingConfig, read_config  # noqa: E402
from app.policies.configs.pick import PickPreset  # noqa: E402
from app.policies.configs.reach import ReachPreset  # noqa: E402
from app.policies.configs.sorting import SortingPreset  # noqa: E402

PRETRAINED = ROOT / "app/policies/checkpoints/pretrained"
FIELDS = {
    "action_degree": "action.degree",
    "action_bounds": "action.bounds",
    "action_meaning": "action.meaning",
    "way_share": "episode.on_path_share",
    "human_roaming": "people.human_off_task",
    "human_courtesy": "people.human_yielding",
    "people": "people.count",
    "target_every": "learning.target_update_interval",
    "network": "networks.kind",
    "advice_share": "expert.share",
    "advice_margin": "expert.margin",
    "advice_weight": "expert.weight",
}
"""Fields with another name than before; others are found in their group by name."""
VALUES: dict[tuple[str, object], object] = {
    ("exploration.noise", "ladder"): "ar1",
    ("people.count", "all"): "exact",
    ("episode.collision", "ends"): "terminates",
    ("episode.collision", "goes-on"): "continues",
    ("name", "reach-td3-crowd"): "reach-td3-people-set",
}
"""Values with another name than before."""
REMOVED = {"critic_sees": "observation", "precision": "float32", "option_rate": 0.0}
"""Fields that were removed, with the one value that remains."""
GROUPS: dict[str, str] = {}
"""Groups of observations with another name than before."""
NAMES = (".py", ".md", ".json", ".html", ".js", ".toml")
"""Endings of the files that may name a checkpoint."""


def main() -> None:
    """Convert every shipped checkpoint, and replace the old identities."""
    replaced: dict[str, str] = {}
    for path in sorted(PRETRAINED.glob("*.json")):
        manifest = json.loads(path.read_text(encoding="utf-8"))
        tensors = path.with_suffix(".safetensors").read_bytes()
        before = formats.load(manifest, tensors).sha256
        converted = formats.load(convert(manifest), tensors)
        text = json.dumps(converted.manifest, indent=1) + "\n"
        path.write_text(text, encoding="utf-8")
        replaced |= {before[:n]: converted.sha256[:n] for n in (64, 12, 8)}
    replace_all(replaced)


def convert(manifest: dict[str, Any]) -> dict[str, Any]:
    """Return a manifest with the present names."""
    purpose = purpose_of(manifest)
    kind: type[PickPreset | ReachPreset | SortingPreset] = SortingPreset
    if purpose != SORTING:
        kind = PickPreset if purpose == CHOOSING else ReachPreset
    layout = [[GROUPS.get(name, name), size] for name, size in manifest["layout"]]
    preset = manifest["preset"]
    if "learning" not in preset:
        preset = read_config(kind, grouped(preset, kind), "manifest.preset").model_dump()
    return {**manifest, "preset": preset, "layout": layout}


def grouped(flat: dict[str, Any], kind: type[TrainingConfig]) -> dict[str, Any]:
    """Return the fields of a flat preset by group."""
    known = {
        field: f"{name}.{field}"
        for name, info in kind.model_fields.items()
        if isinstance(info.annotation, type) and issubclass(info.annotation, FieldGroup)
        for field in info.annotation.model_fields
    }
    found: dict[str, Any] = {}
    for name, value in flat.items():
        if name not in known and name in REMOVED:
            assert value == REMOVED[name], f"{name} = {value} is not supported any more"
            continue
        path = FIELDS.get(name) or known.get(name, name)
        value = VALUES.get((path, value), value)
        group, dot, field = path.partition(".")
        if dot:
            found.setdefault(group, {})[field] = value
        else:
            found[group] = value
    return found


def replace_all(replaced: dict[str, str]) -> None:
    """Replace identities in the text files of the repository, longest first."""
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for path in map(ROOT.joinpath, listed.stdout.split()):
        if path.suffix not in NAMES or not path.is_file():
            continue
        text = path.read_text(encoding="utf-8")
        for before in sorted(replaced, key=len, reverse=True):
            text = text.replace(before, replaced[before])
        if text != path.read_text(encoding="utf-8"):
            path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
