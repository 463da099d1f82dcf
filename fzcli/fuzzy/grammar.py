"""The grammar of rules: text in, a small syntax tree out, every error pointing at its word.

::

    rule       = "if" condition "then" conclusion {"and" conclusion} ["with" weight]
    condition  = conjunct {"or" conjunct}
    conjunct   = factor {"and" factor}
    factor     = "not" factor | "(" condition ")" | INPUT "is" ["not"] TERM
    conclusion = OUTPUT "is" TERM

So parentheses bind before ``not``, ``not`` before ``and``, ``and`` before ``or``. Key words may be
written in any case; names of variables and terms are case-sensitive.
"""

import re
from dataclasses import dataclass

from fzcli.errors import Problem, SpecError
from fzcli.spec.nearest import hint
from fzcli.spec.rulebase import Input, Output, Rulebase, RuleText

KEYWORDS = frozenset({"if", "is", "then", "and", "or", "not", "with"})
_MAX_DEPTH = 64  # of parentheses and nots: far beyond any readable rule, well inside Python's own limit
_TOKEN = re.compile(
    r"\s*(?:(?P<word>[^\W\d]\w*)|(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<sign>\S))"
)


@dataclass(frozen=True)
class Is:
    """``variable is term``: the degree to which an input belongs to a fuzzy set."""

    variable: str
    term: str


@dataclass(frozen=True)
class Not:
    """The complement, one less the operand's degree."""

    operand: "Condition"


@dataclass(frozen=True)
class And:
    """The conjunction of two or more operands, from left to right."""

    operands: tuple["Condition", ...]


@dataclass(frozen=True)
class Or:
    """The disjunction of two or more operands, from left to right."""

    operands: tuple["Condition", ...]


Condition = Is | Not | And | Or


def variables(condition: Condition) -> frozenset[str]:
    """The inputs that a condition speaks of."""
    match condition:
        case Is():
            return frozenset({condition.variable})
        case Not():
            return variables(condition.operand)
        case And() | Or():
            return frozenset[str]().union(*map(variables, condition.operands))


@dataclass(frozen=True)
class Rule:
    """A parsed rule: its condition, its conclusions, and its weight in [0, 1]."""

    condition: Condition
    conclusions: tuple[Is, ...]
    weight: float = 1.0


@dataclass(frozen=True)
class _Token:
    kind: str  # "word", "number", "sign" or "end"
    text: str
    offset: int

    @property
    def keyword(self) -> str:
        """The key word that this token is, or an empty string."""
        word = self.text.lower()
        return word if self.kind == "word" and word in KEYWORDS else ""

    def __str__(self) -> str:
        return f"'{self.text}'" if self.text else "the end of the rule"


class _SyntaxError(Exception):
    """Ends the reading of one rule; its problem is already in the parser's list."""


def parse_rules(rulebase: Rulebase) -> tuple[Rule, ...]:
    """Parse all rules of a rule base.

    Raises:
        SpecError: every syntax error and unknown name of every rule, each with file, line, column
            and a caret under the word.
    """
    rules, problems = read_rules(rulebase)
    if problems:
        raise SpecError(problems)
    return rules


def read_rules(rulebase: Rulebase) -> tuple[tuple[Rule, ...], list[Problem]]:
    """Parse all rules and return the good ones with the list of everything wrong in the others."""
    rules: list[Rule] = []
    problems: list[Problem] = []
    for index, text in enumerate(rulebase.rules):
        parser = _Parser(rulebase, text, f"rules.{index}")
        try:
            rule = parser.rule()
        except _SyntaxError:
            rule = None
        if rule is not None and not parser.problems:
            rules.append(rule)
        problems += parser.problems
    return tuple(rules), problems


def _tokens(text: str) -> list[_Token]:
    tokens = []
    for match in _TOKEN.finditer(text):
        kind = match.lastgroup or "sign"
        tokens.append(_Token(kind, match[kind], match.start(kind)))
    return [*tokens, _Token("end", "", len(text.rstrip()))]


class _Parser:
    """Recursive descent over one rule: a wrong name is noted and passed, wrong syntax ends the rule."""

    def __init__(self, rulebase: Rulebase, source: RuleText, field: str) -> None:
        self.rulebase = rulebase
        self.source = source
        self.field = field
        self.problems: list[Problem] = []
        self.tokens = _tokens(source.text)
        self.position = 0
        self.depth = 0

    def rule(self) -> Rule:
        self.expect("if", "a rule starts with 'if'")
        condition = self.condition()
        self.expect("then", "expected 'and', 'or' or 'then'")
        conclusions = [self.conclusion()]
        while self.take("and"):
            conclusions.append(self.conclusion())
        weight = self.weight() if self.take("with") else 1.0
        if self.here.kind != "end":
            raise self.wrong("expected 'and', 'with' or the end of the rule")
        return Rule(condition, tuple(conclusions), weight)

    def condition(self) -> Condition:
        operands = [self.conjunct()]
        while self.take("or"):
            operands.append(self.conjunct())
        return operands[0] if len(operands) == 1 else Or(tuple(operands))

    def conjunct(self) -> Condition:
        operands = [self.factor()]
        while self.take("and"):
            operands.append(self.factor())
        return operands[0] if len(operands) == 1 else And(tuple(operands))

    def factor(self) -> Condition:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise self.problem(f"nested deeper than {_MAX_DEPTH} levels", self.here)
        node: Condition
        if self.take("not"):
            node = Not(self.factor())
        elif self.here.text == "(":
            self.advance()
            node = self.condition()
            if self.here.text != ")":
                raise self.wrong("expected 'and', 'or' or ')'")
            self.advance()
        else:
            node = self.proposition()
        self.depth -= 1
        return node

    def proposition(self) -> Condition:
        variable = self.variable(self.rulebase.inputs, "input", "an input, 'not' or '('")
        self.expect("is", f"expected 'is' after '{variable.text}'")
        negated = self.take("not")
        node = Is(variable.text, self.term(variable, self.rulebase.inputs))
        return Not(node) if negated else node

    def conclusion(self) -> Is:
        variable = self.variable(self.rulebase.outputs, "output", "an output")
        self.expect("is", f"expected 'is' after '{variable.text}'")
        if self.here.keyword == "not":
            raise self.problem("a conclusion names a term; 'not' belongs to conditions", self.here)
        return Is(variable.text, self.term(variable, self.rulebase.outputs))

    def variable(self, known: dict[str, Input] | dict[str, Output], role: str, wanted: str) -> _Token:
        if self.here.kind != "word" or self.here.keyword:
            raise self.wrong(f"expected {wanted}")
        token = self.advance()
        if token.text not in known:
            other = "output" if role == "input" else "input"
            if token.text in (self.rulebase.outputs if role == "input" else self.rulebase.inputs):
                message = f"'{token.text}' is an {other}, but an {role} is needed here"
            else:
                message = f"there is no {role} '{token.text}'"
            self.problem(message + hint(token.text, known, f"{role}s"), token)
        return token

    def term(self, variable: _Token, known: dict[str, Input] | dict[str, Output]) -> str:
        if self.here.kind != "word" or self.here.keyword:
            raise self.wrong(f"expected a term of '{variable.text}'")
        token = self.advance()
        owner = known.get(variable.text)
        if owner is not None and token.text not in owner.terms:
            near = hint(token.text, owner.terms, "terms")
            self.problem(f"'{variable.text}' has no term '{token.text}'{near}", token)
        return token.text

    def weight(self) -> float:
        if self.here.kind != "number":
            raise self.wrong("expected a weight from 0 to 1")
        token = self.advance()
        weight = float(token.text)
        if not 0.0 <= weight <= 1.0:
            self.problem(f"a weight lies in 0 to 1, not {token.text}", token)
        return weight

    @property
    def here(self) -> _Token:
        return self.tokens[self.position]

    def advance(self) -> _Token:
        token = self.here
        self.position += 1
        return token

    def take(self, keyword: str) -> bool:
        found = self.here.keyword == keyword
        self.position += found
        return found

    def expect(self, keyword: str, message: str) -> None:
        if not self.take(keyword):
            raise self.wrong(message)

    def wrong(self, message: str) -> _SyntaxError:
        return self.problem(f"{message}, found {self.here}", self.here)

    def problem(self, message: str, token: _Token) -> _SyntaxError:
        """Note what is wrong with a token; the returned exception ends the rule when raised."""
        source, before = self.source, self.source.text[: token.offset]
        first = before.rfind("\n") + 1
        line = source.text[first:].partition("\n")[0].replace("\t", " ")
        caret = " " * (token.offset - first) + "^" * max(1, len(token.text))
        below = before.count("\n")
        self.problems.append(
            Problem(
                message,
                self.field,
                source.file,
                None if source.line is None else source.line + below,
                # The indentation of a rule's further lines is lost, and with it their columns.
                None if source.column is None or below else source.column + token.offset,
                f"    {line}\n    {caret}",
            )
        )
        return _SyntaxError()
