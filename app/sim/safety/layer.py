"""Speed and separation monitoring, and power and force limiting, for any policy or planner.

A :class:`SafetyLayer` decides once per control period from the robot's state, the commanded
trajectory and the people as last observed. It returns an override, the motion to execute and
the cause. The rule and the proof that it holds are in ``safety/kernels/ssm.py``; the contact
speeds of power and force limiting in ``contact_limits.py``. Not a certified safety function.

The layer keeps position, speed and acceleration limits; scaled motions may exceed jerk limits.
From a measured state outside its limits, or one whose straight stop leaves them, it admits
motions that leave them no farther than that stop (``measured_state.py``). It monitors people
only: a stop leaves a curved path straight on, and keeping it clear of table and robot is the
task of the policy. State and motion are the commanded ones; deviations of the drives belong to
the uncertainty ``Z_r`` and the reaction time.

Source: docs/method.md 2.7; ISO/TS 15066:2016.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes, greatest_speeds
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import direct
from app.sim.geometry.capsules import distances, least
from app.sim.geometry.cylinder import cylinder_clearance, swept_clearance
from app.sim.human.kernels import kinematics as body
from app.sim.robot.kernels import override
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.measured_state import admitting
from app.sim.robot.ur10 import LINK_NAMES
from app.sim.safety import contact_limits
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.kernels import separation_check, ssm
from app.sim.safety.kernels.separation_check import PeopleShapes
from app.sim.scene.scene import require_finite

UNITS = {
    "human_speed": "m/s",
    "use_measured_velocity": "",
    "speed_change": "m/s",
    "reaction_time": "s",
    "tracker_delay": "s",
    "intrusion_distance": "m",
    "person_uncertainty": "m",
    "robot_uncertainty": "m",
    "protective_distance": "m",
    "pfl": "",
    "load": "kg",
    "moving_mass": "kg",
    "contact_area": "cm^2",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetySettings:
    """Assumptions of the safety layer; every result states them.

    Raises:
        InvalidInput: A number is negative, infinite or NaN.
    """

    human_speed: float = 1.6
    """Speed of any point of a person, v_h, unless it is observed faster [m/s]."""
    use_measured_velocity: bool = False
    """Whether a cylinder of known velocity is extrapolated with it, instead of with v_h."""
    speed_change: float = 0.1
    """Assumed excess over that velocity, in any direction [m/s]."""
    reaction_time: float = 0.1
    """Time from a decision to its effect [s]; a part of T_r."""
    tracker_delay: float = 0.0
    """Age of the tracker's data on arrival [s]; a part of T_r."""
    intrusion_distance: float = 0.0
    """Intrusion distance, C [m]."""
    person_uncertainty: float = 0.0
    """Uncertainty of a person's position, Z_d [m]."""
    robot_uncertainty: float = 0.0
    """Uncertainty of the robot's position, Z_r [m]."""
    protective_distance: float = 0.3
    """Least distance to people while the robot moves, added to the rule [m]."""
    pfl: bool = False
    """Whether power and force limiting permits contacts at admissible speeds."""
    load: float = 0.0
    """Payload of the robot, m_L [kg]; read by power and force limiting."""
    moving_mass: float = contact_limits.UR10_MOVING_MASS
    """Mass of the robot's moving parts, M [kg]; read by power and force limiting."""
    contact_area: float = 1.0
    """Area of a contact [cm^2]; read by power and force limiting."""

    def __post_init__(self) -> None:
        for name in UNITS:
            value = getattr(self, name)
            if not 0.0 <= value < 1e6:
                raise InvalidInput(name, value, "must lie in [0, 1e6)")
        if self.moving_mass <= 0.0 or self.contact_area <= 0.0:
            value = [self.moving_mass, self.contact_area]
            raise InvalidInput("moving_mass, contact_area", value, "must be above 0")

    @property
    def other_speed(self) -> float:
        """Assumed speed in any direction; of a cylinder beyond its velocity, if used [m/s]."""
        return self.speed_change if self.use_measured_velocity else self.human_speed

    @property
    def latency(self) -> float:
        """Least age of people relative to the robot's state [s]."""
        return self.reaction_time + self.tracker_delay

    @property
    def margin(self) -> float:
        """Distance to keep, C + Z_d + Z_r and the protective distance [m]."""
        uncertain = self.person_uncertainty + self.robot_uncertainty
        return self.intrusion_distance + uncertain + self.protective_distance

    @property
    def robot_mass(self) -> float:
        """Effective mass of the robot, M/2 + m_L [kg]."""
        return 0.5 * self.moving_mass + self.load

    def describe(self) -> dict[str, float | bool]:
        """Return every assumption by name and unit, as stated in results."""
        return {
            f"{name} [{unit}]" if unit else name: getattr(self, name)
            for name, unit in UNITS.items()
        }


def safety_settings(cell: Cell) -> SafetySettings:
    """Return the safety settings of a cell."""
    return SafetySettings(**cell.safety.model_dump())


def contact_speeds(settings: SafetySettings, n_capsules: int, n_cylinders: int) -> Vec:
    """Return the admissible contact speed of each part of the people [m/s].

    Args:
        settings: Assumptions; without power and force limiting nothing may be touched.
        n_capsules: Number of capsules: twelve per worker; further ones are unused.

    Returns:
        Capsules first, then cylinders, shape (n_capsules + n_cylinders,).
    """
    out = np.zeros(n_capsules + n_cylinders)
    if settings.pfl:
        one = contact_limits.capsule_contact_speeds(settings.robot_mass, settings.contact_area)
        out[:n_capsules] = np.resize(one, n_capsules)
        out[n_capsules:] = contact_limits.cylinder_contact_speed(
            settings.robot_mass, settings.contact_area
        )
    return out


def separation_rule(
    settings: SafetySettings, n_capsules: int, n_cylinders: int, known: bool
) -> separation_check.SeparationRule:
    """Return the settings for the kernels.

    Args:
        n_capsules: Number of capsules; see :func:`contact_speeds`.
        known: Whether the velocities of cylinders are known.
    """
    speed = np.full(n_capsules + n_cylinders, settings.human_speed)
    if known:
        speed[n_capsules:] = settings.speed_change
    return separation_check.SeparationRule(
        speed=speed,
        latency=settings.latency,
        margin=settings.margin,
        contact_speed=contact_speeds(settings, n_capsules, n_cylinders),
    )


class SafetyLayer:
    """Safety layer of one robot; not thread-safe.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
    """

    def __init__(self, arm: Arm, settings: SafetySettings) -> None:
        self.arm, self.settings = arm, settings
        self._shape = (-1, -1)
        self._known = False
        self._call: Callable[..., float] | None = None

    def decide(
        self, q: Vec, qd: Vec, c: Vec, d: Vec, people: Shapes, age: float = 0.0
    ) -> SafetyDecision:
        """Decide how the trajectory of one period is executed.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
            c: Commanded second coefficients [rad/s^2], shape (6,).
            d: Commanded third coefficients [rad/s^3], shape (6,).
            people: People as last observed; every twelve capsules are a worker.
            age: Their age beyond the tracker's delay [s].

        Raises:
            SimulationError: A number is NaN or infinite.
            InvalidInput: The age is negative.
        """
        require_finite("q, qd, c, d", np.concatenate([q, qd, c, d]))
        require_finite("people", np.append(people.capsules.ravel(), age))
        require_finite("people", people.cylinders.ravel())
        if age < 0.0:
            raise InvalidInput("age", age, "must not be negative")
        path = JointPath(
            as_kernel_array(q), as_kernel_array(qd), as_kernel_array(c), as_kernel_array(d)
        )
        self._load_people(people)
        shapes = PeopleShapes(
            as_kernel_array(people.capsules), as_kernel_array(people.cylinders)
        )
        arm = admitting(self.arm, path.q, path.qd)
        arguments = (arm, self._rule, float(age), shapes, path, self._space)
        if self._call is None:
            self._call = direct(ssm.decide, arguments)
        chosen = self._call(*arguments)
        return self._decision(chosen, path.qd, people, age)

    def _load_people(self, people: Shapes) -> None:
        """Allocate work space for the people and load the velocities of cylinders."""
        shape = (people.capsules.shape[1], len(people.cylinders))
        going = people.going if self.settings.use_measured_velocity else None
        known = going is not None
        if (shape, known) != (self._shape, self._known):
            self._shape, self._known, self._call = shape, known, None
            self._space = separation_check.new_ssm_workspace(self.arm, *shape)
            self._rule = separation_rule(self.settings, *shape, known)
        self._load_speeds(people, known)
        if going is not None:
            unknown = np.asarray(np.isnan(going).any(axis=1))
            seen = np.where(unknown[:, None], 0.0, going)
            require_finite("people", seen)
            self._space.velocity[:] = seen
            self._space.known_speed[shape[0] :] = greatest_speeds(seen)
            settings = self.settings
            change = np.where(unknown, settings.human_speed, settings.speed_change)
            self._rule.speed[shape[0] :] = change

    def _load_speeds(self, people: Shapes, known: bool) -> None:
        """Load the observed speed of each part, 0 where unknown or extrapolated.

        Args:
            known: Whether cylinders of known velocity are extrapolated with it.
        """
        m, observed = self._shape[0], self._space.observed_speed
        if m:
            observed[:m] = 0.0 if people.speed is None else people.speed
            require_finite("people", observed[:m])
        going, speed = people.going, people.cylinder_speed
        if speed is None:
            speed = np.zeros(1) if going is None else greatest_speeds(going)
        np.fmax(speed, 0.0, out=observed[m:])  # NaN: unknown
        require_finite("people", observed[m:])
        if known and going is not None:
            observed[m:][~np.isnan(going).any(axis=1)] = 0.0

    def _decision(self, chosen: float, qd: Vec, people: Shapes, age: float) -> SafetyDecision:
        """Return the decision in the work space, with its cause."""
        space, arm = self._space, self.arm
        t_stop = override.stop_time(qd, arm.limits.qdd_max)
        person = part = link = separation = required = None
        column = int(space.cause[separation_check.CAUSE_PART])
        if chosen < 1.0 and column >= 0:
            terms = self._terms_of(column, qd, people, t_stop, age)
            link, separation, required = terms.link, terms.separation, terms.required
            person, part = self._person_of(column)
        return SafetyDecision(
            override=float(chosen),
            c=space.c.copy(),
            d=space.d.copy(),
            path_deceleration=float(space.deceleration[0]),
            q=space.end.q.copy(),
            qd=space.end.qd.copy(),
            qdd=space.end.qdd.copy(),
            person=person,
            part=part,
            link=link,
            separation=separation,
            required=required,
            lacking=max(0.0, float(space.cause[separation_check.CAUSE_SHORTFALL]))
            if chosen < 1.0
            else 0.0,
            stop_time=t_stop,
            stop_distance=float(0.5 * t_stop * (np.abs(qd) @ arm.lever)),
        )

    def terms(
        self, decision: SafetyDecision, qd: Vec, people: Shapes, age: float = 0.0
    ) -> tuple[int, SeparationTerms] | None:
        """Return the person to which S_p refers, and its terms, right after :meth:`decide`.

        The person is the cause of the override, else the one with the least reserve; the terms
        are those of that person's part with the least reserve: its distance minus what it may
        move until the robot rests. None without people.

        Args:
            decision: Last decision.
            qd: Joint speeds of that decision [rad/s], shape (6,).
            people: People of that decision.
            age: Their age beyond the tracker's delay [s].
        """
        if not self._space.clearance.size:
            return None
        column = int(self._space.cause[separation_check.CAUSE_PART])
        time = self.arm.dt + self.settings.latency + age + decision.stop_time
        reserve = self._reserves(people, time)
        if decision.person is None:
            column = int(np.argmin(reserve))
        elif column < self._shape[0]:
            first = column - column % body.N_CAPSULES
            column = first + int(np.argmin(reserve[first : first + body.N_CAPSULES]))
        terms = self._terms_of(column, qd, people, decision.stop_time, age)
        return self._person_of(column)[0], terms

    def _reserves(self, people: Shapes, seconds: float) -> Vec:
        """Return the distance of each part less what it may move in a time [m], (m + n,)."""
        space = self._space
        speed = np.maximum(self._rule.speed, space.observed_speed)
        reserve: Vec = space.clearance[separation_check.NOW] - speed * seconds
        for column in range(self._shape[0], len(reserve)):  # perhaps of known velocity
            separation, _ = self._nearest(column, people)
            v_h = self._human_speed(column, people, separation, seconds)
            reserve[column] = separation - v_h * seconds
        return reserve

    def _person_of(self, column: int) -> tuple[int, int | None]:
        """Return the person of a column, workers first, and its part; None for a cylinder."""
        n_capsules = self._shape[0]
        if column >= n_capsules:
            return n_capsules // body.N_CAPSULES + column - n_capsules, None
        return column // body.N_CAPSULES, column % body.N_CAPSULES

    def _terms_of(
        self, column: int, qd: Vec, people: Shapes, t_stop: float, age: float
    ) -> SeparationTerms:
        """Return S_p of the link nearest to a part of the people."""
        arm, settings = self.arm, self.settings
        separation, nearest = self._nearest(column, people)
        joints = slice(0, int(arm.link[nearest]))
        v_r = float(np.abs(qd[joints]) @ arm.lever[joints])
        t_r = arm.dt + settings.latency + age
        return SeparationTerms(
            link=LINK_NAMES[arm.link[nearest]],
            separation=separation,
            human_speed=self._human_speed(column, people, separation, t_r + t_stop),
            robot_speed=v_r,
            reaction_time=t_r,
            stop_time=t_stop,
            braking=0.5 * v_r * t_stop,
            intrusion=settings.intrusion_distance,
            person_uncertainty=settings.person_uncertainty,
            robot_uncertainty=settings.robot_uncertainty,
            protective_distance=settings.protective_distance,
        )

    def _nearest(self, column: int, people: Shapes) -> tuple[float, int]:
        """Return the observed distance of a part of the people [m], and the nearest capsule."""
        robot, out = (
            self._space.capsules[separation_check.NOW],
            np.empty(self.arm.capsules.shape[1]),
        )
        if column < people.capsules.shape[1]:
            distances(as_kernel_array(people.capsules), column, robot, out)
            clearance = self._space.clearance[separation_check.NOW, column]
            return float(clearance), int(least(out)[1])
        x, y, r, top = people.cylinders[column - people.capsules.shape[1]]
        separation, nearest = cylinder_clearance(robot, 0, x, y, r, top)
        return float(separation), int(nearest)

    def _human_speed(
        self, column: int, people: Shapes, separation: float, seconds: float
    ) -> float:
        """Return v_h of a part of the people: assumed, or as observed [m/s].

        Args:
            column: Part of the people.
            separation: Distance of the part to the robot [m].
            seconds: Time over which the speed of approach is averaged [s].
        """
        k = column - self._shape[0]
        if k < 0 or not self._known or people.going is None or np.isnan(people.going[k]).any():
            observed = float(self._space.observed_speed[column])
            return max(self.settings.human_speed, observed)
        robot, (x, y, r, _) = self._space.capsules[separation_check.NOW], people.cylinders[k]
        vx, vy, growth = people.going[k]
        grown = r + max(0.0, growth) * seconds
        there = swept_clearance(robot, x, y, vx * seconds, vy * seconds, grown)
        return max(0.0, separation - float(there)) / seconds + self.settings.speed_change
