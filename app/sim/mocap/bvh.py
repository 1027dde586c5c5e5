"""Reader of BVH files: a skeleton as a tree of joints, and its channels per frame.

An invalid file raises :class:`~app.errors.BadRecording`, whose faults name the line. Angles are
in degrees; the format does not state the unit of lengths. Source: Meredith and Maddock, "Motion
capture file formats explained" (2001).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from app.errors import BadRecording, Fault, digits
from app.sim.core.arrays import Vec
from app.sim.mocap.faults import MAX_FAULTS, bad, shown

MAX_JOINTS = 300
"""Largest number of joints; a skeleton with all fingers has about 80."""
MAX_DEPTH = 60
"""Largest depth of the tree."""
MAX_FRAMES = 200_000
"""Largest number of frames: half an hour at 100 Hz."""
MAX_LINE_ENDS = 4 * MAX_FRAMES + 10_000
"""Largest number of line ends: two per line, and as many empty lines as frames."""
CHUNK_FRAMES = 4096
"""Frames converted at once: all joints of all frames would take more than 1 GB."""
MAX_NUMBER = 1e9
"""Largest number in a file, in any unit."""
MIN_DT, MAX_DT = 1e-3, 0.1
"""Range of the time between two frames in motion capture [s]."""
ROUNDED = 0.01
"""Share of these by which a rounded time may be outside."""

_CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
_WORDS = ("HIERARCHY", "ROOT", "JOINT", "End", "OFFSET", "CHANNELS", "{", "}")
_KEYWORDS = {word.lower(): word for word in (*_WORDS, *_CHANNELS, "MOTION")}
"""Keywords by their lower case: other programs write and read them in any case."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BvhJoint:
    """One joint of the tree; parents precede their children."""

    name: str
    """Name in the file; of an end site, the name of its joint and ``.end``."""
    parent: int
    """Index of the parent; -1 for the root."""
    offset: tuple[float, float, float]
    """Position in the parent's frame [the file's unit]."""
    channels: tuple[str, ...]
    """Channels in the file's order, which is the order of multiplication."""
    line: int
    """Line of the file that opens the joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bvh:
    """Content of a file."""

    joints: tuple[BvhJoint, ...]
    """The skeleton, root first."""
    dt: float
    """Time between two frames [s]."""
    values: Vec
    """Channels [the file's unit, degrees], shape (n, number of channels)."""
    first_line: int
    """Line of the first frame."""

    @property
    def channels(self) -> tuple[tuple[int, str], ...]:
        """Index of the joint and name of the channel, per column of ``values``."""
        return tuple((k, name) for k, one in enumerate(self.joints) for name in one.channels)


def read_bvh(text: str) -> Bvh:
    """Return the skeleton and the channels of a file.

    Raises:
        BadRecording: The text is not a valid BVH file; the faults name lines.
    """
    lines = lines_of(text)
    firsts = ([_keyword(word) for word in line.split()[:1]] for line in lines)
    start = next((k for k, first in enumerate(firsts) if first == ["MOTION"]), None)
    if start is None:
        rule = "has no line MOTION, which precedes the frames"
        raise bad(len(lines), "", rule, "the file is cut off or not a BVH file")
    joints = _Tree(_words(lines[:start])).read()
    n_channels = sum(len(joint.channels) for joint in joints)
    head = [(k + 1, lines[k]) for k in range(start + 1, len(lines)) if lines[k].strip()]
    n_frames, dt = _frame_lines(head[:2], len(lines))
    values = read_rows(head[2:], n_channels, n_frames)
    first_line = head[2][0]
    return Bvh(joints=joints, dt=dt, values=values, first_line=first_line)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text.

    Raises:
        BadRecording: The text has more lines than a file of MAX_FRAMES frames.
    """
    n_ends = sum(text.count(end) for end in "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029")
    if n_ends > MAX_LINE_ENDS:
        rule = f"must be at most {MAX_FRAMES}"
        raise bad("frames", f"<{n_ends} ends of lines>", rule, "cut the file into parts")
    return text.splitlines()


def forward(bvh: Bvh, wanted: Sequence[int]) -> Vec:
    """Return the positions of some joints [the file's unit], shape (n, len(wanted), 3).

    Position channels replace the offset of a joint, as in most readers.
    """
    needed = with_ancestors(bvh, wanted)
    parts = range(0, len(bvh.values), CHUNK_FRAMES)
    return np.concatenate(
        [_forward(bvh, bvh.values[k : k + CHUNK_FRAMES], wanted, needed) for k in parts]
    )


def _forward(bvh: Bvh, values: Vec, wanted: Sequence[int], needed: set[int]) -> Vec:
    places: dict[int, Vec] = {}
    turns: dict[int, Vec] = {}
    column = 0
    for k, joint in enumerate(bvh.joints):
        first, column = column, column + len(joint.channels)
        if k not in needed:
            continue
        local, turn = _local(joint, values[:, first:column])
        if joint.parent >= 0:
            above = turns[joint.parent]
            local = places[joint.parent] + np.einsum("nij,nj->ni", above, local)
            turn = above if turn is None else above @ turn
        elif turn is None:
            turn = np.tile(np.eye(3), (len(local), 1, 1))
        places[k], turns[k] = local, turn
    return np.stack([places[k] for k in wanted], axis=1)


def with_ancestors(bvh: Bvh, wanted: Sequence[int]) -> set[int]:
    """Return the indices of joints and of all their ancestors."""
    needed: set[int] = set()
    for k in wanted:
        while k >= 0 and k not in needed:
            needed.add(k)
            k = bvh.joints[k].parent
    return needed


def _local(joint: BvhJoint, values: Vec) -> tuple[Vec, Vec | None]:
    """Return position and rotation of a joint in its parent's frame; None: no rotation."""
    place, turn = np.tile(np.asarray(joint.offset), (len(values), 1)), None
    for name, value in zip(joint.channels, values.T, strict=True):
        axis = "XYZ".index(name[0])
        if name.endswith("position"):
            place[:, axis] = value
        else:
            more = axis_turns(axis, np.radians(value))
            turn = more if turn is None else turn @ more
    return place, turn


def axis_turns(axis: int, angle: Vec) -> Vec:
    """Return rotations about one axis (0 x, 1 y, 2 z) by ``angle`` [rad], shape (n, 3, 3)."""
    return np.asarray(
        scipy.spatial.transform.Rotation.from_euler("xyz"[axis], angle[:, None]).as_matrix()
    )


def read_rows(lines: Sequence[tuple[int, str]], n_columns: int, n_rows: int) -> Vec:
    """Return a table of finite numbers, shape (n, n_columns).

    Args:
        lines: Line numbers and texts, without empty lines.
        n_columns: Number of values per line, one per channel of the skeleton.
        n_rows: Number of lines stated in the head of the file.

    Raises:
        BadRecording: A line holds another number of values, or text.
    """
    if (most := max(len(lines), n_rows)) > MAX_FRAMES:
        value = f"<{most} frames>"
        raise bad("frames", value, f"must be at most {MAX_FRAMES}", "cut the file into parts")
    faults: list[Fault] = []
    rows: list[Vec] = []  # grows with the text, however many channels the head states
    for number, line in lines:
        words = line.split()
        if len(words) != n_columns:
            rule = f"must hold {n_columns} numbers, a number per channel of the skeleton"
            place, hint = f"line {number}", _comma_hint(line)
            faults.append(Fault(place=place, value=f"<{len(words)}>", rule=rule, hint=hint))
        else:
            rows.append(_row(line, words))
            if not (np.abs(rows[-1]) <= MAX_NUMBER).all():
                faults.extend(_bad_words(words, number))
        if len(faults) >= MAX_FAULTS:
            break
    if not faults and len(lines) != n_rows:
        rule = f"must be the {n_rows} that the head of the file states"
        hint = "the file is cut off" if len(lines) < n_rows else ""
        place = f"frames, last line {lines[-1][0]}" if lines else "frames"
        faults.append(Fault(place=place, value=f"<{len(lines)}>", rule=rule, hint=hint))
    if faults:
        raise BadRecording(faults[:MAX_FAULTS])
    if len(rows) < 2:
        raise bad("frames", f"<{len(rows)}>", "must be at least 2", "one frame is not a motion")
    return np.array(rows)


def _row(line: str, words: Sequence[str]) -> Vec:
    """Return the numbers of a line; NaN if one is none."""
    try:
        return np.array([np.nan] if "_" in line else list(map(float, words)))
    except ValueError:
        return np.array([np.nan])


def _bad_words(words: Sequence[str], line: int) -> Iterator[Fault]:
    for k, word in enumerate(words):
        if rule := _number_rule(word):
            place, hint = f"line {line}, number {k + 1}", _comma_hint(word)
            yield Fault(place=place, value=shown(word), rule=rule, hint=hint)


def as_number(word: str) -> float | None:
    """Return a number, None for text; unlike Python's, ``1_000`` is none."""
    try:
        return None if "_" in word else float(word)
    except ValueError:
        return None


def _number_rule(word: str) -> str:
    """Return the rule that a word violates; empty for a valid number."""
    value = as_number(word)
    if value is None:
        return "must be a number"
    if abs(value) <= MAX_NUMBER:
        return ""
    return f"must be a finite number of at most {digits(MAX_NUMBER)}"


def _number(word: str, line: int) -> float:
    """Return the number in a line, validated."""
    if rule := _number_rule(word):
        raise bad(line, shown(word), rule, _comma_hint(word))
    return float(word)


def _comma_hint(text: str) -> str:
    """Return a hint about commas in a text; empty without commas."""
    if re.fullmatch(r"[-+]?\d*,\d*(e[-+]?\d+)?", text.strip(), re.IGNORECASE):
        return "decimal commas: write points"
    return "commas between numbers: write spaces" if "," in text else ""


def check_dt(dt: float, place: str) -> float:
    """Return the time between two frames [s], validated.

    Raises:
        BadRecording: The time is outside [MIN_DT, MAX_DT], by more than rounding in a file.
    """
    if (1.0 - ROUNDED) * MIN_DT <= dt <= (1.0 + ROUNDED) * MAX_DT:
        return dt
    guesses = []
    for unit, per_second in (("milli", 1e3), ("micro", 1e6), ("nano", 1e9)):
        if MIN_DT <= dt / per_second <= MAX_DT:
            guesses.append(f"{unit}seconds: in s that is {dt / per_second:g}")
    if dt > 0.0 and MIN_DT <= 1.0 / dt <= MAX_DT:
        guesses.append(f"frames per second: in s that is {1.0 / dt:g}")
    hint = f"looks like {' or '.join(guesses)}" if guesses else ""
    raise bad(place, f"{dt:g}", f"must lie in [{MIN_DT}, {MAX_DT}] s between frames", hint)


def _frame_lines(head: list[tuple[int, str]], n_lines: int) -> tuple[int, float]:
    """Return number of frames and frame time [s] from their two lines."""
    texts = [*head, (n_lines, ""), (n_lines, "")][:2]
    found = []
    for (line, text), name in zip(texts, ("Frames:", "Frame Time:"), strict=True):
        start, colon, rest = text.partition(":")
        if not colon or start.lower().split() != name[:-1].lower().split():
            raise bad(line, shown(text.strip()), f'must be "{name}" with a number')
        found.append(_number(rest.strip(), line))
    if found[0] < 0.0 or found[0] != int(found[0]):
        raise bad(texts[0][0], f"{found[0]:g}", "must be a whole number of frames")
    return int(found[0]), check_dt(found[1], f"line {texts[1][0]}, Frame Time")


def _keyword(word: str) -> str:
    """Return a word, or the keyword that it is in any case."""
    return _KEYWORDS.get(word.lower(), word)


def _words(lines: list[str]) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(lines, 1):
        for word in line.replace("{", " { ").replace("}", " } ").split():
            yield number, word


class _Tree:
    """Parser of the hierarchy section."""

    def __init__(self, words: Iterator[tuple[int, str]]) -> None:
        self._words, self._line = words, 1
        self._ahead = next(words, None)
        self._joints: list[BvhJoint] = []
        self._open: list[int] = []

    def read(self) -> tuple[BvhJoint, ...]:
        """Return all joints, the root first."""
        if _keyword(self._next("HIERARCHY")) != "HIERARCHY":
            raise bad(self._line, "", "must be HIERARCHY", "the file is not a BVH file")
        self._open_joint(_keyword(self._next("ROOT")))
        while self._open:
            word = _keyword(self._next("} or JOINT"))
            if word == "}":
                self._open.pop()
            elif word in ("JOINT", "End"):
                self._open_joint(word)
            else:
                rule = f"must be one of {', '.join(_WORDS[2:])}"
                raise bad(self._line, shown(word), rule)
        if self._ahead is not None:
            rule = "must be MOTION: a file must hold one skeleton"
            raise bad(self._ahead[0], shown(self._ahead[1]), rule)
        return tuple(self._joints)

    def _open_joint(self, word: str) -> None:
        if word not in ("ROOT", "JOINT", "End") or (word == "ROOT") != (not self._joints):
            raise bad(self._line, shown(word), "must be ROOT, and only once")
        line, parent = self._line, self._open[-1] if self._open else -1
        name = self._name(word, parent)
        self._expect("{")
        self._expect("OFFSET")
        x, y, z = (self._number() for _ in range(3))
        channels = () if word == "End" else self._channels()
        self._joints.append(
            BvhJoint(name=name, parent=parent, offset=(x, y, z), channels=channels, line=line)
        )
        if len(self._joints) > MAX_JOINTS or len(self._open) >= MAX_DEPTH:
            rule = f"must have at most {MAX_JOINTS} joints, nested at most {MAX_DEPTH} deep"
            raise bad(line, "", rule)
        self._open.append(len(self._joints) - 1)

    def _name(self, word: str, parent: int) -> str:
        """Return a joint's name, which may have several words, up to its brace."""
        words = [self._next("a name")]
        if word == "End":
            return f"{self._joints[parent].name}.end"
        if words[0] in _WORDS:
            raise bad(self._line, shown(words[0]), "must be the name of a joint")
        line = self._line
        while self._ahead is not None and self._ahead[0] == line and self._ahead[1] != "{":
            words.append(self._next("a name"))
        name = " ".join(words)
        if any(one.name == name for one in self._joints):
            raise bad(line, shown(name), "is the name of two joints")
        return name

    def _channels(self) -> tuple[str, ...]:
        self._expect("CHANNELS")
        count = self._number()
        if count not in range(7):
            raise bad(self._line, f"{count:g}", "must be 0 to 6 channels")
        names = tuple(_keyword(self._next("a channel")) for _ in range(int(count)))
        for name in names:
            if name not in _CHANNELS or names.count(name) > 1:
                rule = f"must be one of {', '.join(_CHANNELS)}, each once"
                raise bad(self._line, shown(name), rule)
        return names

    def _number(self) -> float:
        word = self._next("a number")
        return _number(word, self._line)

    def _expect(self, word: str) -> None:
        found = self._next(word)
        if _keyword(found) != word:
            raise bad(self._line, shown(found), f"must be {word}")

    def _next(self, wanted: str) -> str:
        found, self._ahead = self._ahead, next(self._words, None)
        if found is None:
            rule = f"ends where {wanted} must follow"
            raise bad(self._line, "", rule, "a } is missing or the file is cut off")
        self._line, word = found
        return word
