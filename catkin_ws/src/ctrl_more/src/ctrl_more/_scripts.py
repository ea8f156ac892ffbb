"""Finds the class of a list file's `type: module:Class`, and checks it before a manager loads it."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from pathlib import Path
from types import ModuleType

from ctrl_more._core import INTERFACE, FeedbackController, Refused

METHODS = {"describe": 0, "initialize": 1, "update": 4}  # arguments after self
_from_files: dict[Path, tuple[int, ModuleType]] = {}  # by file: its time of change and its module


def find_class(type_name: str, folder: str) -> type[FeedbackController]:
    """Return the class of `module:Class`; the module is looked for in `folder`, then on sys.path.

    Raises Refused with one sentence if it is missing or cannot be a controller.
    """
    module_name, _, class_name = type_name.partition(":")
    if not all(part.isidentifier() for part in [*module_name.split("."), class_name]):
        raise Refused(f"type '{type_name}': expected my_module:MyController")
    module = _module(module_name, Path(folder or "."), f"type '{type_name}'")
    found = getattr(module, class_name, None)
    if found is None:
        names = [n for n, v in vars(module).items() if inspect.isclass(v) and issubclass(v, FeedbackController)]
        raise Refused(f"type '{type_name}': {module.__file__} has no class {class_name}; its controllers: {names}")
    judge(found, type_name)
    return found


def controllers_of(file: Path) -> list[str]:
    """Return the names of the controllers that a Python file defines. Raises Refused if it cannot be imported."""
    module = _module(file.stem, file.parent, str(file))
    return [
        name
        for name, value in vars(module).items()
        if inspect.isclass(value) and issubclass(value, FeedbackController) and value.__module__ == module.__name__
    ]


def judge(found: object, name: str) -> None:
    """Raise Refused unless `found` is a class that can be a controller."""
    if not inspect.isclass(found) or not issubclass(found, FeedbackController):
        raise Refused(f"type '{name}' is not a class derived from ctrl_more.FeedbackController")
    if found.interface != INTERFACE:
        raise Refused(
            f"type '{name}' was written for interface {found.interface} of ctrl_more, but this is {INTERFACE}: "
            "compare it with the documentation, then change its number"
        )
    for method, count in METHODS.items():
        function = getattr(found, method)
        if function is getattr(FeedbackController, method):
            raise Refused(f"type '{name}' has no method {method}()")
        try:
            inspect.signature(function).bind(None, *range(count))
        except TypeError as error:
            expected = {0: "self", 1: "self, setup", 4: "self, cycle, robot, original, modified"}[count]
            raise Refused(f"type '{name}': expected {method}({expected}): {error}") from None
        except ValueError:  # compiled, without a signature
            pass


def make(type_name: str, folder: str) -> FeedbackController:
    """Make a controller of the type `module:Class`."""
    return find_class(type_name, folder)()


def _module(name: str, folder: Path, what: str) -> ModuleType:
    try:
        return _import(name, folder)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError) and f"{name}.".startswith(f"{error.name}."):
            raise Refused(f"{what}: there is no module '{error.name}' in {folder}, nor on sys.path") from None
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f" ({Path(last.filename).name}:{last.lineno})" if last.lineno else ""
        raise Refused(f"{what}: the module was not imported: {type(error).__name__}: {error}{place}") from error


def _import(name: str, folder: Path) -> ModuleType:
    file = folder.joinpath(*name.split(".")).with_suffix(".py").resolve()
    if not file.is_file():
        return importlib.import_module(name)
    changed = file.stat().st_mtime_ns
    known = _from_files.get(file)
    if known and known[0] == changed:
        return known[1]
    # Modules of the same name in two folders are two modules.
    unique = f"_ctrl_more_controllers.{abs(hash(file)):x}.{name}"
    spec = importlib.util.spec_from_file_location(unique, file)
    if spec is None or spec.loader is None:
        raise ImportError(f"{file} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[unique] = module
    sys.path.insert(0, str(folder.resolve()))  # for modules beside it
    try:
        # Not from a cached file: a file that changes twice in a second has the same time there.
        exec(compile(file.read_bytes(), str(file), "exec"), module.__dict__)
    except BaseException:
        del sys.modules[unique]
        raise
    finally:
        sys.path.remove(str(folder.resolve()))
    _from_files[file] = (changed, module)
    return module
