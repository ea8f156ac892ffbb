"""One-line changes of source, C++ and Python, as a slip of the hand would make them.

Comparisons, signs (those of a number or a term, too, which are dropped), constants, conditions, exits that are dropped
and arguments that are swapped. What comes out need not compile; it is the same for the same source. Left alone are

- comments and texts, which do nothing, or are words to people;
- what the preprocessor reads but macros: it says which code there is, not what that does;
- static_assert and the 0 of a pure virtual function: the compiler alone reads them; what it refuses would be drawn
  again, what it lets pass does the same;
- import, global and nonlocal, which only give names;
- the order of the parameters in a Python `def`, and of bases behind `class`: nearly any call notices at once, so that
  they would only raise the share that is noticed. Defaults and annotations there are drawn as anything else;
- declarations without an operator or a constant: they have nothing that these changes could change.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath

CPP_ENDINGS = (".cpp", ".hpp", ".h")
ENDINGS = (*CPP_ENDINGS, ".py")
TEMPLATE = ".in"
"""behind the ending of a file of which another is made: a controller of one's own, or a file of the build"""
PYTHON_PROGRAM = re.compile(r"#!.*\bpython")


@dataclass(frozen=True)
class Change:
    """One change: the text from `begin` to `end` of line `line` (both counted from 1 and 0) becomes `after`."""

    line: int
    begin: int
    end: int
    before: str
    after: str
    kind: str

    def apply(self, text: str) -> str:
        """The text with the change. ValueError if it is not the text that the change was made for."""
        lines = text.splitlines(keepends=True)
        old = lines[self.line - 1]
        if old[self.begin : self.end] != self.before:
            raise ValueError(f"line {self.line}: expected '{self.before}', got '{old[self.begin : self.end]}'")
        lines[self.line - 1] = old[: self.begin] + self.after + old[self.end :]
        return "".join(lines)


CPP_SKIPPED = re.compile(
    r'//[^\n]*|/\*.*?\*/|R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|(?<![\da-fA-F])\'(?:\\.|[^\'\\\n])+\'',
    re.DOTALL,
)
SWAPPED_WORDS = {
    "comparison": {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is": "is not"},
    "sign": {"+": "-", "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*="},
    "condition": {"&&": "||", "||": "&&", "and": "or", "or": "and"},
    "constant": {"true": "false", "false": "true", "True": "False", "False": "True"},
}
# Binary operators have blanks around them, in C++ by the formatter, or end their line; brackets of templates and
# pointers have not.
WORDS = re.compile(
    r"(?<!\S)(<=|>=|==|!=|\+=|-=|\*=|/=|&&|\|\||<|>|\+|-|\*|/|and|or|is(?! not\b))(?!\S)|\b(true|false|True|False)\b"
)
PYTHON_WORDS, CPP_WORDS = ("and", "or", "is", "True", "False"), ("true", "false", "&&", "||")
# A sign stands before its number or term without a blank, and behind no other term.
SIGN = re.compile(r"(?<![\w)\].-])-(?=[\w(.])")
NUMBER = re.compile(r"(?<![\w.])(0[xX][\da-fA-F]+|\d(?:'?\d)*(?:\.\d*)?(?:[eE][-+]?\d+)?)([fFuUlL]*)(?![\w.])")
NEGATION = re.compile(r"!(?=[\w(])|\bnot (?=[\w(])")
TWO_ARGUMENTS = re.compile(r"(?<=[\w\]])\(([\w.\[\]]+), ([\w.\[\]]+)\)")
CPP_EXIT = re.compile(r"^(\s*(?:\} )?(?:(?:else )?if \(.*\) )?)((?:return|break|continue|throw)\b[^;{}]*;)\s*$")
PYTHON_EXIT = re.compile(r"^(\s*(?:(?:el)?if .*: )?)((?:return|break|continue|raise)\b.*)$")
DEFINE = re.compile(r"\s*#\s*define\b")
CPP_LEFT_OUT = re.compile(r"^\s*static_assert\b|^\s*virtual .*= 0;")
PYTHON_LEFT_OUT = re.compile(r"^\s*(?:import |from |global |nonlocal )")
PYTHON_HEADING = re.compile(r"^\s*(?:async )?(?:def|class) ")


def is_python(text: str, name: str) -> bool:
    """Whether a file is Python, by its ending, or without one by its first line; else it is read as C++."""
    ending = PurePath(name.removesuffix(TEMPLATE)).suffix
    return ending == ".py" or not ending and PYTHON_PROGRAM.match(text) is not None


def is_source(path: Path) -> bool:
    """Whether a file is C++ or Python: by its ending, that of what is made of a template, or by its first line."""
    ending = PurePath(path.name.removesuffix(TEMPLATE)).suffix
    if ending or not path.is_file():
        return ending in ENDINGS and path.is_file()
    with path.open(encoding="utf-8", errors="replace") as file:
        return PYTHON_PROGRAM.match(file.readline(200)) is not None


def masked_cpp(text: str) -> str:
    """C++ with comments, texts and preprocessor lines but those of macros turned into blanks; every place keeps its
    number."""
    blank = CPP_SKIPPED.sub(lambda found: re.sub(r"[^\n]", " ", found.group()), text)
    lines, continued = [], False
    for line in blank.split("\n"):
        directive = continued or line.lstrip().startswith("#") and DEFINE.match(line) is None
        lines.append(" " * len(line) if directive else line)
        continued = directive and line.rstrip().endswith("\\")
    return "\n".join(lines)


def masked_python(text: str) -> str:
    """Python with comments and texts turned into blanks; every place keeps its number."""
    lines = [list(line) for line in text.split("\n")]
    texts = {tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in texts:
            continue
        for row in range(token.start[0], token.end[0] + 1):
            line = lines[row - 1]
            begin = token.start[1] if row == token.start[0] else 0
            end = token.end[1] if row == token.end[0] else len(line)
            line[begin:end] = " " * (end - begin)
    return "\n".join("".join(line) for line in lines)


def another_number(word: str) -> str:
    """A number beside a number: a whole one and one more; another one doubled, 0.0 becomes 1.0."""
    word = word.replace("'", "")  # between the digits of C++
    if word.isdigit():
        return str(int(word) + 1)
    if word[:2].lower() == "0x":
        return f"0x{int(word, 16) + 1:0{len(word) - 2}X}"
    return "1.0" if float(word) == 0.0 else repr(2.0 * float(word))


def _in_line(line: str, python: bool) -> Iterator[tuple[int, int, str, str]]:
    """Begin, end, new text and kind of every change of one masked line."""
    for found in WORDS.finditer(line):
        word = found.group()
        if word in (CPP_WORDS if python else PYTHON_WORDS):
            continue
        for kind, words in SWAPPED_WORDS.items():
            if word in words:
                yield found.start(), found.end(), words[word], kind
    for found in SIGN.finditer(line):
        yield found.start(), found.end(), "", "sign"
    for found in NUMBER.finditer(line):
        yield found.start(1), found.end(1), another_number(found.group(1)), "constant"
    for found in NEGATION.finditer(line):
        if (found.group() != "!") == python:
            yield found.start(), found.end(), "", "condition"
    for found in TWO_ARGUMENTS.finditer(line):
        first, second = found.groups()
        if first != second and not (python and PYTHON_HEADING.match(line)):
            yield found.start(), found.end(), f"({second}, {first})", "swapped arguments"
    left = (PYTHON_EXIT if python else CPP_EXIT).match(line)
    if left is None or any(line.count(pair[0]) != line.count(pair[1]) for pair in (("(", ")"), ("[", "]"), ("{", "}"))):
        return
    # A C++ function that only returns something would end nowhere; an exit behind a condition may be dropped.
    if python or left.group(1).strip() or not left.group(2).startswith("return "):
        yield left.start(2), left.end(2), "pass" if python else ";", "dropped exit"


def code_lines(text: str, name: str) -> list[int]:
    """Numbers of the lines that hold code, from 1."""
    python = is_python(text, name)
    masked = (masked_python if python else masked_cpp)(text)
    return [number for number, line in enumerate(masked.split("\n"), 1) if re.search(r"\w", line)]


def changes(text: str, name: str) -> list[Change]:
    """Every change of a file, by line; `name` tells the language."""
    python = is_python(text, name)
    masked = (masked_python if python else masked_cpp)(text)
    left_out = PYTHON_LEFT_OUT if python else CPP_LEFT_OUT
    result = []
    for number, (line, whole) in enumerate(zip(masked.split("\n"), text.split("\n"), strict=True), 1):
        if left_out.match(line):
            continue
        for begin, end, after, kind in _in_line(line, python):
            result.append(Change(number, begin, end, whole[begin:end], after, kind))
    return result
