"""Modified FABRIK as an incremental controller: Dong et al. 2022, in the readings that work and the literal one."""

from collections.abc import Iterator
from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, field_validator

from fzcli.control.aim import aim_at
from fzcli.control.fabrik_sweep import Followed, Links, SweepRule, followed_points, sweep, virtual_sweep
from fzcli.control.law import InnerLoop, Law, LawInputs, Misfit
from fzcli.control.reaching import (
    ReachingSpec,
    chain_misfits,
    free_turn,
    period_caps,
    reaching_chain,
    reaching_law,
    step_bounds,
)
from fzcli.model import RobotModel
from fzcli.model.chain import build_chain
from fzcli.model.tree import build_tree
from fzcli.spec.robot import Robot
from fzcli.spec.units import Angle, Length


class FabrikSpec(ReachingSpec):
    """A period's joint increments by forward and backward reaching, within joint speeds and limits.

    literal: one sweep, every hinge turns towards the next point alone, as the paper has it; it deadlocks on most
    poses. n1 (ours): hinges also follow the last points, with a virtual tip. n10 (ours): ``sweeps`` of n1 on a
    virtual copy of the arm whose base stands still, towards whose end the arm goes as fast as it may.
    """

    kind: Literal["fabrik"] = "fabrik"
    variant: Literal["n10", "n1", "literal"] = "n10"
    sweeps: Annotated[int, Field(ge=1, le=1000, description="of n10, in a period")] = 10
    sweep_cap: Annotated[Angle, Field(gt=0, description="of n10: most that a hinge turns in a sweep")] = 0.2
    virtual_tip: Annotated[
        Length, Field(gt=0, description="length given to the last link for its direction; not in literal")
    ] = 0.2
    follow: Annotated[
        tuple[tuple[int, ...], ...] | None,
        Field(description="points that each hinge turns towards (K_i of hinges 1, 2, ...), instead of the variant's"),
    ] = None
    clamp: Annotated[bool, Field(description="keep to the joints' speed limits; false only to study the law")] = True

    @field_validator("follow")
    @classmethod
    def _points_beyond(cls, follow: tuple[tuple[int, ...], ...] | None) -> tuple[tuple[int, ...], ...] | None:
        for i, points in enumerate(follow or (), start=1):
            if not points or min(points) <= i:
                raise ValueError(f"hinge {i} can turn towards points {i + 1} and beyond, got {list(points)}")
        return follow


def build(model: RobotModel, spec: FabrikSpec) -> Law:
    """Section 3 of Dong 2022. Raises SpecError for an arm without chain points."""
    chain = reaching_chain(model, spec)
    inputs = LawInputs.symbols(model.n)
    aim = aim_at(model, inputs, spec.tip)
    low, high = step_bounds(model, inputs.q, period_caps(model, inputs.period, spec.clamp))
    literal = spec.variant == "literal"
    rule = SweepRule(
        chain,
        spec.directed,
        _followed(spec) or followed_points(literal, chain.hinges, spec.directed),
        0.0 if literal else spec.virtual_tip,
        chain.square and not literal,
    )
    points, axes = model.function("chain", spec.tip)(inputs.q)
    arm = Links.of(points, axes)
    hinges = chain.joints
    inner: tuple[InnerLoop, ca.SX] | None = None
    if spec.variant == "n10":
        angles = ca.vertcat(*(inputs.q[j] for j in hinges))
        starting = [ca.vertcat(angles, arm.vector), ca.vertcat(aim.target, aim.direction)]
        before = ca.Function("law_before", list(inputs.as_dict().values()), ca.cse(starting))
        turn = virtual_sweep(rule, model.tree.position_limits[list(hinges)], spec.sweep_cap)
        turned = ca.SX.sym("turned", turn.size1_in(0))
        inner = (InnerLoop(before, turn, spec.sweeps), turned)
        wanted = [turned[i] - inputs.q[j] for i, j in enumerate(hinges)]
    else:
        bounds = ([low[j] for j in hinges], [high[j] for j in hinges])
        wanted, _ = sweep(rule, arm, aim.target, aim.direction, bounds, held=not model.floating)
    way = ca.SX.zeros(model.n)
    for i, j in enumerate(hinges):
        way[j] = wanted[i]
    if spec.task == "pose":
        way[chain.free] = free_turn(model, chain, inputs.q, aim)
    for j in range(model.n):
        way[j] = ca.fmin(high[j], ca.fmax(low[j], way[j]))
    return reaching_law(model, spec, inputs, aim, way / inputs.period, inner)


def misfits(robot: Robot, spec: FabrikSpec) -> Iterator[Misfit]:
    """Where the law does not suit the robot."""
    found = list(chain_misfits(robot, spec))
    yield from found
    if not found and spec.follow is not None:
        m = build_chain(build_tree(robot), spec.tip or next(iter(robot.tips))).hinges
        if len(spec.follow) != m or any(k > m + 1 for points in spec.follow for k in points):
            yield ("controller", "follow"), f"wants a list for each of the {m} hinges, of points up to {m + 1}, the tip"


def _followed(spec: FabrikSpec) -> Followed:
    """The sets K_i that the spec gives, as rows of the points; empty where it gives none."""
    return tuple(tuple(sorted({k - 1 for k in points})) for points in spec.follow or ())
