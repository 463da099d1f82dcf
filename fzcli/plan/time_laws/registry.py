"""The time laws that a spec can name."""

from typing import Literal

from fzcli.plan.time_laws import cycloidal, polynomial_345, polynomial_4567, trapezoidal

TimeLawName = Literal["3-4-5", "4-5-6-7", "cycloidal", "trapezoidal"]
TIME_LAWS = {
    "3-4-5": polynomial_345.LAW,
    "4-5-6-7": polynomial_4567.LAW,
    "cycloidal": cycloidal.LAW,
    "trapezoidal": trapezoidal.LAW,
}
