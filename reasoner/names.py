"""Short names for IRIs: the last part of the IRI if it is unique in the scene, otherwise preceded by the ontology's name."""

from __future__ import annotations

from abc import ABCMeta
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import MISSING, fields
from difflib import get_close_matches
from fractions import Fraction
from functools import wraps
from importlib import import_module
from inspect import getattr_static, signature
from numbers import Integral, Real
from os import PathLike
from types import FunctionType
from typing import TYPE_CHECKING, NoReturn, ParamSpec, TypeVar

from confab.reasoner.limits import Deadline, checked, within

C = TypeVar("C", bound=type)
P = ParamSpec("P")
R = TypeVar("R")
V = TypeVar("V")


class Names:
    """A one-to-one mapping of IRIs and short names; `more` has names that are given.

    >>> names = Names(["https://x.org/a#cup1", "https://x.org/b#cup1", "https://x.org/a#plate"])
    >>> names.short("https://x.org/a#plate"), names.short("https://x.org/b#cup1")
    ('plate', 'b:cup1')
    >>> names.iri("a:cup1")
    'https://x.org/a#cup1'
    """

    def __init__(self, iris: Iterable[str], more: Mapping[str, str] = {}) -> None:
        by_local = defaultdict(list)
        for iri in checked(set(iris), "reading the scene"):
            by_local[local_name(iri)].append(iri)
        self._iris: dict[str, str] = {}
        for local, group in checked(by_local.items(), "reading the scene"):
            for iri in sorted(group):
                name = local if len(group) == 1 else f"{_ontology_name(iri)}:{local}"
                self._iris[name if name not in self._iris else iri] = iri
        self._iris |= more
        self._names = {iri: name for name, iri in self._iris.items()}

    def short(self, iri: str) -> str:
        """Return the short name of an IRI; for an unknown IRI, return its last part."""
        return self._names.get(iri) or local_name(iri)

    def iri(self, name: str) -> str:
        """Return the IRI of a short name; raise `KeyError` for an unknown name."""
        return self._iris[name]

    @property
    def iris(self) -> Collection[str]:
        """The IRIs with short names."""
        return self._names.keys()

    def __repr__(self) -> str:
        """Return the number of names."""
        return f"Names of {len(self._iris)} terms"

    def agree(self, other: Names) -> bool:
        """Return whether every IRI has the same short name in another mapping."""
        return all(other._names.get(iri) == name for iri, name in self._names.items())

    def __contains__(self, name: object) -> bool:
        """Return whether a short name is known."""
        return name in self._iris


class Named(dict[str, V]):
    """A mapping that can't be edited. For a missing name, the mapping raises a `KeyError` that suggests the most similar name."""

    def __init__(self, kind: str, content: Mapping[str, V] | Iterable[tuple[str, V]], hint: str = "") -> None:
        super().__init__(content)
        self.kind, self.hint = kind, hint

    def __missing__(self, name: object) -> NoReturn:
        """Raise `KeyError` with the most similar name."""
        raise KeyError(f"no {self.kind} '{name}'{nearest(str(name), self)}" + (f"; {self.hint}" if self.hint else ""))

    def __getattr__(self, name: str) -> NoReturn:
        """Raise `AttributeError`; if the attribute is a key of the mapping, the message shows the right notation."""
        hint = f"; use [{name!r}]" if name in self else ""
        raise AttributeError(f"a mapping of names has no attribute {name!r}{hint}")

    if not TYPE_CHECKING:

        def _edited(self, *_: object, **__: object) -> NoReturn:
            raise TypeError(f"this mapping of each {self.kind} is a copy, so that a change of it has no effect")

        __setitem__ = __delitem__ = __ior__ = update = setdefault = pop = popitem = clear = _edited

    def __reduce__(self) -> tuple[type[dict[str, V]], tuple[dict[str, V]]]:
        """Return the reduced form for copying and pickling: a plain dictionary."""
        return dict, (dict(self),)


def local_name(iri: str) -> str:
    """Return the part of an IRI after its last ``#``, ``/`` or ``:``."""
    iri = iri.rstrip("#/:")
    return iri[max(iri.rfind("#"), iri.rfind("/"), iri.rfind(":")) + 1 :]


SHORT = 4
"""Maximum length of short words, for which a similarity of 0.6 suffices in place of 0.75, since an exchange of two letters reduces
the similarity more."""


def nearest(word: str, known: Iterable[str], hint: str = "") -> str:
    """Return ``; did you mean 'x'?`` with the most similar known word; if no word is similar, return the hint."""
    candidates = sorted(set(known))
    folded = {name.lower(): name for name in candidates}
    cutoff = 0.75 if len(word) > SHORT else 0.6
    near = get_close_matches(word, candidates, n=1, cutoff=0.8) or [
        folded[name] for name in get_close_matches(word.lower(), folded, n=1, cutoff=cutoff)
    ]
    return f"; did you mean '{near[0]}'?" if near else (f"; {hint}" if hint else "")


def _ontology_name(iri: str) -> str:
    return local_name(iri.partition("#")[0] if "#" in iri else iri.rpartition("/")[0])


GUESSING: list[str] = []
"""Names of modules that suggest the right name for a wrong name, by functions `hint`, `chosen` and `needless`; `confab` adds one
module."""


class RightNames(ABCMeta):
    """Metaclass of classes with `right_names`.

    If a user reads an unknown attribute of the class, the error suggests the call that creates an object.
    """

    if not TYPE_CHECKING:  # type checkers report wrong names by themselves

        def __getattr__(cls, name: str) -> NoReturn:
            """Raise `WrongNameError` with the name that was probably meant."""
            if name.startswith("_"):
                raise AttributeError(f"type object '{cls.__name__}' has no attribute '{name}'")
            raise WrongNameError(f"the class of {cls._kind}", name, cls)


MADE: dict[str, str] = {}
"""What an object of a class with `right_names` is, and the call that creates it, by the name of the class."""
TYPES: Mapping[str, tuple[type, str]] = {
    "int": (Integral, "a whole number"),
    "float": (Real, "a number"),
    "str": (str, "a text"),
    "Path": (PathLike, "a path"),
    "None": (type(None), ""),
}
"""The types in annotations that `mismatch` compares with arguments, each with its words."""


def mismatch(name: str, annotation: str, given: object) -> str:
    """Return as text that the type of an argument isn't in an annotation; return an empty text if it is, or if this is unknown.

    >>> mismatch("rounds", "int", "x"), mismatch("rounds", "int", 2), mismatch("goals", "Facts", 5)
    ("got rounds='x'; wanted a whole number", '', '')
    """
    parts = annotation.split(" | ")
    classes = {each.__name__ for each in type(given).__mro__}
    if not {*parts} <= {*TYPES, *MADE} or any(
        isinstance(given, TYPES[part][0]) if part in TYPES else part in classes for part in parts
    ):
        return ""
    wanted = " or ".join(filter(None, (TYPES[part][1] if part in TYPES else MADE[part] for part in parts)))
    use = f", e.g. confab.load({given!r})" if isinstance(given, str) and "confab.load(SCENE)" in wanted else ""
    shown = repr(given) if isinstance(given, str | int | float) else type(given).__name__
    return f"got {name}={shown}; wanted {wanted}{use}"


def right_names(kind: str, made: str = "") -> Callable[[C], C]:
    """Return a class decorator that adds the correct name to errors for unknown attributes and arguments.

    Parameters
    ----------
    kind : str
        Description of the object, e.g. ``a scene``.
    made : str, optional
        The call that creates such an object; if the constructor is called without arguments, the error mentions this call.
    """

    def decorated(cls: C) -> C:
        known_as(kind)(cls)

        def settable(self: object, name: str, value: object) -> None:
            place = getattr_static(cls, name, None)
            unknown = (
                place is None and not name.startswith("_") and name not in getattr(cls, "__dataclass_fields__", ())
            )
            if unknown or (isinstance(place, property) and place.fset is None):
                raise WrongNameError(kind, name, type(self), "set")
            object.__setattr__(self, name, value)

        if getattr_static(cls, "__setattr__") is object.__setattr__:  # the class isn't frozen
            type.__setattr__(cls, "__setattr__", settable)
        if made:
            begin: Callable[..., None] = getattr(cls, "__init__")  # noqa: B009 - type checkers mistrust it of a class

            @wraps(begin)
            def made_by(self: object, *given: object, **named: object) -> None:
                try:
                    signature(begin).bind(self, *given, **named)
                except TypeError as error:
                    raise TypeError(f"{kind} isn't made like this ({error}); use {made}") from error
                begin(self, *given, **named)

            type.__setattr__(cls, "__init__", made_by)
            MADE.setdefault(cls.__name__, f"{kind}: {made}")
        for name in dir(cls):
            found = getattr_static(cls, name)
            function = found.__func__ if isinstance(found, classmethod) else found
            own = isinstance(function, FunctionType) and function.__module__.startswith("confab.")
            if own and not name.startswith("_"):
                checked_one = right_arguments(function, bound=1)
                setattr(cls, name, classmethod(checked_one) if isinstance(found, classmethod) else checked_one)
        return cls

    return decorated


def known_as(kind: str) -> Callable[[C], C]:
    """Return a class decorator that adds the correct name to errors for unknown attributes of a value.

    In contrast to `right_names`, this decorator doesn't slow down the methods and the construction of the class.
    """

    def decorated(cls: C) -> C:
        def lacking(self: object, name: str) -> NoReturn:
            raise WrongNameError(kind, name, type(self))

        def without_items(self: object, index: object) -> NoReturn:
            """Raise `TypeError`; Python also calls this method for an iteration, and for the operator ``in``."""
            raise TypeError(f"{kind} has no items{_hint(kind, 'items', public_names(self))}")

        type.__setattr__(cls, "_kind", kind)
        type.__setattr__(cls, "__getattr__", lacking)  # hidden from type checkers, which report wrong names
        if not any(hasattr(cls, each) for each in ("__getitem__", "__iter__")):
            type.__setattr__(cls, "__getitem__", without_items)
        return cls

    return decorated


LONG = 60
"""Maximum length of a field in the representation of a value by `brief`."""


def brief(cls: C) -> C:
    """Let the values of a dataclass be represented in one line.

    Long collections are represented by their length; empty fields and fields with default values are left out.
    """

    def represented(self: object) -> str:
        told = []
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            many = len(value) if isinstance(value, Collection) and not isinstance(value, str) else None
            if (
                not field.repr
                or many == 0
                or value is None
                or (field.default is not MISSING and value == field.default)
            ):
                continue
            text = "" if many is not None and many > LONG else repr(value).split("\n")[0].rstrip(":")
            if isinstance(value, float | Fraction):
                text = f"{float(value):.3g}"
            if text and len(text) <= LONG:
                told.append(f"{field.name}={text}")
            else:
                told.append(f"{field.name}={type(value).__name__}(…)" if many is None else f"{field.name}: {many}")
        return f"{type(self).__name__}({', '.join(told)})"

    type.__setattr__(cls, "__repr__", represented)
    return cls


def right_arguments(function: Callable[P, R], bound: int = 0) -> Callable[P, R]:
    """Return a function whose errors for unknown, missing and wrong arguments state the arguments that it takes.

    The error for an unknown argument suggests an argument. If the function fails because of the type of an argument, the error
    states the wanted type. The argument ``time_limit`` limits the time of the whole call, including its imports and checks.

    Parameters
    ----------
    function : callable
        For ``**options: Unpack[module.Options]``, the keys of the typed dictionary count as arguments, too.
    bound : int
        Number of leading parameters that aren't named in a call: 1 for a method.
    """
    parameters = [*signature(function).parameters.values()][bound:]
    own = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
    further = next((str(each.annotation) for each in parameters if each.kind is each.VAR_KEYWORD), "")
    if further and not further.startswith("Unpack["):
        return function
    several = [f"*{each.name}" for each in parameters if each.kind is each.VAR_POSITIONAL]
    names = [each.name for each in parameters]
    needed = [each.name for each in parameters if each.name in own and each.default is each.empty]
    shown = ", ".join([*needed, *several, *(f"{each}=" for each in own if each not in needed)])
    most = None if several else sum(each.kind is each.POSITIONAL_OR_KEYWORD for each in parameters)

    @wraps(function)
    def checked(*given: P.args, **named: P.kwargs) -> R:
        takes = own if named.keys() <= {*own} else [*own, *_keys(further, function.__module__)]
        for name in named:
            if name not in takes:
                meant = next((import_module(each).chosen(name, takes) for each in GUESSING), "")
                why = next((import_module(each).needless(name, takes) for each in GUESSING), "")
                all_of_them = ", ".join((*several, *takes)) or "no arguments"
                use = f": {(function.__doc__ or '').split(chr(10))[0]}" if several and not takes else ""
                hint = f"did you mean '{meant}'?" if meant else why or f"it takes {all_of_them}{use}"
                raise TypeError(f"{function.__name__}() takes no '{name}'; {hint}")
        if most is not None and len(given) > bound + most:
            named_only = ", ".join(f"{each}=" for each in own[most:])
            raise TypeError(
                f"{function.__name__}() takes {', '.join(own[:most]) or 'nothing'} without a name; "
                f"got {len(given) - bound} values{f' (by name: {named_only})' if named_only else ''}"
            )
        least = len(given) - bound
        missing = (
            [each for at, each in enumerate(names) if each in needed and at >= least and each not in named]
            if least < len(needed)
            else ()
        )
        if missing:
            summary = (function.__doc__ or "").split(chr(10))[0]
            raise TypeError(
                f"{function.__name__}() lacks {', '.join(missing)}; wanted {function.__name__}({shown}): {summary}"
            )
        try:
            return function(*given, **named)
        except (TypeError, AttributeError) as error:
            pairs = {**dict(zip(names, given[bound:], strict=False)), **named}
            told = (mismatch(one.name, str(one.annotation), pairs[one.name]) for one in parameters if one.name in pairs)
            if why := next(filter(None, told), ""):
                raise TypeError(f"{function.__name__}() {why}") from error
            raise

    @wraps(function)
    def limited(*given: P.args, **named: P.kwargs) -> R:
        limit = named.get("time_limit")
        if isinstance(limit, Deadline) or (isinstance(limit, int | float) and limit > 0):
            with within(limit):
                return checked(*given, **named)
        return checked(*given, **named)

    return limited if further or "time_limit" in own else checked


def _keys(unpacked: str, module: str) -> Iterable[str]:
    """Return the keys of the typed dictionary in an annotation ``Unpack[module.Options]``; no keys for an empty text."""
    if not unpacked:
        return ()
    home, _, name = unpacked.removeprefix("Unpack[").removesuffix("]").rpartition(".")
    keys: Mapping[str, object] = getattr(import_module(f"confab.{home}" if home else module), name).__annotations__
    return keys


def public_names(there: object) -> list[str]:
    """Return the sorted public names of an object, or of a class with its fields."""
    return sorted(
        each for each in {*dir(there), *getattr(there, "__dataclass_fields__", ())} if not each.startswith("_")
    )


def _hint(kind: str, name: str, known: Collection[str] = ()) -> str:
    """Return the end of the error about a wrong name: what the user probably means, or what the object has."""
    return next((import_module(each).hint(kind, name, known) for each in GUESSING), nearest(name, known))


class WrongNameError(AttributeError):
    """Raised for an unknown attribute; the message suggests the name with the same meaning, or the most similar name.

    The message is created only when a caller reads the message, because libraries often test whether objects have attributes.

    Parameters
    ----------
    kind : str
        Description of the object, e.g. ``a scene``.
    name : str
    there : object
        The object or its class, whose public names are determined by `dir`.
    verb : str
        The empty text if an attribute was read, ``set`` if an attribute was set.
    """

    def __init__(self, kind: str, name: str, there: object, verb: str = "") -> None:
        super().__init__(f"{kind} has no '{name}'")
        self._wrong, self._there, self._verb = (kind, name), there, verb

    def __str__(self) -> str:
        """Return the message with the suggested name."""
        (kind, name), there = self._wrong, self._there
        text = f"{kind} has no '{name}'" + (f" that can be {self._verb}" if self._verb else "")
        if name.startswith("_"):
            return text
        return text + _hint(kind, "_".join(filter(None, (self._verb, name))), public_names(there))

    def __reduce__(self) -> tuple[type[AttributeError], tuple[str]]:
        """Return the reduced form for copying and pickling: an `AttributeError` with the message."""
        return AttributeError, (str(self),)
