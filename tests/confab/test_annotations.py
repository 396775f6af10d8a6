"""The public annotations of `confab` contain no `Any`: all public names are checked, and all classes in their annotations."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import confab

ROOT = Path(confab.__file__).parent


@cache
def module(name: str) -> dict[str, ast.AST]:
    """Return the syntax nodes of the names that a module of Confab defines or imports.

    An imported name has the node of its import.
    """
    path = ROOT.joinpath(*name.split(".")[1:])
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    if not name.startswith("confab") or not path.is_file():
        return {}
    found: dict[str, ast.AST] = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            found |= {alias.asname or alias.name: node for alias in node.names}
        elif isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AnnAssign | ast.Assign):
            for target in node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", node)]:
                found.setdefault(getattr(target, "id", getattr(target, "name", "")), node)
    return found


def home(name: str, where: str) -> tuple[str, ast.AST] | None:
    """Return the module that defines a name which another module uses, and the definition."""
    node = module(where).get(name)
    if isinstance(node, ast.ImportFrom):
        return home(next(a.name for a in node.names if name in (a.asname, a.name)), node.module or "")
    return None if node is None else (where, node)


def annotated(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the public names in a definition, each with its annotation, and the bases of a class."""
    match node:
        case ast.FunctionDef(name=name, args=args, returns=returns):
            for each in (*args.posonlyargs, *args.args, *args.kwonlyargs, args.vararg, args.kwarg):
                if each is not None and each.annotation is not None:
                    yield f"{name}({each.arg})", each.annotation
            if returns is not None:
                yield name, returns
        case ast.ClassDef(name=name, bases=bases, body=body):
            yield from ((name, base) for base in bases)
            for inner in body:
                if not getattr(inner, "name", "x").startswith("_"):
                    yield from ((f"{name}.{what}", note) for what, note in annotated(inner))
        case ast.AnnAssign(target=ast.Name(id=name), annotation=note, value=value) if not name.startswith("_"):
            yield name, note
            if "TypeAlias" in ast.unparse(note) and value is not None:
                yield name, value


def anys() -> tuple[list[str], set[str]]:
    """Return the public annotations that contain `Any`, and all names that were checked."""
    waiting = [(name, "confab") for name in confab.__all__]
    seen: set[tuple[str, str]] = set()
    found: list[str] = []
    while waiting:
        where = home(*waiting.pop())
        if where is None or (where[0], str(getattr(where[1], "name", id(where[1])))) in seen:
            continue
        seen.add((where[0], str(getattr(where[1], "name", id(where[1])))))
        for what, note in annotated(where[1]):
            words = {node.id for node in ast.walk(note) if isinstance(node, ast.Name)}
            quoted = [node.value for node in ast.walk(note) if isinstance(node, ast.Constant)]
            words |= {word for word in quoted if isinstance(word, str) and word.isidentifier()}
            found += [f"{where[0]}: {what}"] if "Any" in words else []
            waiting += [(word, where[0]) for word in words]
    return found, {name for _, name in seen}


def test_no_public_annotation_contains_any() -> None:
    found, seen = anys()
    assert {"Plan", "Outcome", "Rollout", "Episode", "Problem"} <= seen
    assert found == []
