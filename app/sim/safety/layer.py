"""Speed and separation monitoring, and power and force limiting, over any policy or planner.

A :class:`SafetyLayer` is asked once per control period: robot's state, commanded piece, people
as last seen. It answers with an override and the motion to execute, and says what set it. The
rule and the proof that it holds are in ``safety/kernels/ssm.py``; the contact speeds of power
and
force limiting in ``contact_limits.py``. Not a certified safety function.

The layer keeps position, speed and acceleration limits; where it slows, it does not keep a jerk
limit. From a measured state outside its limits, or one whose straight stop leaves them, it
admits what leaves them no farther than that stop (``measured_state.py``). It watches people
only: that a stop meets table or robot is the policy's affair, and a straight stop leaves a
curved path. State and motion are those commanded; what a drive does on top of that belongs into
the uncertainty ``Z_r`` and the reaction time.

Source: METHOD 2.7; ISO/TS 15066:2016.
"""

from dataclasses import dataclass, fields

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec
from app.sim.geometry.capsules import distances, least
from app.sim.geometry.cylinder import cylinder_clearance, swept_clearance
from app.sim.human.kernels import kinematics as body
from app.sim.robot.kernels import override
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.measured_state import admitting
from app.sim.robot.ur10 import LINK_NAMES
from app.sim.safety import contact_limits
from app.sim.safety.kernels import separation_check as watch_kernel
from app.sim.safety.kernels import ssm
from app.sim.scene.scene import own, require_finite

UNITS = {
    "human_speed": "m/s",
    "measured": "",
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
    """What the safety layer assumes; every result prints it.

    Raises:
        InvalidInput: A number is negative, infinite or NaN.
    """

    human_speed: float = 1.6
    """Greatest speed of any point of a person, v_h [m/s]."""
    measured: bool = False
    """Whether a cylinder whose velocity is known is taken to go on at it, instead of at v_h."""
    speed_change: float = 0.1
    """How much faster such a person may be than was seen, in any direction [m/s]."""
    reaction_time: float = 0.1
    """From a decision to its effect [s]; a part of T_r."""
    tracker_delay: float = 0.0
    """Age of what the tracker says when it says it [s]; a part of T_r."""
    intrusion_distance: float = 0.0
    """Intrusion distance, C [m]."""
    person_uncertainty: float = 0.0
    """Uncertainty of a person's position, Z_d [m]."""
    robot_uncertainty: float = 0.0
    """Uncertainty of the robot's position, Z_r [m]."""
    protective_distance: float = 0.3
    """Least distance to anyone while the robot moves, on top of the rule [m]."""
    pfl: bool = False
    """Whether people may be touched, as slowly as their parts allow."""
    load: float = 0.0
    """What the robot carries, m_L [kg]; read by power and force limiting."""
    moving_mass: float = contact_limits.UR10_MOVING_MASS
    """Mass of the robot's moving parts, M [kg]; read by power and force limiting."""
    contact_area: float = 1.0
    """Area of a contact [cm^2]; read by power and force limiting."""

    def __post_init__(self) -> None:
        for name in UNITS:
            value = getattr(self, name)
            if not 0.0 <= value < 1e6:
                raise InvalidInput(name, value, "must be finite and not negative")
        if self.moving_mass <= 0.0 or self.contact_area <= 0.0:
            value = [self.moving_mass, self.contact_area]
            raise InvalidInput("moving_mass, contact_area", value, "must be above 0")

    @property
    def other_speed(self) -> float:
        """Speed in any direction, of a cylinder beyond what is seen where that counts [m/s]."""
        return self.speed_change if self.measured else self.human_speed

    @property
    def lead(self) -> float:
        """How much older than the robot's state people are at least [s]."""
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
        """Return every assumption by name and unit, as results print it."""
        return {
            f"{field.name} [{UNITS[field.name]}]" if UNITS[field.name] else field.name: getattr(
                self, field.name
            )
            for field in fields(self)
        }


def safety_settings(cell: Cell) -> SafetySettings:
    """Return what a cell says about safety."""
    return SafetySettings(**cell.safety.model_dump())


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyDecision:
    """What is executed in one period, and why.

    The motion is ``q(s) = q + qd s + c s^2 + d s^3`` at ``s(t) = t - drop t^2/2``, up to rest.
    """

    override: float
    """Rate at the end of the period, of the commanded 1; 0: the straight stop."""
    c: Vec
    """Second coefficients of the path [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients of the path [rad/s^3], shape (6,)."""
    drop: float
    """What the rate loses per second [1/s]."""
    q: Vec
    """Joint positions after the period [rad], shape (6,)."""
    qd: Vec
    """Joint speeds after the period [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at its end [rad/s^2], shape (6,)."""
    person: int | None
    """Who set it: workers first, then cylinders; None where nobody did."""
    part: int | None
    """Which of the worker's capsules; None for a cylinder."""
    link: str | None
    """The link nearest to that part now."""
    separation: float | None
    """Their distance as seen [m]."""
    required: float | None
    """S_p of the standard for that link at its speed now [m]."""
    lacking: float
    """By how much people could have come too near on the path that was refused [m]."""
    stop_time: float
    """How long a stop takes from now, T_s [s]."""
    stop_distance: float
    """Bound on how far any point of the robot goes in it, B [m]."""

    def at(self, q: Vec, qd: Vec, t: float) -> tuple[Vec, Vec]:
        """Return joints [rad] and speeds [rad/s], shape (6,), ``t`` seconds into the period.

        Args:
            q: Joint positions at its start [rad], shape (6,).
            qd: Joint speeds at its start [rad/s], shape (6,).
            t: Time since its start [s].
        """
        there, speeds = np.empty(6), np.empty(6)
        override.motion_at(own(q), own(qd), self.c, self.d, self.drop, t, there, speeds)
        return there, speeds


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationTerms:
    """S_p of the standard for one person and one link, term by term (METHOD 2.7).

    ``S_p = v_h (T_r + T_s) + v_r T_r + B + C + Z_d + Z_r`` and the protective distance.
    """

    link: str
    """The link."""
    separation: float
    """Distance as seen [m]."""
    human_speed: float
    """v_h [m/s]."""
    robot_speed: float
    """v_r, the link as fast as its joints could make it [m/s]."""
    reaction_time: float
    """T_r, with the control period, the tracker's delay and the data's age [s]."""
    stop_time: float
    """T_s [s]."""
    braking: float
    """B, the way of the link in the stop [m]."""
    intrusion: float
    """C [m]."""
    person_uncertainty: float
    """Z_d [m]."""
    robot_uncertainty: float
    """Z_r [m]."""
    protective_distance: float
    """Least distance to anyone, on top [m]."""

    @property
    def required(self) -> float:
        """S_p and the protective distance [m]."""
        way = self.human_speed * (self.reaction_time + self.stop_time)
        way += self.robot_speed * self.reaction_time + self.braking + self.intrusion
        uncertain = self.person_uncertainty + self.robot_uncertainty
        return way + uncertain + self.protective_distance


def powers_of_time(q: Vec, qd: Vec, c: Vec, d: Vec, drop: float) -> Vec:
    """Return a scaled motion as polynomials in time, ascending, shape (6, 7).

    ``q + qd s + c s^2 + d s^3`` at ``s = t - drop t^2/2``, written out in powers of ``t``: the
    seven coefficients of each joint, from ``t^0`` to ``t^6``. They hold until the motion rests
    at ``t = 1/drop``.

    Args:
        q: Joint positions at the start [rad], shape (6,).
        qd: Joint speeds at the start [rad/s], shape (6,).
        c: Second coefficients of the path [rad/s^2], shape (6,).
        d: Third coefficients of the path [rad/s^3], shape (6,).
        drop: What the rate loses per second [1/s].
    """
    k = drop
    return np.stack(
        [
            q,
            qd,
            c - 0.5 * k * qd,
            d - k * c,
            0.25 * k**2 * c - 1.5 * k * d,
            0.75 * k**2 * d,
            -0.125 * k**3 * d,
        ],
        axis=1,
    )


def contact_speeds(settings: SafetySettings, n_columns: int, n_cylinders: int) -> Vec:
    """Return the speed at which each part of the people may be touched [m/s].

    Args:
        settings: Assumptions; without power and force limiting nothing may be touched.
        n_columns: Capsules; every twelve are a worker, the rest fills up.
        n_cylinders: Cylinders.

    Returns:
        Capsules first, then cylinders, shape (n_columns + n_cylinders,).
    """
    out = np.zeros(n_columns + n_cylinders)
    if settings.pfl:
        one = contact_limits.capsule_speeds(settings.robot_mass, settings.contact_area)
        out[:n_columns] = np.resize(one, n_columns)
        out[n_columns:] = contact_limits.cylinder_speed(
            settings.robot_mass, settings.contact_area
        )
    return out


def separation_rule(
    settings: SafetySettings, n_columns: int, n_cylinders: int, known: bool
) -> watch_kernel.Safety:
    """Return the settings as the kernels read them.

    Args:
        settings: Assumptions.
        n_columns: Capsules; see :func:`contact_speeds`.
        n_cylinders: Cylinders.
        known: Whether the kernels are told how cylinders go on.
    """
    speed = np.full(n_columns + n_cylinders, settings.human_speed)
    if known:
        speed[n_columns:] = settings.speed_change
    return watch_kernel.Safety(
        speed=speed,
        lead=settings.lead,
        margin=settings.margin,
        contact_speed=contact_speeds(settings, n_columns, n_cylinders),
    )


class SafetyLayer:
    """Scales the motion of one robot; not thread-safe.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        settings: Assumptions.
    """

    def __init__(self, arm: Arm, settings: SafetySettings) -> None:
        self.arm, self.settings = arm, settings
        self._shape = (-1, -1)
        self._known = False

    def decide(
        self, q: Vec, qd: Vec, c: Vec, d: Vec, people: Shapes, age: float = 0.0
    ) -> SafetyDecision:
        """Decide how the piece of one period is executed.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
            c: Commanded second coefficients [rad/s^2], shape (6,).
            d: Commanded third coefficients [rad/s^3], shape (6,).
            people: As last seen; every twelve capsules are a worker.
            age: How old they are beyond the tracker's delay [s].

        Raises:
            SimulationError: A number is NaN or infinite.
            InvalidInput: The age is negative.
        """
        require_finite("q, qd, c, d", np.concatenate([q, qd, c, d]))
        require_finite("people", np.concatenate([people.columns[:3].ravel(), [age]]))
        require_finite("people", people.cylinders.ravel())
        if age < 0.0:
            raise InvalidInput("age", age, "must not be negative")
        q, qd = own(q), own(qd)
        self._take_in(people)
        chosen = ssm.decide(
            admitting(self.arm, q, qd), self._rule, age, own(people.columns),
            own(people.cylinders), q, qd, own(c), own(d), self._watch,
        )  # fmt: skip
        return self._told(chosen, q, qd, people, age)

    def _take_in(self, people: Shapes) -> None:
        """Make work space for so many people, and note how cylinders go on."""
        shape = (people.columns.shape[1], len(people.cylinders))
        going = people.going if self.settings.measured else None
        known = going is not None
        if (shape, known) != (self._shape, self._known):
            self._shape, self._known = shape, known
            self._watch = watch_kernel.new_ssm_workspace(self.arm, *shape)
            self._rule = separation_rule(self.settings, *shape, known)
        if going is not None:
            unknown = np.asarray(np.isnan(going).any(axis=1))
            seen = np.where(unknown[:, None], 0.0, going)
            require_finite("people", seen)
            self._watch.going[:] = seen
            fastest = np.hypot(seen[:, 0], seen[:, 1]) + np.abs(seen[:, 2])
            self._watch.going_speed[shape[0] :] = fastest
            settings = self.settings
            change = np.where(unknown, settings.human_speed, settings.speed_change)
            self._rule.speed[shape[0] :] = change

    def _told(
        self, chosen: float, q: Vec, qd: Vec, people: Shapes, age: float
    ) -> SafetyDecision:
        """Return the decision the work space holds, with what set it."""
        watch, arm = self._watch, self.arm
        t_stop = override.stop_time(qd, arm.limits.qdd_max)
        person = part = link = separation = required = None
        column = int(watch.why[watch_kernel.WHO])
        if chosen < 1.0 and column >= 0:
            terms = self._terms_of(column, qd, people, t_stop, age)
            link, separation, required = terms.link, terms.separation, terms.required
            person, part = self._numbered(column)
        return SafetyDecision(
            override=float(chosen),
            c=watch.c.copy(),
            d=watch.d.copy(),
            drop=float(watch.drop[0]),
            q=watch.q.copy(),
            qd=watch.qd.copy(),
            qdd=watch.qdd.copy(),
            person=person,
            part=part,
            link=link,
            separation=separation,
            required=required,
            lacking=max(0.0, float(watch.why[watch_kernel.SLACK])) if chosen < 1.0 else 0.0,
            stop_time=t_stop,
            stop_distance=float(0.5 * t_stop * (np.abs(qd) @ arm.lever)),
        )

    def terms(
        self, decision: SafetyDecision, qd: Vec, people: Shapes, age: float = 0.0
    ) -> tuple[int, SeparationTerms] | None:
        """Return whom S_p is told for, and its terms, right after :meth:`decide`.

        It is told for who set the override, or for the nearest where nobody did; None where
        nobody is there.

        Args:
            decision: What was decided last.
            qd: Joint speeds then [rad/s], shape (6,).
            people: As seen then.
            age: How old they were beyond the tracker's delay [s].
        """
        gap = self._watch.gap[watch_kernel.NOW]
        if not gap.size:
            return None
        column = int(self._watch.why[watch_kernel.WHO])
        if decision.person is None:
            column = int(np.argmin(gap))
        terms = self._terms_of(column, qd, people, decision.stop_time, age)
        return self._numbered(column)[0], terms

    def _numbered(self, column: int) -> tuple[int, int | None]:
        """Return a column's person, workers first, and the part; no part for a cylinder."""
        n_columns = self._shape[0]
        if column >= n_columns:
            return n_columns // body.N_CAPSULES + column - n_columns, None
        return column // body.N_CAPSULES, column % body.N_CAPSULES

    def _terms_of(
        self, column: int, qd: Vec, people: Shapes, t_stop: float, age: float
    ) -> SeparationTerms:
        """Return S_p of the link nearest to a part of the people."""
        arm, settings = self.arm, self.settings
        separation, nearest = self._nearest(column, people)
        joints = slice(0, int(arm.link[nearest]))
        v_r = float(np.abs(qd[joints]) @ arm.lever[joints])
        t_r = arm.dt + settings.lead + age
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
        """Return how near a part of the people is as seen [m], and which capsule to."""
        robot, out = self._watch.columns[watch_kernel.NOW], np.empty(self.arm.columns.shape[1])
        if column < people.columns.shape[1]:
            distances(own(people.columns), column, robot, out)
            return float(self._watch.gap[watch_kernel.NOW, column]), int(least(out)[1])
        x, y, r, top = people.cylinders[column - people.columns.shape[1]]
        separation, nearest = cylinder_clearance(robot, 0, x, y, r, top)
        return float(separation), int(nearest)

    def _human_speed(
        self, column: int, people: Shapes, separation: float, seconds: float
    ) -> float:
        """Return v_h of a part of the people: assumed, or toward the robot as seen [m/s].

        Args:
            column: The part.
            people: As seen.
            separation: Its distance to the robot [m].
            seconds: Time in which it is looked at how much nearer it comes [s].
        """
        k = column - self._shape[0]
        if k < 0 or not self._known or people.going is None or np.isnan(people.going[k]).any():
            return self.settings.human_speed
        robot, (x, y, r, _) = self._watch.columns[watch_kernel.NOW], people.cylinders[k]
        vx, vy, growth = people.going[k]
        grown = r + max(0.0, growth) * seconds
        there = swept_clearance(robot, x, y, vx * seconds, vy * seconds, grown)
        return max(0.0, separation - float(there)) / seconds + self.settings.speed_change
