"""Print the instruction list of an SX Function as C over SIMD lanes.

One statement an instruction, on the types and functions of ``c/lanes.h``. Comparisons stay masks,
selections become one bitwise choice, sine and cosine of one angle are computed together, division by a
constant is multiplication by its reciprocal.
"""

import math
from collections import Counter

import casadi as ca

from fzcli.errors import EngineError

_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARE = {ca.OP_LT: "less", ca.OP_LE: "less_equal", ca.OP_EQ: "equal"}
_UNARY = {
    ca.OP_SQRT: "root",
    ca.OP_FABS: "magnitude",
    ca.OP_SIGN: "signum",
    ca.OP_FLOOR: "floored",
    ca.OP_CEIL: "ceiled",
    ca.OP_EXP: "exponential",
    ca.OP_ATAN: "arc_tangent",
    ca.OP_ASIN: "arc_sine",
    ca.OP_ACOS: "arc_cosine",
}
_CALLS = {ca.OP_ATAN2: "arc_tangent2", ca.OP_COPYSIGN: "with_sign"}


def constant(value: float) -> str:
    """A C literal that is bit-equal to ``value``."""
    if math.isnan(value):
        return "from_bits(KB(0x7ff8000000000000))"
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}from_bits(KB(0x7ff0000000000000))"
    return f"K({float(value).hex()})"


def print_function(function: ca.Function, name: str, once: bool = False) -> str:
    """The C text of a static function ``name``(const V *in..., V *out...), one pointer an argument.

    An SX Function becomes straight code. An MX Function must be a graph of calls: its callees are printed
    before it, each once. ``once``: a run calls it once, so that it is compiled quickly rather than for speed.
    Outputs must be dense. Raises EngineError for an operation that the lanes do not know.
    """
    if function.is_a("SXFunction"):
        return ("ONCE " if once else "") + _Printer(function, name).text()
    return _print_calls(function, name, once)


def instructions(function: ca.Function) -> int:
    """How many operations a Function takes, those of its calls included."""
    if function.is_a("SXFunction"):
        return int(function.n_instructions())
    calls = [k for k in range(function.n_instructions()) if function.instruction_id(k) == ca.OP_CALL]
    return sum(instructions(function.instruction_MX(k).which_function()) for k in calls)


def _print_calls(function: ca.Function, name: str, once: bool) -> str:
    """A graph of calls: inputs, calls of other Functions, outputs."""
    printed: dict[int, str] = {}  # a callee's own hash -> its C name
    texts: list[str] = []
    places: dict[int, str] = {}  # work slot -> array that holds it now
    lines: list[str] = []
    for k in range(function.n_instructions()):
        op, into, out = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_INPUT:
            places[out[0]] = f"in{into[0]}"
        elif op == ca.OP_OUTPUT:
            size = function.size1_out(out[0])
            lines.append(f"for (int i = 0; i < {size}; ++i) out{out[0]}[i] = {places[into[0]]}[i];")
        elif op == ca.OP_CONST and not function.instruction_MX(k).numel():
            places[out[0]] = "0"  # nothing is read from it
        elif op == ca.OP_CALL:
            callee = function.instruction_MX(k).which_function()
            if callee.__hash__() not in printed:
                own = f"{name}_{len(printed)}"
                texts.append(print_function(callee, own, once=False))
                printed[callee.__hash__()] = own
            results = []
            for i, slot in enumerate(out):
                array = f"w{k}_{i}"
                lines.append(f"V {array}[AT_LEAST_1({callee.size1_out(i)})];")
                results.append(array)
                if slot >= 0:
                    places[slot] = array
            arguments = ", ".join([*(places[slot] for slot in into), *results])
            lines.append(f"{printed[callee.__hash__()]}({arguments});")
        else:
            raise EngineError(f"{function.name()}: a graph of calls holds CasADi's operation {op}")
    return "".join(texts) + _definition(function, name, lines, once)


def _definition(function: ca.Function, name: str, lines: list[str], once: bool = False) -> str:
    arguments = [f"const V *restrict in{i}" for i in range(function.n_in())]
    arguments += [f"V *restrict out{i}" for i in range(function.n_out())]
    body = "\n".join(f"    {line}" for line in lines)
    unused = " ".join(f"(void)in{i};" for i in range(function.n_in()))
    head = "ONCE " if once else ""
    return f"{head}static void {name}({', '.join(arguments)})\n{{\n    {unused}\n{body}\n}}\n"


Instruction = tuple[int, list[int], list[int]]  # operation, slots written, slots read


def _instructions(function: ca.Function) -> list[Instruction]:
    count = range(function.n_instructions())
    ids, outs, ins = function.instruction_id, function.instruction_output, function.instruction_input
    return [(ids(k), outs(k), ins(k)) for k in count]


def _divisions_by(instructions: list[Instruction]) -> Counter[int]:
    """How often each instruction's result divides something."""
    written: dict[int, int] = {}
    found: Counter[int] = Counter()
    for k, (op, out, into) in enumerate(instructions):
        if op == ca.OP_DIV:
            found[written[into[1]]] += 1
        if op != ca.OP_OUTPUT:
            written[out[0]] = k
    return found


class _Printer:
    """State of one print: what each work slot holds now, as a V and as a mask."""

    def __init__(self, function: ca.Function, name: str) -> None:
        self.function = function
        self.name = name
        self.values: dict[int, str] = {}  # work slot -> C expression of type V
        self.masks: dict[int, str] = {}  # work slot -> C expression of type M, where it holds a truth
        self.constants: dict[int, float] = {}  # work slot -> number it holds, where its reciprocal is safe
        self.negated: dict[str, str] = {}  # mask -> the mask it is the opposite of
        self.picked: dict[str, tuple[str, str]] = {}  # value -> (mask, value) of an if_else_zero
        self.circular: dict[tuple[str, str], str] = {}  # ("sin"/"cos", argument) -> value
        self.reciprocals: dict[str, str] = {}  # divisor -> its reciprocal
        self.lines: list[str] = []
        self.count = 0
        self._written: dict[int, int] = {}  # work slot -> instruction that wrote it last
        self._instructions = _instructions(function)
        self._divisions = _divisions_by(self._instructions)

    def text(self) -> str:
        for k, (op, out, into) in enumerate(self._instructions):
            self._statement(k, op, out, into)
            if op != ca.OP_OUTPUT:
                self._written[out[0]] = k
        return _definition(self.function, self.name, self.lines)

    def _new(self, expression: str, mask: bool = False) -> str:
        self.count += 1
        name = f"{'m' if mask else 'v'}{self.count}"
        self.lines.append(f"{'M' if mask else 'V'} {name} = {expression};")
        return name

    def _value(self, slot: int) -> str:
        if slot not in self.values:
            self.values[slot] = self._new(f"number({self.masks[slot]})")
        return self.values[slot]

    def _mask(self, slot: int) -> str:
        if slot not in self.masks:
            self.masks[slot] = self._new(f"truth({self.values[slot]})", mask=True)
        return self.masks[slot]

    def _set(self, slot: int, value: str) -> None:
        self.values[slot] = value
        self.masks.pop(slot, None)
        self.constants.pop(slot, None)

    def _set_mask(self, slot: int, mask: str) -> None:
        self.masks[slot] = mask
        self.values.pop(slot, None)
        self.constants.pop(slot, None)

    def _statement(self, k: int, op: int, out: list[int], into: list[int]) -> None:
        if op == ca.OP_OUTPUT:
            self.lines.append(f"out{out[0]}[{out[1]}] = {self._value(into[0])};")
        elif op == ca.OP_INPUT:
            self._set(out[0], self._new(f"in{into[0]}[{into[1]}]"))
        elif op == ca.OP_CONST:
            number = self.function.instruction_constant(k)
            self._set(out[0], constant(number))
            if 1e-290 < abs(number) < 1e290:
                self.constants[out[0]] = number
        elif op in _COMPARE:
            expression = f"{_COMPARE[op]}({self._value(into[0])}, {self._value(into[1])})"
            self._set_mask(out[0], self._new(expression, mask=True))
        elif op == ca.OP_NE:
            expression = f"opposite(equal({self._value(into[0])}, {self._value(into[1])}))"
            self._set_mask(out[0], self._new(expression, mask=True))
        elif op in (ca.OP_AND, ca.OP_OR):
            join = "both" if op == ca.OP_AND else "either"
            expression = f"{join}({self._mask(into[0])}, {self._mask(into[1])})"
            self._set_mask(out[0], self._new(expression, mask=True))
        elif op == ca.OP_NOT:
            mask = self._mask(into[0])
            opposite = self._new(f"opposite({mask})", mask=True)
            self.negated[opposite] = mask
            self._set_mask(out[0], opposite)
        elif op == ca.OP_IF_ELSE_ZERO:
            mask, value = self._mask(into[0]), self._value(into[1])
            picked = self._new(f"pick({mask}, {value})")
            self.picked[picked] = (mask, value)
            self._set(out[0], picked)
        elif op in (ca.OP_SIN, ca.OP_COS):
            self._set(out[0], self._circular("sin" if op == ca.OP_SIN else "cos", self._value(into[0])))
        else:
            self._set(out[0], self._new(self._arithmetic(op, into)))

    def _arithmetic(self, op: int, into: list[int]) -> str:
        a = self._value(into[0])
        if op in _UNARY:
            return f"{_UNARY[op]}({a})"
        simple = {
            ca.OP_ASSIGN: a,
            ca.OP_NEG: f"-{a}",
            ca.OP_SQ: f"{a} * {a}",
            ca.OP_TWICE: f"{a} + {a}",
            ca.OP_INV: f"K(1.0) / {a}",
        }
        if op in simple:
            return simple[op]
        if op == ca.OP_ADD:
            chosen = self._choice(a, self._value(into[1]))
            if chosen:
                return chosen
        if op == ca.OP_DIV and into[1] in self.constants:
            return f"{a} * {constant(1.0 / self.constants[into[1]])}"
        if op == ca.OP_DIV and self._divisions[self._written[into[1]]] > 1:
            return f"{a} * {self._reciprocal(self._value(into[1]))}"
        if op in _BINARY:
            return f"{a} {_BINARY[op]} {self._value(into[1])}"
        if op in (ca.OP_FMIN, ca.OP_FMAX):  # the newer operand first: a NaN there is passed over, as by libm
            return f"{'least' if op == ca.OP_FMIN else 'most'}({self._value(into[1])}, {a})"
        if op in _CALLS:
            return f"{_CALLS[op]}({a}, {self._value(into[1])})"
        if op == ca.OP_CONSTPOW and self._value(into[1]) == constant(0.5):
            return f"root({a})"
        raise EngineError(f"the compiled engine does not know CasADi's operation {op}")

    def _reciprocal(self, divisor: str) -> str:
        """CasADi turns x * (1/y) back into x / y: of several divisions by one value, make one again."""
        if divisor not in self.reciprocals:
            self.reciprocals[divisor] = self._new(f"K(1.0) / {divisor}")
        return self.reciprocals[divisor]

    def _choice(self, a: str, b: str) -> str | None:
        """CasADi writes a selection as pick(m, x) + pick(~m, y): one bitwise choice."""
        if a not in self.picked or b not in self.picked:
            return None
        (mask_a, x), (mask_b, y) = self.picked[a], self.picked[b]
        if self.negated.get(mask_b) == mask_a:
            return f"choose({mask_a}, {x}, {y})"
        if self.negated.get(mask_a) == mask_b:
            return f"choose({mask_b}, {y}, {x})"
        return None

    def _circular(self, which: str, argument: str) -> str:
        if (which, argument) not in self.circular:
            self.count += 1
            sine, cosine = f"s{self.count}", f"c{self.count}"
            self.lines.append(f"V {sine}, {cosine}; sine_cosine({argument}, &{sine}, &{cosine});")
            self.circular["sin", argument], self.circular["cos", argument] = sine, cosine
        return self.circular[which, argument]
