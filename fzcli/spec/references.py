"""Fields that name another file: the name is resolved beside the file that holds it, and read."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

from fzcli.spec.robot import Robot
from fzcli.spec.rulebase import Rulebase

BESIDE = "beside"  # key of the validation context: folder of the file being read


def _beside(info: ValidationInfo) -> Path | None:
    folder = (info.context or {}).get(BESIDE)
    return Path(folder) if folder else None


def _robot(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, Robot):
        return value
    from fzcli.spec.load import load_robot

    return load_robot(_name(value, "robot"), beside=_beside(info))


def _rulebase(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, Rulebase):
        return value
    from fzcli.spec.load import load_rulebase

    return load_rulebase(_name(value, "rule base"), beside=_beside(info))


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"must be the name of a {what} or a path to one")
    return value


_TEXT = WithJsonSchema({"type": "string"})
RobotReference = Annotated[Robot, BeforeValidator(_robot), _TEXT]
RulebaseReference = Annotated[Rulebase, BeforeValidator(_rulebase), _TEXT]
