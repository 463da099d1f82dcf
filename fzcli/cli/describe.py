"""Robots, rule bases and runs as lines of text."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fzcli.loop.run_spec import SimulateRun
    from fzcli.plan.planning import AnyTask
    from fzcli.spec.robot import Link, Robot
    from fzcli.spec.rulebase import Rulebase
    from fzcli.sweep.resolve import Sweep
    from fzcli.sweep.tune_spec import Tuning


def describe_robot(robot: "Robot") -> list[str]:
    """The tree of links with masses, joints, axes and limits, then tips and totals."""
    from fzcli.model import build_model

    model = build_model(robot)
    lines = [f"robot     {robot.name}"]
    lines += [f"about     {robot.about}"] if robot.about else []
    lines += [
        f"joints    {model.n} active: {', '.join(model.joint_names)}",
        f"mass      {model.mass:g} kg in all",
        "",
    ]
    state = "floating" if robot.base.floating else "fixed"
    rows: list[tuple[str, ...]] = [(robot.base.name, f"{robot.base.mass:g} kg", state, "", "")]
    rows += _branch(robot, robot.base.name, "")
    lines += aligned(rows)
    for name, tip in robot.tips.items():
        lines.append(f"tip {name} on {tip.link} at ({', '.join(f'{part:g}' for part in tip.xyz)}) m")
    return lines


def _branch(robot: "Robot", parent: str, indent: str) -> list[tuple[str, ...]]:
    """Rows of everything below a link, children in file order."""
    names = {parent, "base"} if parent == robot.base.name else {parent}
    children = [link for link in robot.links if link.parent in names]
    rows: list[tuple[str, ...]] = []
    for index, link in enumerate(children):
        last = index == len(children) - 1
        joint = link.joint
        moving = joint.type != "fixed"
        rows.append(
            (
                f"{indent}{'└─ ' if last else '├─ '}{link.name}",
                f"{link.mass:g} kg",
                joint.type,
                f"{joint.name} about ({', '.join(f'{part:.4g}' for part in joint.axis)})" if moving else "",
                _limits(link) if moving else "",
            )
        )
        rows += _branch(robot, link.name, indent + ("   " if last else "│  "))
    return rows


def _limits(link: "Link") -> str:
    joint = link.joint
    straight = joint.type == "prismatic"
    scale, unit = (1.0, "m") if straight else (180 / math.pi, "deg")
    parts = []
    if joint.position is not None:
        low, high = joint.position
        parts.append(f"{low * scale:.6g} to {high * scale:.6g} {unit}")
    if joint.speed is not None:
        parts.append(f"{joint.speed * scale:.6g} {unit}/s")
    if joint.effort is not None:
        parts.append(f"{joint.effort:.6g} {'N' if straight else 'N m'}")
    if joint.friction is not None:
        viscous, coulomb = joint.friction.viscous, joint.friction.coulomb
        units = ("N s/m", "N") if straight else ("N m s/rad", "N m")
        parts.append(f"friction {viscous:.6g} {units[0]} and {coulomb:.6g} {units[1]}")
    return ", ".join(parts) or "no limits stated"


def describe_rulebase(rulebase: "Rulebase") -> list[str]:
    """Variables with their terms, rules, what the audit finds, and the size of the surface."""
    from fzcli.fuzzy.audit import audit
    from fzcli.fuzzy.surface import build_surface

    surface = build_surface(rulebase)
    lines = [f"rule base  {rulebase.name}"]
    lines += [f"about      {rulebase.about}"] if rulebase.about else []
    lines += [f"inference  {rulebase.conjunction} / {rulebase.disjunction}, clipping, max, centroid"]
    lines += [f"surface    {surface.n_instructions()} instructions", ""]
    for role, variables in (("input", rulebase.inputs), ("output", rulebase.outputs)):
        for name, variable in variables.items():
            low, high = variable.range
            lines.append(f"{role} {name}, {low:g} to {high:g}")
            rows = [
                (f"  {label}", term.shape, " ".join(f"{number:g}" for number in term.numbers))
                for label, term in variable.terms.items()
            ]
            lines += aligned(rows)
    lines += ["", *(f"{number}. {rule.text}" for number, rule in enumerate(rulebase.rules, start=1)), ""]
    findings = audit(rulebase)
    return lines + ([f"audit: {one}" for one in findings] or ["audit: nothing to report"])


def describe_simulation(spec: "SimulateRun", variants: Sequence[str]) -> list[str]:
    """What runs: robot, law, reference, step, steps."""
    from fzcli.loop.assemble import closed_loop, parameter_row, step_counts
    from fzcli.loop.printer import instructions

    loop = closed_loop(spec, record=True)
    steps = int(step_counts(loop, spec, parameter_row(spec, loop.parameters)[None, :])[0])
    facts = {
        "kind": "simulate",
        "about": spec.about,
        "variants": ", ".join(variants),
        **_facts(spec),
        "steps": f"{steps} of {spec.step:g} s, {spec.method}",
        "loop": f"{instructions(loop.step)} instructions a step",
        "signals": ", ".join(signal.name for signal in loop.signals),
        "parameters": ", ".join(parameter.path for parameter in loop.parameters),
    }
    return _facts_lines(facts)


def describe_sweep(sweep: "Sweep") -> list[str]:
    """What is varied, drawn and filtered, and how many runs that makes."""
    trajectories = sweep.file.trajectories
    facts = {"kind": "sweep", "about": sweep.file.about, **_facts(sweep.specs[0])}
    del facts["controller"]
    facts["varied"] = "; ".join(
        f"{path}: {', '.join(map(str, dict.fromkeys(str(one.get(path)) for one in sweep.changes)))}"
        for path in dict.fromkeys(path for one in sweep.changes for path in one)
    )
    facts["drawn"] = ", ".join(f"{one.path} ({one.distribution})" for one in sweep.draws)
    facts["filter"] = " and ".join(trajectories.keep_if.that) if trajectories.keep_if else ""
    count, configurations = trajectories.count, len(sweep.specs)
    facts["runs"] = f"{configurations} configurations x {count} trajectories = {configurations * count}"
    return _facts_lines(facts)


def describe_tuning(tuning: "Tuning") -> list[str]:
    """What is tuned, on which runs, to what end."""
    section = tuning.section
    facts = {f"from {path}": f"{vary.low:g} to {vary.high:g}" for path, vary in section.vary.items()}
    facts["minimise"] = f"mean {section.minimise}" + (f", no more runs with {section.lost}" if section.lost else "")
    facts["candidates"] = f"{section.candidates} x {section.generations + 1} generations"
    return [*describe_sweep(tuning.sweep), *_facts_lines(facts)]


def describe_plan(task: "AnyTask") -> list[str]:
    """What is planned: robot, start and goals, scene, pairs that are watched."""
    from fzcli.plan.planar_task import PlanarTask

    spec, world = task.spec, task.world
    pairs = [pair for pair in world.clearance.pairs if pair.solid >= 0]
    base = "floating" if world.model.floating else "fixed"
    facts = {
        "kind": "plan",
        "about": spec.about,
        "robot": f"{spec.robot.name}, {base} base",
        "branch": task.first.branch if isinstance(task, PlanarTask) else "",
        "goals": f"{len(task.goals)} final posture{'s' if len(task.goals) > 1 else ''}",
        "scene": ", ".join(world.scene.names),
        "watched": f"{len(pairs)} pairs of solids, {1e3 * spec.margin:g} mm apart",
        "singularities": f"kept off by {task.spec.off_singular:g}" if isinstance(task, PlanarTask) else "",
        "own pairs left out": "; ".join(f"{pair}: {why}" for pair, why in world.clearance.own.left_out),
        "planner": spec.planner.kind,
    }
    return _facts_lines(facts)


def _facts(spec: "SimulateRun") -> dict[str, str]:
    base = "floating" if spec.robot.base.floating else "fixed"
    return {
        "robot": f"{spec.robot.name}, {base} base",
        "controller": spec.controller.kind,
        "reference": spec.reference.kind,
    }


def _facts_lines(facts: dict[str, str]) -> list[str]:
    return aligned([(name, value) for name, value in facts.items() if value])


def aligned(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Rows of cells as lines with straight columns."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))] if rows else []
    return [
        "  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
