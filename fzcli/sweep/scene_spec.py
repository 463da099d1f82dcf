"""What a sweep file says of random scenes; drawing them takes the planners, reading of them does not."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from fzcli.spec.base import SpecModel
from fzcli.spec.units import Length

Extent = Annotated[Length, Field(gt=0)]
Size = tuple[Extent, Extent, Extent]


class SceneDraw(SpecModel):
    """Start and goal within the joint limits, and obstacles about the tip's way from one to the other.

    Both keep the run's margin from everything, and the straight joint path does not.
    """

    kind: Literal["on_path"] = "on_path"
    count: Annotated[tuple[int, int], Field(description="how many obstacles, at least and at most")] = (1, 3)
    radius: Annotated[tuple[Extent, Extent], Field(description="of spheres, at least and at most")]
    panel: Annotated[
        tuple[Size, Size] | None,
        Field(description="edges of panels, smallest and largest: with them, half of the obstacles are panels"),
    ] = None
    spread: Annotated[
        Length, Field(ge=0, description="standard deviation of an obstacle's middle from the tip, each axis")
    ] = 0.0
    goal: Annotated[
        Literal["joints", "pose"], Field(description="what runs are told of the goal; pose: the tip's, in the world")
    ] = "joints"
    most: Annotated[int, Field(ge=1, description="candidates tried for one scene at the most")] = 1000

    @model_validator(mode="after")
    def _in_order(self) -> "SceneDraw":
        if not 1 <= self.count[0] <= self.count[1]:
            raise ValueError(f"count needs two numbers from 1 on, in order, got {self.count[0]} and {self.count[1]}")
        for low, high in [self.radius, *zip(*(self.panel or ()), strict=True)]:
            if low > high:
                raise ValueError(f"the lower end {low:g} lies above the upper {high:g}")
        return self
