"""What a run of ``kind: train`` says: which map of which robot, how many samples, what network, how trained."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, WithJsonSchema, model_validator

from fzcli.learn.network import Activation
from fzcli.learn.trainers import TrainerSpec
from fzcli.model.planar_3rrr import MODES
from fzcli.spec.any_robot import AnyRobot, load_any_robot
from fzcli.spec.base import SpecModel
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.references import BESIDE
from fzcli.spec.tool import Tool, with_tool
from fzcli.spec.units import Angle, JointValue, Length

Mode = Literal["+++", "++-", "+-+", "+--", "-++", "-+-", "--+", "---"]


def _robot(value: Any, info: ValidationInfo) -> Any:
    return load_any_robot(value, (info.context or {}).get(BESIDE)) if isinstance(value, str) else value


AnyRobotReference = Annotated[
    AnyRobot, BeforeValidator(_robot), WithJsonSchema({"type": "string", "description": "a name or a path"})
]


class PlanarForwardSpec(SpecModel):
    """Joint angles of a planar 3-RRR -> pose of its platform, over poses within a region."""

    kind: Literal["planar_forward"]
    radius: Annotated[Length, Field(gt=0, description="the platform's centre, from the origin, at the most")]
    turn: Annotated[Angle, Field(gt=0, description="the platform's angle, either way, at the most")]
    modes: Annotated[tuple[Mode, ...], Field(min_length=1, description="working modes")] = MODES  # type: ignore[assignment]
    split: Annotated[
        bool, Field(description="a network for each sign of det A; else most modes have two poses for one input")
    ] = True
    off_singular: Annotated[
        float, Field(ge=0, description="least |det A| of the samples; unit: distal link cubed times platform radius")
    ] = 0.0


class SingularMargins(SpecModel):
    """How far postures keep from where branches meet, in the measures of the arm's closed form."""

    shoulder: Annotated[float, Field(ge=0, description="spherical wrist: its centre's distance from axis 1, m")] = 0.0
    elbow: Annotated[float, Field(ge=0, description="lengths of both links times the sine of their angle, m2")] = 0.0
    wrist: Annotated[float, Field(ge=0, le=1, description="sine of the bend between the two outer axes")] = 0.0


class ArmInverseSpec(SpecModel):
    """Tip pose of a serial arm -> joint positions, on named branches of its closed-form inverse."""

    kind: Literal["arm_inverse"]
    branches: Annotated[tuple[str, ...], Field(min_length=1, description="such as 'front, elbow up, noflip'")]
    tip: str | None = None
    joints: Annotated[
        dict[str, tuple[JointValue, JointValue]],
        Field(default_factory=dict, description="narrower ranges than the robot's own: joint -> [lower, upper]"),
    ]
    off_singular: Annotated[SingularMargins, Field(description="least measures of the samples")] = SingularMargins()


class SamplesSpec(SpecModel):
    """How many samples a network is trained on, and how many others it is judged by."""

    train: Annotated[int, Field(ge=10, le=10_000_000)] = 4000
    test: Annotated[int, Field(ge=1, le=1_000_000)] = 1000


class NetworkSpec(SpecModel):
    """Units of each hidden layer, and their activation; the output is linear."""

    hidden: Annotated[tuple[Annotated[int, Field(ge=1, le=4096)], ...], Field(min_length=1)] = (12,)
    activation: Activation = "tanh"


class RefineSpec(SpecModel):
    """Newton steps on the exact kinematics after the network, and the gate that their result must pass."""

    steps: Annotated[
        tuple[Annotated[int, Field(ge=1, le=100)], ...],
        Field(min_length=1, description="errors are told after so many steps; the gate stands after the last"),
    ] = (1, 2, 3)
    distance: Annotated[Length, Field(gt=0, description="error below which a position counts as converged")] = 1e-6
    angle: Annotated[Angle, Field(gt=0, description="error below which an orientation counts as converged")] = 1e-5
    gate: Annotated[float, Field(gt=0, description="largest residual of the exact kinematics, m and rad")] = 1e-9

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if list(self.steps) != sorted(set(self.steps)):
            raise ValueError("steps must rise")
        return self


class TrainRun(SpecModel):
    """Networks for every branch of a robot's kinematic map."""

    kind: Literal["train"]
    about: str = ""
    robot: AnyRobotReference
    tool: Annotated[Tool | None, Field(description="a rigid tool on the tip of an arm")] = None
    map: Annotated[PlanarForwardSpec | ArmInverseSpec, Field(discriminator="kind")]
    samples: SamplesSpec = SamplesSpec()
    seed: Annotated[int, Field(ge=0)] = 0
    network: NetworkSpec = NetworkSpec()
    trainer: TrainerSpec
    refine: RefineSpec = RefineSpec()

    @property
    def whole_robot(self) -> AnyRobot:
        """The robot with its tool."""
        if self.tool is None or isinstance(self.robot, Planar3RRR):
            return self.robot
        return with_tool(self.robot, self.tool, getattr(self.map, "tip", None))


def misfits(spec: TrainRun) -> Iterator[tuple[tuple[str, ...], str]]:
    """Where a run does not fit its robot or itself: the field's path, and what is wrong with it."""
    planar = isinstance(spec.robot, Planar3RRR)
    if planar != (spec.map.kind == "planar_forward"):
        wanted = "planar_forward" if planar else "arm_inverse"
        yield ("map", "kind"), f"{spec.map.kind!r} does not suit the robot {spec.robot.name!r}; {wanted} does"
    if planar and spec.tool is not None:
        yield ("tool",), "a planar_3rrr carries no tool"
    if spec.trainer.kind == "levenberg_marquardt":
        if len(spec.network.hidden) != 1 or spec.network.activation != "tanh":
            yield ("network",), "levenberg_marquardt trains one hidden layer of tanh units; adam trains others"
        elif spec.network.hidden[0] > 100:
            yield ("network", "hidden"), f"levenberg_marquardt trains up to 100 units, got {spec.network.hidden[0]}"
