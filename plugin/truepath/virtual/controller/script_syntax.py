"""URScript as Python's syntax tree, to be walked and never executed.

One statement a line, which URScript keeps to: each line becomes one line of Python syntax. Shares nothing with the
parser that corrects programs, so that each can be held against the other.
"""

from __future__ import annotations

import ast
import keyword
import re
import warnings
from dataclasses import dataclass

from truepath.virtual.controller.script_instructions import ScriptError

MOST_CHARACTERS, MOST_TERMS, DEEPEST = 4_000_000, 400_000, 200
START, KILL, JOIN = "START_", "KILL_", "JOIN_"  # functions that stand for run, kill, join
POSE = "POSE_"
OWN_WORDS = {"and", "break", "continue", "def", "elif", "else", "False", "global", "if", "not", "or", "return", "True"}
FOREIGN = "|".join(sorted(set(keyword.kwlist) - OWN_WORDS - {"while"}))  # names like any other
TOKEN = re.compile(
    r"""(?P<string>"[^"]*")|(?P<comment>\#.*)|(?P<pose>\bp\[)|(?P<assign>:=)|(?P<alien>['\\;@`\r])"""
    r"""|\brun\s+(?P<run>\w+)\s*\(|\b(?P<thread>kill|join)\s+(?P<handle>\w+)|(?P<xor>\bxor\b)"""
    rf"|(?P<foreign>\b(?:{FOREIGN})\b)"
)
NO_EFFECT = re.compile(r"\$|(enter_critical|exit_critical)$")
STATED_SCOPE = re.compile(r"^(global|local)\s+(\w+)\s*=(?!=)")
OPENS, GOES_ON, DEFINES = (re.compile(rf"({words})\b") for words in ("def|while|if", "else|elif", "thread|sec"))


@dataclass(frozen=True, eq=False)
class Syntax:
    """A program.

    Attributes:
        body: of the text.
        secondary: names of its secondary programs.
    """

    body: list[ast.stmt]
    secondary: frozenset[str]

    @property
    def bare(self) -> list[ast.stmt]:
        """Statements of the text that stand in no function."""
        return [node for node in self.body if not isinstance(node, (ast.FunctionDef, ast.Pass))]

    @property
    def programs(self) -> list[ast.FunctionDef]:
        """Functions of the text that stand in no other."""
        return [node for node in self.body if isinstance(node, ast.FunctionDef)]


def read_syntax(text: str) -> Syntax:
    """The tree of a program; its lines are those of the text.

    Raises:
        ScriptError: this is no URScript, or more of it than anybody would write.
    """
    if len(text) > MOST_CHARACTERS or sum(map(text.count, ",+-*/=([<>")) > MOST_TERMS:
        raise ScriptError("the program is too long")
    depth, lines, secondary = 0, [], set[str]()
    for number, written in enumerate(re.split(r"\r?\n", text.removeprefix("\ufeff")), start=1):
        line = STATED_SCOPE.sub(r"\2: \1_ =", _translated(written, number).strip())
        if line.startswith("sec "):
            secondary.add(line[4:].partition("(")[0].strip())
        line = DEFINES.sub("def", line) if DEFINES.match(line) else line
        if line == "end":
            lines.append("  " * depth + "pass")  # a block may hold nothing but comments
            depth -= 1
        elif GOES_ON.match(line):
            lines.append("  " * (depth - 1) + line)
        else:
            lines.append("  " * depth + ("pass" if NO_EFFECT.match(line) else line) if line else "")
            depth += bool(OPENS.match(line))
        if not 0 <= depth <= DEEPEST:
            raise ScriptError("an end too many" if depth < 0 else "blocks in blocks, too deep", number)
    if depth:
        raise ScriptError("an end is missing")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python's own taste
            tree = ast.parse("\n".join(lines))
    except SyntaxError as error:
        raise ScriptError("this is no statement of URScript", error.lineno) from None
    except (ValueError, RecursionError, MemoryError, OverflowError):
        raise ScriptError("this is no program") from None
    return Syntax(tree.body, frozenset(secondary))


def _translated(line: str, number: int) -> str:
    """A line with the words of URScript that Python lacks as names, strings safely quoted, its comment gone."""

    def replaced(found: re.Match[str]) -> str:
        word = found[0]
        match found.lastgroup:
            case "string":
                return repr(word[1:-1])
            case "comment":
                return ""
            case "foreign":
                return f"{word}_"
            case "pose":
                return f"{POSE}["
            case "assign":
                return "="
            case "run":
                return f"{START}{found['run']}("
            case "handle":
                return f"{KILL if found['thread'] == 'kill' else JOIN}({found['handle']})"
            case "xor":
                return "^"
        raise ScriptError(f"{word!r} has no meaning in URScript", number)

    return TOKEN.sub(replaced, line)
