"""Plan files whose robot is a planar 3-RRR to plans."""

from typing import Any

from fzcli.errors import SpecError
from fzcli.plan.plan_spec import PlanRun
from fzcli.plan.planar_spec import FOREIGN, PlanarRun, planar_misfits
from fzcli.spec.document import Document
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.parse import parse
from fzcli.spec.reader import read
from fzcli.spec.references import BESIDE


def names_planar(document: Document) -> bool:
    """Whether the robot that a plan names is a planar 3-RRR; False where there is none, or none that can be read."""
    value: Any = document.value
    robot = value.get("robot") if isinstance(value, dict) else None
    if not isinstance(robot, str) or robot.lower().endswith(".urdf"):
        return False
    try:
        found = read(find("robots", robot, document.path)).value
    except (SpecError, OSError):
        return False  # whoever reads it as a robot says what is wrong with it
    return isinstance(found, dict) and found.get("kind") == "planar_3rrr"


def planar_plan_of(document: Document) -> PlanarRun:
    """Validate a document as the plan of a planar 3-RRR. Raises SpecError with every problem found."""
    check_kind(document, "plan")
    foreign = [key for key in document.value if key in PlanRun.model_fields and key not in PlanarRun.model_fields]
    foreign += [key for key in FOREIGN if key in document.value and key not in foreign]
    if foreign:
        texts = {key: FOREIGN.get(key, "is no field of a planar_3rrr's plan") for key in foreign}
        raise SpecError([document.problem(text, (key,), at_key=True) for key, text in texts.items()])
    spec = parse(document, PlanarRun, context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in planar_misfits(spec)]
    if problems:
        raise SpecError(problems)
    return spec
