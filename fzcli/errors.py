"""The errors fzcli raises: one base class, and one child per way of going wrong."""

from dataclasses import dataclass


class FzcliError(Exception):
    """Base of all errors that fzcli raises on purpose; the command line turns it into one message.

    ``exit_code`` is what a command ends with: 2 for bad usage or input, 1 for a failed computation.
    """

    exit_code = 2


@dataclass(frozen=True)
class Problem:
    """One thing wrong with an input: where it stands, which field, what rule it breaks.

    ``file``, ``line`` and ``column`` (both from 1) are None where the input has no place in a text.
    ``snippet`` is the source line with a caret, or an empty string.
    """

    message: str
    field: str = ""
    file: str | None = None
    line: int | None = None
    column: int | None = None
    snippet: str = ""

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        head = ": ".join(part for part in (place, self.field, self.message) if part)
        return f"{head}\n{self.snippet}" if self.snippet else head


class SpecError(FzcliError, ValueError):
    """Bad input: carries every problem found, in the order of the text.

    It is a ValueError too, so that a validator may raise one and its problems join the others.
    """

    def __init__(self, problems: list[Problem] | Problem | str) -> None:
        if isinstance(problems, str):
            problems = [Problem(problems)]
        elif isinstance(problems, Problem):
            problems = [problems]
        self.problems: tuple[Problem, ...] = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class UsageError(FzcliError):
    """A command or an API call that makes no sense with these arguments."""


class EngineError(FzcliError):
    """The compiled engine could not be built or loaded."""

    exit_code = 1


class RecordError(FzcliError):
    """A result file that cannot be read as one, or a name that is not in it."""


class IntegrationError(FzcliError):
    """A step that an error-controlled integrator cannot take within its tolerance and its number of inner steps."""


class UnfinishedError(FzcliError):
    """A sweep that was stopped on its way; what is done is kept, and the same command goes on from there."""

    exit_code = 3
