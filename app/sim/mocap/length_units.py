"""Units of a recorded skeleton and of its root's path.

The unit is the one that gives a human stature. With legs, the stature follows from the length
from ankle to neck; without, from the median of trunk, clavicles, upper arms and forearms. The
proportions must be human. If two units fit, the file is rejected: a child in inches has the
same lengths as a giant in CMU's units.

The root's path is checked with the legs: in its unit, either the height of the pelvis over the
floor is the length of the legs, or the lower foot does not slide while the pelvis moves.

Source of the proportions: Drillis and Contini (1966), as in Winter, "Biomechanics and Motor
Control of Human Movement", fig. 4.1. Deviates: ranges that include joints of other definitions.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import STATURE
from app.sim.human.kernels.kinematics import MEDIAN_TRUNK
from app.sim.mocap.faults import bad
from app.sim.mocap.read_options import UNITS, metres

MIN_STATURE, MAX_STATURE = 1.0, 2.1
"""Range of statures [m], from children of four years on."""
DOUBT_WITH_LEGS, DOUBT_WITHOUT = 0.08, 0.12
"""Relative error of a stature found from a skeleton, with and without legs."""
ANKLE_TO_NECK, ANKLE_TO_CROWN = 0.818 - 0.039, 1.0 - 0.039
"""Heights of the neck's base and the top of the head over the ankle, relative to stature."""
HEAD = (0.10, 0.25)
"""Range of the length from neck to top of the head, relative to stature."""
SHARES: Mapping[str, float] = {
    "trunk": MEDIAN_TRUNK / STATURE,
    "clavicle": 0.105,
    "upper_arm": 0.172,
    "forearm": 0.149,
}
"""Lengths relative to stature."""
PROPORTIONS: Mapping[str, tuple[float, float]] = {
    "trunk": (0.14, 0.42),
    "clavicle": (0.03, 0.22),
    "upper_arm": (0.10, 0.26),
    "forearm": (0.09, 0.24),
    "leg": (0.35, 0.62),
}
"""Ranges of lengths relative to stature; wide, as markers are not joint centres."""
FOREARM_TO_UPPER_ARM = (0.55, 1.5)
"""Range of the length of the forearm relative to the upper arm."""
STATED_STATURE = (0.5, 3.0)
"""Range of the stature if the unit is stated [m]."""
SOLE = 0.045
"""Height of the ankle over the floor, relative to stature."""
STANDING = (0.85, 1.18)
"""Range of the pelvis's height over the file's zero, relative to the length of the legs."""
HIGH_PELVIS = (0.42, 0.62)
"""Range of the pelvis's height relative to stature, for recordings without legs."""
MIN_PLANTED, SURELY_PLANTED = 0.8, 0.95
"""Least cosines between the paths of pelvis and lower foot for a planted foot, without and
against the evidence of the pelvis's height."""
SAME_FACTOR = (0.75, 1.33)
"""Range of the ratio of the root's unit to the skeleton's for equal units."""
MAX_PACE = 3.0
"""Largest speed of a pelvis in most frames [m/s]."""
MIN_EXTENT = 0.003
"""Least extent of the motion of a pelvis that is not fixed [m]."""
MAX_HIGH = 3.0
"""Largest height of a pelvis above or below the file's zero, without evidence of legs [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stature:
    """Stature of a person, found from the lengths of a skeleton."""

    value: float
    """Height of the top of the head [the file's unit]."""
    doubt: float
    """Relative error."""
    basis: str
    """Lengths from which it is found."""


def find_lengths(points: Mapping[str, Vec]) -> dict[str, float]:
    """Return the lengths of body segments [the file's unit].

    Args:
        points: Joint centres by role, each of shape (n, 3).
    """

    def length(a: str, b: str, share: float = 50.0) -> float:
        return float(np.percentile(np.linalg.norm(points[b] - points[a], axis=1), share))

    found = {"trunk": length("pelvis", "neck", 95.0)}
    for side in ("_r", "_l"):
        found[f"clavicle{side}"] = length("neck", f"shoulder{side}")
        found[f"upper_arm{side}"] = length(f"shoulder{side}", f"elbow{side}")
        found[f"forearm{side}"] = length(f"elbow{side}", f"wrist{side}")
        hip, knee, ankle = (f"{part}{side}" for part in ("hip", "knee", "ankle"))
        if {hip, ankle} <= points.keys():
            joints = [hip, knee, ankle] if knee in points else [hip, ankle]
            found[f"leg{side}"] = sum(length(a, b, 95.0) for a, b in pairwise(joints))
    if "leg_r" in found and "leg_l" in found:
        hips = (points["hip_r"] + points["hip_l"]) / 2.0
        spine = np.linalg.norm(points["neck"] - hips, axis=1)
        found["hips_to_neck"] = float(np.percentile(spine, 95.0))
    if {"head", "crown"} <= points.keys():
        found["head"] = length("neck", "head") + length("head", "crown")
    return found


def find_stature(lengths: Mapping[str, float]) -> Stature:
    """Return the stature that follows from lengths, in their unit.

    Args:
        lengths: From :func:`find_lengths`.
    """
    if "hips_to_neck" in lengths:
        leg = (lengths["leg_r"] + lengths["leg_l"]) / 2.0
        value = (leg + lengths["hips_to_neck"]) / ANKLE_TO_NECK
        head = lengths.get("head", 0.0)
        if HEAD[0] * value <= head <= HEAD[1] * value:
            value = (value + (leg + lengths["hips_to_neck"] + head) / ANKLE_TO_CROWN) / 2.0
        return Stature(value=value, doubt=DOUBT_WITH_LEGS, basis="ankle to neck")
    each = [lengths[name] / SHARES[_part(name)] for name in lengths if _part(name) in SHARES]
    value, basis = float(np.median(each)), "trunk and arms"
    return Stature(value=value, doubt=DOUBT_WITHOUT, basis=basis)


def find_unit(stature: Stature) -> str:
    """Return the unit, one of UNITS, in which a stature is human.

    Raises:
        BadRecording: No unit or two units fit; the fault names them with the statures.
    """
    low, high = MIN_STATURE / (1.0 + stature.doubt), MAX_STATURE * (1.0 + stature.doubt)
    tall = {unit: factor * stature.value for unit, factor in UNITS.items()}
    fits = [unit for unit in UNITS if low <= tall[unit] <= high]
    if len(fits) == 1:
        return fits[0]
    place, value = f"unit of the skeleton: stature by {stature.basis}", f"{stature.value:.4g}"
    if fits:
        named = " and ".join(f"{unit} ({tall[unit]:.2f} m tall)" for unit in fits)
        hint = f"state unit = {' or '.join(fits)}"
        raise bad(place, value, f"fits two units, {named}", hint)
    rule = f"must be {MIN_STATURE} to {MAX_STATURE} m in one of the units {', '.join(UNITS)}"
    hint = "state unit = metres per unit, as a number"
    if stature.value > 0.0:
        hint += f": {STATURE / stature.value:.3g} makes the person {STATURE} m tall"
    raise bad(place, value, rule, hint)


def require_proportions(lengths: Mapping[str, float], stature: Stature, unit: str) -> None:
    """Raise BadRecording, which names a length, if proportions or stature are not human."""
    tall = metres(unit) * stature.value
    low, high = STATED_STATURE
    if not low <= tall <= high:
        rule = f"makes the person {tall:.4g} m tall; must be {low} to {high} m"
        raise bad("unit", unit, rule)
    for name, length in lengths.items():
        if _part(name) not in PROPORTIONS:
            continue
        low, high = PROPORTIONS[_part(name)]
        if not low * stature.value <= length <= high * stature.value:
            rule = f"must be {low * tall:.3f} to {high * tall:.3f} m long for a stature of "
            rule += f"{tall:.2f} m, by {stature.basis}, in {unit}"
            raise bad(name, f"{metres(unit) * length:.3f} m", rule)
    low, high = FOREARM_TO_UPPER_ARM
    for side in ("_r", "_l"):
        ratio = lengths[f"forearm{side}"] / lengths[f"upper_arm{side}"]
        if not low <= ratio <= high:
            hint = "elbow or wrist is another joint than the one of that name"
            rule = f"must be {low} to {high} times the upper arm"
            raise bad(f"forearm{side}", f"{ratio:.2f} times", rule, hint)


def require_one_unit(
    pelvis: Vec, ankles: Vec | None, dt: float, stature: Stature, unit: str
) -> str:
    """Check that the root's path is in the unit of the skeleton.

    Args:
        pelvis: Path of the pelvis [the root's unit], z up, shape (n, 3).
        ankles: Ankles relative to the pelvis [the skeleton's unit], z up, shape (n, 2, 3); None
            without legs.
        dt: Time between two frames [s].
        stature: Stature of the person.

    Returns:
        A note if the file's zero is not the floor, otherwise an empty text.

    Raises:
        BadRecording: Another unit fits and this one does not; the fault names both.
    """
    own, planted, cosine, span = metres(unit), 0.0, 0.0, HIGH_PELVIS
    legs = own * stature.value
    what = f"must fit a stature of {legs:.2f} m"
    if ankles is not None:
        planted, cosine = _planted(pelvis, ankles, dt, stature.value)
        span = STANDING
        legs = own * (float(np.median(-ankles[:, :, 2].min(axis=1))) + SOLE * stature.value)
        what = f"must fit the legs, which hold it {legs:.2f} m over the floor"
    height = float(np.median(pelvis[:, 2]))

    def stands(length: float) -> bool:
        return _within(length * height / legs, span)

    def treads(length: float) -> bool:
        return cosine > MIN_PLANTED and _within(planted * own / length, SAME_FACTOR)

    rest = {one: length for one, length in UNITS.items() if not 0.99 < length / own < 1.01}
    slides = cosine > SURELY_PLANTED and any(treads(length) for length in rest.values())
    if treads(own) or (stands(own) and not slides):
        return ""
    possible = _possible_path(pelvis, dt)
    others = [
        one
        for one, length in rest.items()
        if (stands(length) or treads(length)) and possible(length)
    ]
    if not others and possible(own):
        over = f"the file's zero is not the floor: the pelvis is {own * height:.2f} m over it"
        return f"{over}; the unit of its path, {unit}, cannot be verified"
    others = others or [one for one, length in rest.items() if possible(length)]
    named = "".join(f", or {UNITS[one] * height:.3g} m in {one}" for one in others)
    value = f"{own * height:.3g} m in {unit}, as the skeleton{named}"
    hint = f"state root_unit = {' or '.join([unit, *others])}; the skeleton is in {unit}"
    raise bad("height of the pelvis, by the root's path", value, what, hint)


def _possible_path(pelvis: Vec, dt: float) -> Callable[[float], bool]:
    """Return the test whether a path is human, as a function of its unit [m]."""
    fastest = pace(pelvis, dt, 95.0)
    extent, height = float(np.ptp(pelvis, axis=0).max()), float(np.median(pelvis[:, 2]))

    def possible(length: float) -> bool:
        still = 0.0 < length * extent < MIN_EXTENT
        return not still and length * fastest <= MAX_PACE and length * abs(height) <= MAX_HIGH

    return possible


def pace(pelvis: Vec, dt: float, share: float) -> float:
    """Return a percentile of the speeds of a pelvis over 0.1 s [the file's unit/s].

    Args:
        pelvis: Positions, shape (n, k).
        dt: Time between two of them [s].
        share: Percentile, 0 to 100.
    """
    step = max(1, round(0.1 / dt))
    moved = np.linalg.norm(pelvis[step:] - pelvis[:-step], axis=1) / (step * dt)
    return float(np.percentile(moved, share)) if len(moved) else 0.0


def _planted(pelvis: Vec, ankles: Vec, dt: float, stature: float) -> tuple[float, float]:
    """Return the factor of the root's path for a planted lower foot, and its evidence.

    The evidence is the cosine between the path of the pelvis and that of the foot relative to
    it: 1 for a planted foot, 0 if the pelvis does not move over its feet.
    """
    step = max(1, round(0.1 / dt))
    lower = ankles[:, :, 2].argmin(axis=1)[:-step]
    frames = np.arange(len(lower))
    moved = pelvis[step:] - pelvis[:-step]
    under = ankles[frames, lower] - ankles[frames + step, lower]
    size, along = float((moved**2).sum()), float((moved * under).sum())
    swung = float((under**2).sum())
    if len(lower) < 2 or size <= 0.0 or swung < len(lower) * (0.005 * stature) ** 2:
        return 0.0, 0.0
    return along / size, along / float(np.sqrt(size * swung))


def _within(value: float, span: tuple[float, float]) -> bool:
    return span[0] <= value <= span[1]


def _part(name: str) -> str:
    return name.removesuffix("_r").removesuffix("_l")
