"""Errors, memory, parameters and steps: what every object of the package shares."""

from __future__ import annotations

import dataclasses
import html
import math
import os
import threading
from collections.abc import Mapping
from typing import Any, Callable, NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._cairn import ffi, lib

Float64 = NDArray[np.float64]
Float32 = NDArray[np.float32]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
UInt8 = NDArray[np.uint8]
Bool = NDArray[np.bool_]
PathLike = Union[str, "os.PathLike[str]"]

# Structs of parameters that are given as x, y or x, y, theta.
VECTORS = ("cairn_vec2", "cairn_pose", "sim_pose", "sim_point")
# Greatest seed of the random numbers.
MAX_SEED = 2**63 - 1
# Budget that no single call uses up.
UNBOUNDED = 2**31 - 1
# Work units of one call of a step: some hundredths of a second. Between two calls Python handles
# signals.
BUDGET_UNITS = 1_000_000


class CairnError(Exception):
    """A call that was refused or failed.

    Attributes
    ----------
    status : int
        The status of the C library, negative.
    file : str or None
        The file that is wrong.
    line : int or None
        Line of the file, from 1; of a bag the number of the message.
    index : int or None
        Index of the element of an array that is wrong.
    """

    status = 0

    def __init__(
        self,
        text: str,
        *,
        file: str | None = None,
        line: int | None = None,
        index: int | None = None,
    ) -> None:
        super().__init__(text)
        self.file = file
        self.line = line
        self.index = index


class BadArgumentError(CairnError, ValueError):
    """A value is outside the range that the documentation states."""

    status = -1


class ParameterError(BadArgumentError):
    """A parameter of an object is out of range.

    Attributes
    ----------
    module : str
        Module of the C library whose parameter it is, such as ``"mapper"``.
    field : str or None
        Name of the parameter; None when a rule between parameters does not hold.
    value, lowest, highest : float
        The value and its range; 0 without a field.
    rule : str
        What was expected.
    """

    def __init__(
        self,
        text: str,
        module: str,
        field: str | None,
        value: float,
        lowest: float,
        highest: float,
        rule: str,
    ) -> None:
        super().__init__(text)
        self.module = module
        self.field = field
        self.value = value
        self.lowest = lowest
        self.highest = highest
        self.rule = rule


class NotFiniteError(CairnError, ValueError):
    """An input is NaN or infinite."""

    status = -2


class NoMemoryError(CairnError, MemoryError):
    """There is no memory for an object."""

    status = -3


class FullError(CairnError):
    """A capacity, a parameter ``max_...``, is used up."""

    status = -4


class EmptyError(CairnError, ValueError):
    """There is no input or no result to work on."""

    status = -5


class BadFormatError(CairnError, ValueError):
    """A file does not follow its format."""

    status = -6


class TruncatedError(BadFormatError):
    """A file ends too early."""

    status = -7


class UnsupportedError(CairnError, NotImplementedError):
    """The request is valid, but this build does not support it."""

    status = -8


class FileError(CairnError, OSError):
    """The operating system failed to read or write."""

    status = -9


class BuildError(CairnError, RuntimeError):
    """The C library was compiled with options that change results."""

    status = -10


class BusyError(CairnError, RuntimeError):
    """The last input is still being worked on."""

    status = -11


ERRORS: dict[int, type[CairnError]] = {
    e.status: e
    for e in (
        BadArgumentError,
        NotFiniteError,
        NoMemoryError,
        FullError,
        EmptyError,
        BadFormatError,
        TruncatedError,
        UnsupportedError,
        FileError,
        BuildError,
        BusyError,
    )
}


def text(pointer: Any) -> str:
    """Returns a C string; "" for NULL."""
    return "" if pointer == ffi.NULL else ffi.string(pointer).decode("utf-8", "replace")


def error_of(
    status: int,
    what: str = "",
    *,
    fault: Any = None,
    file: str | None = None,
    line: int | None = None,
) -> CairnError:
    """Returns the exception of a status.

    Parameters
    ----------
    status
        A negative status.
    what
        What was being done, the beginning of the message.
    fault
        A ``cairn_fault`` that the call has filled in.
    file, line
        Place of the input in its file.
    """
    message, index = text(lib.cairn_status_text(status)), None
    if fault is not None and fault.message != ffi.NULL:
        message, index = text(fault.message), int(fault.index)
        if index >= 0:
            message += f" (index {index})"
        else:
            index = None
    place = "" if file is None else file if line is None else f"{file}:{line}"
    parts = [part for part in (place, what, message) if part]
    return ERRORS.get(status, CairnError)(": ".join(parts), file=file, line=line, index=index)


def check(status: int, what: str = "", **place: Any) -> int:
    """Returns a status that is no error, and raises the exception of one that is.

    What a handler of signals has raised during the call is raised first.
    """
    check_interruption()
    if status < 0:
        raise error_of(status, what, **place)
    return status


class _Interruption(threading.local):
    """What a handler of signals has raised during a call into C of this thread."""

    error: BaseException | None = None


_interruption = _Interruption()


def _keep(_kind: Any, error: BaseException, _trace: Any) -> None:
    _interruption.error = error


@ffi.def_extern(error=1, onerror=_keep)  # type: ignore[untyped-decorator]
def cairn2d_handle_signals() -> int:
    """Returns 1 when a long call into C is to end; handlers of signals run when it is entered."""
    return int(_interruption.error is not None)


lib.cairn2d_watch_signals()


def check_interruption() -> None:
    """Raises what a handler of signals has raised during a call into C."""
    error, _interruption.error = _interruption.error, None
    if error is not None:
        raise error


def check_file(status: int, error: Any, file: str | None = None) -> None:
    """Raises the exception of a file error, or of a handler of signals."""
    check_interruption()
    if status < 0:
        line = int(error.line)
        raise ERRORS.get(status, CairnError)(text(error.text), file=file, line=line or None)


def path_of(path: PathLike) -> bytes:
    """Returns a path as C takes it."""
    return os.fsencode(os.fspath(path))


def new_fault() -> Any:
    """Returns an empty ``cairn_fault *``."""
    return ffi.new("cairn_fault *", {"index": -1})


# ---- Parameters ----


def set_fields(struct: Any, values: Mapping[str, Any], where: str = "") -> None:
    """Sets the fields of a C struct of parameters; nested structs take mappings.

    Raises
    ------
    TypeError
        There is no such field, or its value has another type.
    """
    fields = dict(ffi.typeof(struct).item.fields)
    for name, value in values.items():
        if name not in fields:
            known = ", ".join(sorted(fields))
            raise TypeError(f"there is no parameter {where}{name}; expected one of {known}")
        kind = fields[name].type
        if kind.kind == "struct" and kind.cname.split()[-1] in VECTORS:
            setattr(struct, name, tuple(float(v) for v in value))
        elif kind.kind == "struct":
            if not isinstance(value, Mapping):
                raise TypeError(
                    f"parameter {where}{name} is a group, expected a dict of its fields"
                )
            set_fields(ffi.addressof(struct, name), value, f"{where}{name}.")
        else:
            try:
                setattr(struct, name, value)
            except OverflowError as error:
                raise BadArgumentError(f"parameter {where}{name} is {value!r}: {error}") from None
            except TypeError as error:
                raise TypeError(f"parameter {where}{name} is {value!r}: {error}") from None


def get_fields(struct: Any) -> dict[str, Any]:
    """Returns the fields of a C struct as plain values; nested structs as dicts."""
    out: dict[str, Any] = {}
    for name, field in ffi.typeof(struct).fields:
        value = getattr(struct, name)
        if field.type.kind == "struct":
            out[name] = get_fields(value)
        elif field.type.kind == "array":
            out[name] = np.array(list(value))
        elif field.type.kind == "primitive":
            out[name] = value
    return out


def checked(module: str, params: Any) -> None:
    """Raises a `ParameterError` when the module refuses its params."""
    fault = ffi.new("cairn_object_fault *")
    if getattr(lib, f"cairn_{module}_check")(params, fault) == 0:
        return
    field, rule, owner = text(fault.field), text(fault.rule), text(fault.module)
    value, lowest, highest = float(fault.value), float(fault.lowest), float(fault.highest)
    if field:
        message = f"{owner}: {field} is {value:.9g}, expected {lowest:.9g} to {highest:.9g}"
        if rule:
            message += f" ({rule})"
    else:
        message = f"{owner}: {rule}"
    raise ParameterError(message, owner, field or None, value, lowest, highest, rule)


def new_params(module: str, values: Mapping[str, Any], start: Any = None) -> Any:
    """Returns the default params of a module with some fields set, checked."""
    params = ffi.new(f"cairn_{module}_params *")
    params[0] = getattr(lib, f"cairn_{module}_default")() if start is None else start
    set_fields(params, values)
    checked(module, params)
    return params


def check_number(
    name: str, value: float, lowest: float, highest: float = math.inf, *, above: bool = False
) -> None:
    """Raises a `BadArgumentError` for a number outside a range, or NaN.

    Parameters
    ----------
    name
        Name of the parameter.
    value
        Its value.
    lowest, highest
        The range.
    above
        The lowest value itself is outside, too.
    """
    if lowest <= value <= highest and not (above and value == lowest):
        return
    least = f"above {lowest:.9g}" if above else f"at least {lowest:.9g}"
    expected = least if math.isinf(highest) else f"{lowest:.9g} to {highest:.9g}"
    raise BadArgumentError(f"{name} is {value!r}, expected {expected}")


# ---- Objects in pools ----


class Pool:
    """Memory of objects of the C library, freed with them."""

    def __init__(self, bytes_: int) -> None:
        self.bytes = max(int(bytes_), lib.CAIRN_ALIGN) + lib.CAIRN_ALIGN
        try:
            self.memory = np.empty(self.bytes, np.uint8)
        except MemoryError:
            raise NoMemoryError(f"no memory for a pool of {self.bytes} bytes") from None
        self.pool = ffi.new("cairn_pool *")
        check(lib.cairn_pool_init(self.pool, ffi.from_buffer(self.memory), self.bytes))


def create(module: str, params: Any, kind: str = "") -> tuple[Any, Pool]:
    """Creates an object of a module in a pool of its own; both must be kept.

    Parameters
    ----------
    module
        Name of the module.
    params
        Its parameters.
    kind
        Type of the object without its prefix, where it is not the module's name.
    """
    pool = Pool(getattr(lib, f"cairn_{module}_memory")(params))
    made = ffi.new(f"cairn_{kind or module} **")
    check(getattr(lib, f"cairn_{module}_create")(made, pool.pool, params), module)
    return made[0], pool


def run(step: Callable[[Any], int], what: str = "") -> None:
    """Calls a step until its work is done. Signals are handled between the calls."""
    budget = ffi.new("cairn_budget *")
    while True:
        budget.left = BUDGET_UNITS
        if check(step(budget), what) != lib.CAIRN_MORE:
            return


# ---- Arrays ----


class Memory:
    """Memory of the C library as an array: numpy keeps this object, and so the owner, alive."""

    def __init__(self, pointer: Any, shape: tuple[int, ...], kind: str, owner: Any) -> None:
        self.owner = owner
        address = int(ffi.cast("uintptr_t", pointer))
        self.__array_interface__ = {
            "data": (address, False),
            "shape": shape,
            "typestr": kind,
            "version": 3,
        }


def view(pointer: Any, shape: tuple[int, ...], kind: str, owner: Any) -> NDArray[Any]:
    """Returns C memory as an array without a copy; `owner` lives as long as the array."""
    if pointer == ffi.NULL or 0 in shape:
        return np.empty(shape, kind)
    return np.asarray(Memory(pointer, shape, kind, owner))


def copy_of(pointer: Any, shape: tuple[int, ...], kind: str) -> NDArray[Any]:
    """Returns a copy of C memory."""
    return view(pointer, shape, kind, None).copy()


def array(
    values: ArrayLike, kind: Any, shape: tuple[int | None, ...], name: str, hint: str = ""
) -> NDArray[Any]:
    """Returns values as a contiguous array of a shape, in which None is any length.

    Raises
    ------
    BadArgumentError
        The shape is another one, or an integer type does not hold the values; `hint` says more.
    """
    given = np.asarray(values)
    if given.ndim != len(shape) or any(
        n is not None and n != m for n, m in zip(shape, given.shape)
    ):
        expected = ", ".join("n" if n is None else str(n) for n in shape)
        raise BadArgumentError(f"{name} has the shape {given.shape}, expected ({expected})")
    if not np.issubdtype(kind, np.integer):
        return np.ascontiguousarray(given, kind)
    with np.errstate(invalid="ignore"):
        out = np.ascontiguousarray(given.astype(kind))
    if not np.array_equal(out, given):
        least, most = np.iinfo(kind).min, np.iinfo(kind).max
        raise BadArgumentError(
            f"{name} has values that are no whole numbers from {least} to {most}{hint}"
        )
    return out


def pointer(values: NDArray[Any], kind: str) -> Any:
    """Returns the memory of a contiguous array as a pointer `kind`; the array must be kept."""
    if values.size == 0:
        return ffi.NULL
    return ffi.cast(kind, ffi.from_buffer(values))


# ---- Values ----


class Pose(NamedTuple):
    """A pose in the plane: position in m, heading in rad."""

    x: float
    y: float
    theta: float

    def __matmul__(self, other: Pose) -> Pose:
        """Composes two poses: ``map_robot @ robot_sensor``."""
        return pose_of(lib.cairn_pose_compose(tuple(self), tuple(other)))

    def inverse(self) -> Pose:
        """Returns the inverse transform."""
        return pose_of(lib.cairn_pose_inverse(tuple(self)))


def pose_of(pose: Any) -> Pose:
    """Returns a ``cairn_pose`` as a `Pose`."""
    return Pose(pose.x, pose.y, pose.theta)


def pose_in(pose: ArrayLike, name: str = "pose") -> tuple[float, float, float]:
    """Returns x, y, theta as C takes them."""
    values = np.asarray(pose, np.float64)
    if values.shape != (3,):
        raise BadArgumentError(f"{name} has the shape {values.shape}, expected (3,)")
    return float(values[0]), float(values[1]), float(values[2])


def plain(value: Any) -> Any:
    """Returns a value of lists, dicts, numbers and texts alone."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {k: plain(v) for k, v in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


class Result:
    """A result: a dataclass that can be shown and turned into plain values."""

    def to_dict(self) -> dict[str, Any]:
        """Returns the fields as lists, dicts, numbers and texts."""
        fields = [f for f in dataclasses.fields(self) if f.repr]  # type: ignore[arg-type]
        return {f.name: plain(getattr(self, f.name)) for f in fields}

    def __init_subclass__(cls) -> None:
        # A dataclass makes no representation of its own where there is one.
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Result.__repr__  # type: ignore[method-assign]

    def _shown(self) -> list[tuple[str, str]]:
        """Returns name and text of each field; of long arrays and lists their size."""
        rows = []
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            if not field.repr:
                continue
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray) and value.size > 9:
                shown = f"array {value.shape} {value.dtype}"
            elif isinstance(value, (list, tuple)) and (
                len(value) > 9 or any(isinstance(item, Result) for item in value)
            ):
                shown = f"{len(value)} items"
            elif isinstance(value, np.ndarray):
                shown = np.array2string(value, precision=4)
            else:
                shown = str(value)
            rows.append((field.name, shown))
        return rows

    def __repr__(self) -> str:
        """Returns the fields, one a line."""
        rows = [f"{name}: {shown}" for name, shown in self._shown()]
        return (
            "\n  ".join([f"{type(self).__name__}(", *(r.replace("\n", "\n  ") for r in rows)])
            + "\n)"
        )

    def _repr_html_(self) -> str:
        """Returns a table of the fields, for notebooks."""
        rows = [
            f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
            f"<td style='text-align:left'>{html.escape(shown)}</td></tr>"
            for name, shown in self._shown()
        ]
        return f"<table><caption>{type(self).__name__}</caption>{''.join(rows)}</table>"


def frame(columns: Mapping[str, Any]) -> Any:
    """Returns a pandas data frame.

    Raises
    ------
    ImportError
        pandas is not installed.
    """
    import pandas  # type: ignore[import-untyped, unused-ignore]

    return pandas.DataFrame(dict(columns))
