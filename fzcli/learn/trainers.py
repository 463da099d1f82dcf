"""What a run may say about how its networks are trained: one spec a trainer."""

from typing import Annotated, Literal

from pydantic import Field

from fzcli.spec.base import SpecModel

Rate = Annotated[float, Field(gt=0)]


class LevenbergMarquardtSpec(SpecModel):
    """Levenberg-Marquardt on the whole training set; one hidden layer of tanh units, up to a few dozen."""

    kind: Literal["levenberg_marquardt"]
    iterations: Annotated[int, Field(ge=1)] = 1000
    starts: Annotated[
        int, Field(ge=1, description="random starts; the best after a fifth of the iterations goes on")
    ] = 3


class MomentumSpec(SpecModel):
    """Gradient descent with momentum on the whole training set, as Parsa 2008 says."""

    kind: Literal["momentum"]
    iterations: Annotated[int, Field(ge=1)] = 30_000
    rate: Rate = 0.1
    momentum: Annotated[float, Field(ge=0, lt=1)] = 0.9


class AdamSpec(SpecModel):
    """Adam on batches, for large networks (scikit-learn); ``epochs`` at each of the ``rates`` in turn."""

    kind: Literal["adam"]
    epochs: Annotated[int, Field(ge=1)] = 10
    rates: Annotated[tuple[Rate, ...], Field(min_length=1)] = (1e-3, 3e-4, 1e-4)
    batch: Annotated[int, Field(ge=1)] = 256


TrainerSpec = Annotated[LevenbergMarquardtSpec | MomentumSpec | AdamSpec, Field(discriminator="kind")]
