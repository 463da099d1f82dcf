"""Documents against models: every error at once, each with place, field, rule and nearest name."""

from typing import Annotated, Any, Literal

import pytest
from pydantic import Field, TypeAdapter, ValidationInfo, field_validator

from fzcli.errors import Problem, SpecError
from fzcli.spec.base import SpecModel
from fzcli.spec.document import document_of
from fzcli.spec.parse import parse
from fzcli.spec.reader import read_text
from fzcli.spec.units import Duration, Frequency


class Alpha(SpecModel):
    kind: Literal["alpha"]
    gain: Annotated[Frequency, Field(gt=0)]


class Beta(SpecModel):
    kind: Literal["beta"]
    axis: tuple[float, float, float] = (0, 0, 1)
    default: float | Literal["hold"] = 0.0


Controller = Annotated[Alpha | Beta, Field(discriminator="kind")]


class Run(SpecModel):
    step: Annotated[Duration, Field(gt=0)] = 0.01
    controller: Controller
    others: tuple[Controller, ...] = ()
    by_name: dict[str, Alpha] = Field(default_factory=dict)
    method: Literal["euler", "midpoint"] = "euler"
    count: int = 1
    weight: float = 1.0
    record: bool = False
    about: str = ""

    @field_validator("about")
    @classmethod
    def _about(cls, value: str, info: ValidationInfo) -> str:
        if value == "refused":
            raise ValueError("this text is refused")
        if value == "nested":
            raise SpecError([Problem("is odd", "links.a", "other.yaml", 3, 4), Problem("no such robot")])
        return str((info.context or {}).get("about", value))


GOOD = "controller: {kind: alpha, gain: 5 Hz}\n"


def problems(text: str, sets: tuple[str, ...] = ()) -> list[str]:
    with pytest.raises(SpecError) as caught:
        parse(read_text(text, "x.yaml"), Run, sets=sets)
    return [str(problem).split("\n")[0] for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD + "stepp: 1", "x.yaml:2:1: stepp: unknown key; did you mean 'step'?"),
        (
            GOOD + "xyz: 1",
            "x.yaml:2:1: xyz: unknown key; known keys: step, controller, others, by_name, method, "
            "count, weight, record, about",
        ),
        (
            "controller: {kind: alpha, gian: 1, gain: 1}",
            "x.yaml:1:27: controller.gian: unknown key; did you mean 'gain'?",
        ),
        ("step: 1", "x.yaml:1:1: controller: is missing"),
        ("controller: {kind: alpha}", "x.yaml:1:13: controller.gain: is missing"),
        (
            "controller: {kind: alfa}",
            "x.yaml:1:20: controller.kind: unknown kind 'alfa'; did you mean 'alpha'? (known: alpha, beta)",
        ),
        ("controller: {kind: zzz}", "x.yaml:1:20: controller.kind: unknown kind 'zzz'; known: alpha, beta"),
        ("controller: {}", "x.yaml:1:13: controller.kind: is missing; one of alpha, beta"),
        ("controller: alpha", "x.yaml:1:13: controller: must be a mapping, got 'alpha'"),
        (GOOD + "step: 10 kg", "x.yaml:2:7: step: '10 kg' is a mass; a duration is wanted, e.g. '10 ms'"),
        (GOOD + "step: -1 ms", "x.yaml:2:7: step: must be > 0, got '-1 ms'"),
        (GOOD + "step: .nan", "x.yaml:2:7: step: must be a finite number, got nan"),
        (GOOD + "weight: .inf", "x.yaml:2:9: weight: must be a finite number, got inf"),
        (GOOD + "weight: true", "x.yaml:2:9: weight: must be a number, got true"),
        (GOOD + "weight: heavy", "x.yaml:2:9: weight: must be a number, got 'heavy'"),
        (GOOD + "weight: 3 kg", "x.yaml:2:9: weight: must be a number, got '3 kg'"),
        (GOOD + "count: 1.5", "x.yaml:2:8: count: must be a whole number, got 1.5"),
        (GOOD + "record: often", "x.yaml:2:9: record: must be true or false, got 'often'"),
        (GOOD + "about: [1]", "x.yaml:2:8: about: must be text, got [1]"),
        (GOOD + "about: refused", "x.yaml:2:8: about: this text is refused"),
        (
            GOOD + "method: eulr",
            "x.yaml:2:9: method: must be 'euler' or 'midpoint', got 'eulr'; did you mean 'euler'?",
        ),
        (GOOD + "others: [{kind: beta, axis: [1]}]", "x.yaml:2:29: others.0.axis: needs 3 items, has 1"),
        (
            GOOD + "others: [{kind: beta, axis: [1, 2, 3, 4]}]",
            "x.yaml:2:29: others.0.axis: needs at most 3 items, has 4",
        ),
        (
            GOOD + "others: [{kind: beta, axis: [1, x, 3]}]",
            "x.yaml:2:33: others.0.axis.1: must be a number, got 'x'",
        ),
        (
            GOOD + "others: [{kind: beta, axis: [1, true, 3]}]",
            "x.yaml:2:33: others.0.axis.1: must be a number, got true",
        ),
        (GOOD + "others: {}", "x.yaml:2:9: others: must be a list, got a mapping"),
        (
            GOOD + "others: [{kind: beta, default: hod}]",
            "x.yaml:2:32: others.0.default: must be a number or 'hold', got 'hod'",
        ),
        (GOOD + "by_name: {a: {kind: alpha, gain: 0}}", "x.yaml:2:34: by_name.a.gain: must be > 0, got 0"),
        (
            GOOD + "by_name: {a: {kind: alpha, gain: 1, kid: 2}}",
            "x.yaml:2:37: by_name.a.kid: unknown key; did you mean 'kind'?",
        ),
        ("[1, 2]", "x.yaml:1:1: must be a mapping, got [1, 2]"),
    ],
)
def test_one_problem(text: str, message: str) -> None:
    assert problems(text) == [message]


def test_all_problems_come_at_once_in_the_order_of_the_text() -> None:
    text = "step: 10 kg\ncontroller: {kind: alpha, gain: -1, gian: 2}\nmethod: rk4\nfoo: 1\n"
    assert problems(text) == [
        "x.yaml:1:7: step: '10 kg' is a mass; a duration is wanted, e.g. '10 ms'",
        "x.yaml:2:33: controller.gain: must be > 0, got -1",
        "x.yaml:2:37: controller.gian: unknown key; did you mean 'gain'?",
        "x.yaml:3:9: method: must be 'euler' or 'midpoint', got 'rk4'",
        "x.yaml:4:1: foo: unknown key; known keys: step, controller, others, by_name, method, count, weight, "
        "record, about",
    ]


def test_the_line_is_shown_with_a_caret() -> None:
    with pytest.raises(SpecError) as caught:
        parse(read_text(GOOD + "step: 10 kg\n", "x.yaml"), Run)
    assert str(caught.value).split("\n")[1:] == ["    step: 10 kg", "          ^"]


def test_a_flood_of_problems_is_cut() -> None:
    text = GOOD + "others:\n" + "- {name: a, kind: beta, axis: 1}\n" * 5_000
    told = problems(text)
    assert len(told) == 101
    assert told[-1] == "x.yaml: and 9900 more problems"


def test_problems_of_another_file_come_through() -> None:
    assert problems(GOOD + "about: nested\nfoo: 1") == [
        "other.yaml:3:4: links.a: is odd",
        "x.yaml:2:8: about: no such robot",
        "x.yaml:3:1: foo: unknown key; known keys: step, controller, others, by_name, method, count, weight, "
        "record, about",
    ]


def test_good_text_becomes_the_model_and_validators_see_the_context() -> None:
    run = parse(read_text(GOOD + "step: 10 ms"), Run, context={"about": "told"})
    assert run.step == 0.01
    assert run.controller == Alpha(kind="alpha", gain=5.0)
    assert parse(read_text(GOOD + "about: x"), Run, context={"about": "told"}).about == "told"


def test_values_without_a_text_pass_the_same_checks() -> None:
    value: Any = {"controller": {"kind": "beta", "axis": (1, 0, 0)}, "step": 1}
    assert parse(document_of(value), Run).controller == Beta(kind="beta", axis=(1, 0, 0))
    with pytest.raises(SpecError, match=r"^<python>: controller.kind: unknown kind 'x'; known: alpha, beta$"):
        parse(document_of({"controller": {"kind": "x"}}), Run)


def test_any_type_that_pydantic_knows_is_taken() -> None:
    assert parse(read_text("[1, 2]"), list[int]) == [1, 2]
    assert TypeAdapter(Controller).validate_python({"kind": "beta"}) == Beta(kind="beta")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("controller.gain=-5", "--set controller.gain=-5: controller.gain: must be > 0, got -5"),
        ("controller.gian=5", "--set controller.gian=5: controller.gian: unknown key; did you mean 'gain'?"),
        ("step=10 kg", "--set step=10 kg: step: '10 kg' is a mass; a duration is wanted, e.g. '10 ms'"),
        ("step.x=3", "--set step.x=3: step.x: 'step' is the single value 1; nothing lies inside it"),
        (
            "others.3.gain=4",
            "--set others.3.gain=4: others.3.gain: no item '3' among 2, numbered from 0 to 1",
        ),
        (
            "controller=[1,",
            "--set controller=[1,: controller: not YAML: did not find expected node content while "
            "parsing a flow node",
        ),
        ("controller", "--set controller: write KEY=VALUE, such as controller.gain=100"),
        ("step=", "--set step=: step: has no value; write null for none, '' for empty text"),
        (
            "controller={kind: alfa}",
            "--set controller={kind: alfa}: controller.kind: unknown kind 'alfa'; did you mean "
            "'alpha'? (known: alpha, beta)",
        ),
    ],
)
def test_set_errors_point_at_the_option(option: str, message: str) -> None:
    text = GOOD + "step: 1\nothers: [{kind: beta}, {kind: beta}]\n"
    assert problems(text, (option,)) == [message]


def test_all_set_errors_come_at_once() -> None:
    assert len(problems(GOOD, ("foo", "bar", "controller.gain.x=1"))) == 3
    assert len(problems(GOOD + "count: x", ("step=1 m", "method=rk4"))) == 3
