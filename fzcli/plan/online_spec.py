"""How a plan is followed when something is seen on the way."""

from typing import Annotated, Literal

from pydantic import Field

from fzcli.spec.base import SpecModel

AnswerPolicy = Literal["detour", "stop", "none"]


class ExecutionSpec(SpecModel):
    """What `fzcli simulate` does when an obstacle is seen on the way, or seen to move, and the path meets it."""

    answer: Annotated[
        AnswerPolicy,
        Field(description="a smooth detour, else a smooth stop; the stop at once; or nothing, to see what comes of it"),
    ] = "detour"
    evaluations: Annotated[
        int,
        Field(ge=1, description="of the clearance along a window that a search for a detour may take; past them: stop"),
    ] = 200
