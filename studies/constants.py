"""The numbers set by hand in the perception package, and what changes in it, file by file.

Prints a table in a second: ``python -m studies.constants``.
"""

import ast
import json
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import click
from studies._command import lines_of, main

import monochord as mc

COUNTS = ("constants", "numbers", "changing", "caches", "states")
WRITES = {"append", "add", "update", "setdefault", "pop", "popitem", "clear", "extend", "insert"}
"""Methods that change a container."""


def counts_of(text: str) -> Counter[str]:
    """Return the counts of a module's source.

    `constants` are the upper-case module names assigned literals, `numbers` the numbers in them; arithmetic
    of literals, containers and NumPy calls of literals count as literals. `changing` are module globals that
    a function assigns, and containers that it writes to; `caches` are functions with a cache; `states` are
    classes named ``...State``.

    >>> counts_of("RANGE: Metres = (0.1, 2 * 0.3); LIMIT = RANGE[0]")
    Counter({'numbers': 3, 'constants': 1})
    """
    module, result = ast.parse(text), Counter[str]()
    names: set[str] = set()
    for node in module.body:
        for name, value in _assigned(node):
            names.add(name)
            numbers = _numbers(value) if name.isupper() else 0
            result.update({"constants": 1, "numbers": numbers} if numbers else {})
    changed: set[str] = set()
    for node in ast.walk(module):
        match node:
            case ast.Global(names=own):
                changed.update(own)
            case ast.Subscript(value=ast.Name(id=name), ctx=ast.Store() | ast.Del()):
                changed.add(name)
            case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr=method)) if method in WRITES:
                changed.add(name)
            case ast.ClassDef(name=name) if name.endswith("State"):
                result["states"] += 1
            case ast.FunctionDef(decorator_list=ways) if any(map(_is_cache, ways)):
                result["caches"] += 1
            case _:
                pass
    return result + Counter(changing=len(changed & names))


def _assigned(node: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    """Yield the names that a statement assigns, with their values."""
    match node:
        case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
            yield name, value
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            yield name, value
        case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)):
            yield from ((n.id, v) for n, v in zip(names, values, strict=False) if isinstance(n, ast.Name))
        case _:
            return


def _numbers(node: ast.AST) -> int:
    """Return how many numbers a literal holds, 0 for another expression; a table's keys do not count."""
    match node:
        case ast.Constant(value=value):
            return int(isinstance(value, (int, float)) and not isinstance(value, bool))
        case ast.UnaryOp(operand=inner):
            return _numbers(inner)
        case ast.BinOp(left=left, right=right):
            one, other = _numbers(left), _numbers(right)
            return one + other if one and other else 0
        case (
            ast.Tuple(elts=parts)
            | ast.List(elts=parts)
            | ast.Set(elts=parts)
            | ast.Dict(values=parts)
            | ast.Call(func=ast.Attribute(value=ast.Name(id="np")), args=parts)
            | ast.Call(func=ast.Name(id="MappingProxyType" | "frozenset"), args=parts)
        ):
            return sum(map(_numbers, parts))
        case _:
            return 0


def _is_cache(decorator: ast.expr) -> bool:
    return ast.unparse(decorator).partition("(")[0].rpartition(".")[2] in {"cache", "lru_cache"}


def _numbers_of_toml(value: object) -> int:
    if isinstance(value, dict):
        return sum(map(_numbers_of_toml, value.values()))
    if isinstance(value, list):
        return sum(map(_numbers_of_toml, value))
    return int(isinstance(value, (int, float)) and not isinstance(value, bool))


def table(folder: Path) -> dict[str, Counter[str]]:
    """Return the counts of each file of a folder that has any."""
    modules = {file: counts_of(file.read_text(encoding="utf-8")) for file in folder.rglob("*.py")}
    tables = {
        file: Counter(numbers=_numbers_of_toml(tomllib.loads(file.read_text(encoding="utf-8"))))
        for file in folder.rglob("*.toml")
    }
    every = {str(file.relative_to(folder)): counts for file, counts in (modules | tables).items()}
    return {name: every[name] for name in sorted(every) if every[name].total()}


@click.command(name="constants", help=__doc__)
@click.option("--package", default="perception", show_default=True, help="Package inside monochord.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(package: str, as_json: bool) -> None:  # noqa: FBT001
    """Print the table of a package."""
    counted = table(Path(mc.__file__).parent / package)
    counted["total"] = sum(counted.values(), Counter[str]())
    if as_json:
        print(json.dumps(counted, indent=1))
    else:
        rows = [(name, *(str(row[each]) for each in COUNTS)) for name, row in counted.items()]
        print(*lines_of(("file", *COUNTS), rows), sep="\n")


if __name__ == "__main__":
    main(command)
