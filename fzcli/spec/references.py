"""Fields that name another file: resolved beside the file that holds them, and read."""

from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

from fzcli.spec.load import load_robot, load_rulebase
from fzcli.spec.robot import Robot
from fzcli.spec.rulebase import Rulebase

BESIDE = "beside"  # key of the validation context: path of the file being read


def _robot(value: Any, info: ValidationInfo) -> Any:
    return load_robot(value, (info.context or {}).get(BESIDE)) if isinstance(value, str) else value


def _rulebase(value: Any, info: ValidationInfo) -> Any:
    return load_rulebase(value, (info.context or {}).get(BESIDE)) if isinstance(value, str) else value


_NAME: dict[str, Any] = {"type": "string", "description": "a name or a path"}
RobotReference = Annotated[Robot, BeforeValidator(_robot), WithJsonSchema(_NAME)]
RulebaseReference = Annotated[Rulebase, BeforeValidator(_rulebase), WithJsonSchema(_NAME)]
