"""What pages say that their commands and programs print, compared with what they do print."""

import re

NUMBER = re.compile(r"[-+]?(?:\d+\.\d+|\d+)(?:[eE][-+]?\d+)?")
BLOCK = re.compile(r"^```(sh|python|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAID = re.compile(r"print\(.*\)  # (.*)$")
CLAUSE = re.compile(r", (?=[a-z])|; | in a notebook")
"""Where the printed part of a comment ends, and a remark begins."""
DIGITS = 3
"""Units of its last digit by which a number may differ anyway."""


def is_near(said: str, printed: str, share: float) -> bool:
    """Return whether two numbers as written differ by `share` of the first one, or `DIGITS`, at most."""
    decimals = len(said.partition(".")[2])
    least = DIGITS * 10.0**-decimals if decimals else 0.0
    return abs(float(said) - float(printed)) <= max(share * abs(float(said)), least) * (1.0 + 1e-9)


def is_alike(said: str, printed: str, share: float) -> bool:
    """Return whether a line has the words of another one, and numbers near its numbers."""
    words = [re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip() for line in (said, printed)]
    numbers = zip(NUMBER.findall(said), NUMBER.findall(printed), strict=False)
    return words[0] == words[1] and all(is_near(one, other, share) for one, other in numbers)


def missing_lines(said: str, printed: str, share: float = 0.15) -> list[str]:
    """Return the lines of a page's output that are not printed in its order; ``...`` is any lines."""
    lines, missing = printed.splitlines(), list[str]()
    for line in said.strip().splitlines():
        found = [k for k, one in enumerate(lines) if is_alike(line, one, share)]
        if found:
            lines = lines[found[0] + 1 :]
        elif line.strip() != "...":
            missing.append(line)
    return missing


def missing_comments(program: str, printed: str, share: float = 0.02) -> list[str]:
    """Return the comments behind a program's ``print`` whose numbers no printed line begins or ends with."""
    missing, lines = list[str](), printed.splitlines()
    for comment in (match[1] for line in program.splitlines() if (match := SAID.search(line))):
        said = NUMBER.findall(CLAUSE.split(comment)[0])
        found = [k for k, line in enumerate(lines) if said and _has(NUMBER.findall(line), said, share)]
        if found:
            lines = lines[found[0] :]
        elif said:
            missing.append(comment)
    return missing


def _has(printed: list[str], said: list[str], share: float) -> bool:
    """Return whether numbers are among the printed ones, side by side."""
    runs = (printed[k : k + len(said)] for k in range(len(printed) - len(said) + 1))
    return any(all(is_near(a, b, share) for a, b in zip(said, run, strict=True)) for run in runs)


def outputs(page: str) -> dict[str, str]:
    """Return a page's outputs by the last command, or the program, of the block before them."""
    said, before = dict[str, str](), ""
    for kind, text in BLOCK.findall(page):
        if kind == "text":
            said[before] = text
        elif kind == "python":
            before = text
        else:
            before = text.splitlines()[-1]
    return said
