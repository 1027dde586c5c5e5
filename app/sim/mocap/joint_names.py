"""Identification of the joints of a recorded skeleton by name.

Supported are the names of the TUM clips, CMU, Mixamo, Biped, Xsens, SMPL, Daz, VRM, Kinect and
Unreal. Case, punctuation, text before a colon, and a common prefix and suffix of all names are
ignored: ``mixamorigHips``, ``Bip01 L UpperArm``, ``J_Bip_L_Hand``.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches

from app.errors import BadRecording, Fault
from app.sim.mocap.faults import bad
from app.sim.mocap.joint_centres import TRACK_NAMES

Joints = dict[str, tuple[int, ...]]
"""Indices of joints by role; several indices stand for their mean."""

_CENTRE: Mapping[str, Sequence[str]] = {
    "pelvis": ("hips", "hip", "pelvis", "spinebase", "midhip", "root"),
    "head": ("head",),
    "crown": ("headend", "headtopend", "headtop", "headnub", "headsite"),
    "neck": ("neck", "neck1", "neck01", "neckbase", "c7", "spineshoulder"),
}
_PARTS: Mapping[str, Sequence[str]] = {
    "shoulder": ("upperarm", "uparm", "arm", "shldr", "shldrbend", "shoulder", "humerus"),
    "elbow": ("elbow", "forearm", "forearmbend", "lowerarm", "lowarm", "radius"),
    "wrist": ("wrist", "hand"),
    "hip": ("upleg", "upperleg", "thigh", "thighbend", "hip", "femur"),
    "knee": ("knee", "lowerleg", "lowleg", "shin", "calf", "tibia", "leg"),
    "ankle": ("ankle", "foot"),
    "toe": ("toebase", "toe", "toes", "toe0", "ball", "foot"),
}
"""Spellings of each part, in order of preference."""


def _spellings() -> dict[str, tuple[str, ...]]:
    """Return the spellings of each role, in order of preference."""
    spelt = {role: (*names, *(f"c{one}" for one in names)) for role, names in _CENTRE.items()}
    for part, names in _PARTS.items():
        for letter, word in (("r", "right"), ("l", "left")):
            spelt[f"{part}_{letter}"] = tuple(
                form
                for name in names
                for side in (word, letter)
                for form in (f"{side}{name}", f"{name}{side}")
            )
    return spelt


SPELLINGS = _spellings()
ROLES = tuple(SPELLINGS)
"""Roles of joints; those of TRACK_NAMES are required."""


def find_joints(
    names: Sequence[str], parents: Sequence[int], stated: Mapping[str, str] | None = None
) -> Joints:
    """Return the joint of each role that the skeleton has.

    Without a neck, the parents of both shoulders replace it.

    Args:
        names: Names of the joints, such as ``mixamorig:LeftForeArm`` or ``left_forearm``.
        parents: Index of each joint's parent; -1 for the root.
        stated: Stated roles of joints, by their name in the skeleton.

    Raises:
        BadRecording: Joints are missing; the hint lists those of the file.
    """
    given = _stated_joints(names, stated or {})
    plain = [_plain(name) for name in names]
    found = max(
        (_found(plain, before, behind, given) for before, behind in _affixes(plain)),
        key=lambda one: sum(role in one for role in TRACK_NAMES),
    )
    joints: Joints = {role: (found[role],) for role in ROLES if role in found}
    shoulders = [parents[found[role]] for role in ("shoulder_r", "shoulder_l") if role in found]
    if "neck" not in found and len(shoulders) == 2 and min(shoulders) >= 0:
        joints["neck"] = tuple(dict.fromkeys(shoulders))
    missing = [role for role in TRACK_NAMES if role not in joints]
    if missing:
        listed = ", ".join(names[:40])[:300]
        hint = f"the file's joints are {listed}; a name map says which is which: theirs=ours"
        rule = f"has no joint that is known as {', '.join(missing)}"
        raise bad("HIERARCHY", "", rule, hint)
    return joints


def _found(
    plain: Sequence[str], before: str, behind: str, given: Mapping[str, int]
) -> dict[str, int]:
    """Return the joint of each role, for names with a prefix and suffix; no joint has two."""
    index = {name: k for k, name in reversed(list(enumerate(plain)))}
    found = dict(given)
    for role, spellings in SPELLINGS.items():
        places = (index.get(f"{before}{one}{behind}") for one in spellings)
        free = (k for k in places if k is not None and k not in found.values())
        if role not in found and (match := next(free, None)) is not None:
            found[role] = match
    return found


def _affixes(plain: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield possible prefixes and suffixes of all names, most likely first."""
    yield "", ""
    known = set()
    for name in plain:
        for spelling in SPELLINGS["pelvis"]:
            before, middle, behind = name.partition(spelling)
            if middle:
                known.add((before, behind))
    yield from sorted(known, key=lambda pair: (len(pair[0]) + len(pair[1]), pair))


def _stated_joints(names: Sequence[str], stated: Mapping[str, str]) -> dict[str, int]:
    """Return the joints of stated roles.

    Raises:
        BadRecording: A joint is not in the file, or a role is unknown.
    """
    faults, found = [], {}
    for theirs, ours in stated.items():
        if ours not in ROLES:
            rule, choices = "must be the name of one of our joints", ROLES
            faults.append(_unknown(f"name of {theirs[:40]!r}", ours, rule, choices))
        elif theirs not in names:
            rule = "must be the name of a joint of the file"
            faults.append(_unknown(f"joint of {ours}", theirs, rule, names))
        else:
            found[ours] = names.index(theirs)
    if faults:
        raise BadRecording(faults)
    return found


def _unknown(place: str, value: str, rule: str, choices: Sequence[str]) -> Fault:
    near = get_close_matches(value[:80], choices, n=3, cutoff=0.5) or choices
    hint = f"there are {', '.join(near)[:300]}"
    return Fault(place=place, value=repr(value[:40]), rule=rule, hint=hint)


def _plain(name: str) -> str:
    """Return a name in lower case, without punctuation and text before a colon."""
    return re.sub(r"[^a-z0-9]", "", re.split(r"[:|]", name)[-1].lower())
