"""Control laws by name: what the Kanayama law is to CB-RRT, a user's own law is under its own name.

A law is a function of the error posture, the limits and the gains that gives a command. Kernels call it by its address,
which the model holds, so that a new law needs no new kernels: a compiled one costs a call, a Python one a microsecond.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import inspect
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, config, njit, types
from numba.core import cgutils
from numba.core.errors import NumbaError
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from cbrrt_ompl.errors import InputError, Problem, SettingsError
from cbrrt_ompl.motion.posq import posq
from cbrrt_ompl.problem.robot import Gains, Limits

LawFunction = Callable[[tuple[float, float, float], Any, Any], tuple[float, float]]
"""Takes (x_e, y_e, theta_e), limits and gains, gives (v, omega)."""

KANAYAMA = "kanayama"
"""Name of the paper's law, which kernels have within them."""

LIMITS = np.dtype([(name, np.float64) for name in Limits._fields], align=True)
"""The fields of :class:`cbrrt_ompl.problem.robot.Limits`."""

GAINS = np.dtype([(name, np.float64) for name in Gains._fields], align=True)
"""The fields of :class:`cbrrt_ompl.problem.robot.Gains`."""

_intrinsic: Any = intrinsic  # its types take no account of the typing context that it hands over
_ADDRESS, _REAL = ir.IntType(64), ir.DoubleType()
_C_LAW = ctypes.CFUNCTYPE(None, *[ctypes.c_double] * 3, *[ctypes.c_int64] * 3)
_LAW_SIGNATURE = types.void(*[types.float64] * 3, *[types.int64] * 3)


@dataclass
class Law:
    """A registered law."""

    name: str
    function: LawFunction
    is_compiled: bool
    """Whether it is compiled code, and not Python that kernels call back."""
    address: int
    """Of its function for kernels."""
    keep: Any = field(repr=False)
    """What must live as long as the address is used."""
    errors: list[BaseException] = field(default_factory=list, repr=False)
    """What a Python law has raised and nobody has seen yet."""
    failure: NDArray[np.float64] = field(default_factory=lambda: np.zeros(4), repr=False)
    """A 1 and the error posture at which a compiled law has failed last, shape (4,)."""

    def raise_errors(self) -> None:
        """Raise what went wrong since the last time, if anything."""
        if self.errors:
            error = self.errors[0]
            self.errors.clear()
            raise error
        if self.failure[0]:
            self.failure[0] = 0.0
            posture = tuple(self.failure[1:].tolist())
            command = getattr(self.function, "py_func", self.function)(posture, Limits(), Gains())  # raises it again
            raise ArithmeticError(
                f"law {self.name!r} gave no finite command at {posture}, or {command} by default limits"
            )


SHIPPED_LAWS: dict[str, LawFunction] = {
    "posq": posq,
}
"""Laws that come with the package; compiled when they are first asked for, which takes most of a second."""

_laws: dict[str, Law] = {}


def register_law(name: str, function: LawFunction) -> None:
    """Make a control law known under a name, for ``planning.law`` of a scenario.

    It takes the place of the Kanayama law in `cb-rrt` and its compiled kinds: in OMPL, in the compiled planners, in
    replays and in benchmarks, whose worker processes import it from its module. Under a name that is known already, the
    new law replaces the old one in set-ups and plans made from now on::

        def pure_pursuit(error, limits, gains):
            x_e, y_e, theta_e = error
            return limits.v_max, 2.0 * limits.v_max * y_e / max(x_e * x_e + y_e * y_e, 1e-9)

        register_law("pure pursuit", pure_pursuit)

    Args:
        name: one line of text.
        function: ``function(error, limits, gains)`` gives the command (v, omega) [m/s, rad/s]; ``error`` is the pose
            (x_e, y_e, theta_e) of the reference in the robot's frame, theta_e in [-pi, pi) [m, m, rad], ``limits`` and
            ``gains`` have the fields of `Limits` and `Gains`. The command is clamped to the limits afterwards. It is
            compiled by numba where numba can, and stays Python elsewhere.

    Raises:
        InputError: if the name is none, or is the Kanayama law's, or the function gives no command.
    """
    if not (isinstance(name, str) and name.strip() and "\n" not in name) or name == KANAYAMA:
        raise InputError(Problem("name", name, f"one line of text other than {KANAYAMA!r}"))
    if not callable(function):
        raise InputError(Problem("function", function, "a function of an error posture, limits and gains"))
    _check_command(function)
    failure = np.zeros(4)
    compiled = _compiled(function, failure)
    if compiled is not None:
        _laws[name] = Law(name, function, True, compiled.address, (compiled, failure), failure=failure)
        return
    law = Law(name, function, False, 0, None)
    law.keep = _called_back(law)
    law.address = ctypes.cast(law.keep, ctypes.c_void_p).value or 0
    _laws[name] = law


def known_laws() -> list[str]:
    """Names of all laws, sorted."""
    return sorted({KANAYAMA, *SHIPPED_LAWS, *_laws})


def law_named(name: str) -> Law | None:
    """A registered law; None for the Kanayama law.

    Raises:
        SettingsError: if there is none of this name.
    """
    if name == KANAYAMA:
        return None
    if name not in _laws and name in SHIPPED_LAWS:
        register_law(name, SHIPPED_LAWS[name])
    if name not in _laws:
        raise SettingsError(Problem("planning.law", name, f"one of {', '.join(known_laws())}"))
    return _laws[name]


def law_address(name: str) -> int:
    """Address of a law's function for kernels; 0 for the Kanayama law.

    Raises:
        SettingsError: if there is none of this name.
    """
    law = law_named(name)
    return 0 if law is None else law.address


def is_compiled_law(name: str) -> bool:
    """Whether a law is compiled code.

    Raises:
        SettingsError: if there is none of this name.
    """
    law = law_named(name)
    return law is None or law.is_compiled


def raise_errors() -> None:
    """Raise what a law has raised since the last time, if anything: kernels cannot."""
    for law in _laws.values():
        law.raise_errors()


# from process to process


def law_origin(name: str) -> dict[str, str] | None:
    """Where another process finds a law: module, file and name in it; None for the laws that come with the package.

    Raises:
        InputError: if the function is none of a module's own.
    """
    law = law_named(name)
    if law is None or law.function.__module__.startswith("cbrrt_ompl."):
        return None
    function = inspect.unwrap(getattr(law.function, "py_func", law.function))
    file = inspect.getsourcefile(function)
    if file is None or "<" in function.__qualname__:
        expected = "a function at the top of a module, which worker processes can import"
        raise InputError(Problem(f"law {name!r}", function.__qualname__, expected))
    return {"name": name, "module": function.__module__, "file": file, "function": function.__qualname__}


def register_origin(origin: dict[str, str]) -> None:
    """Register a law of another process, see :func:`law_origin`."""
    if origin["module"] == "__main__":
        spec = importlib.util.spec_from_file_location("__cbrrt_law__", origin["file"])
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module
        spec.loader.exec_module(module)
    else:
        module = importlib.import_module(origin["module"])
    register_law(origin["name"], getattr(module, origin["function"]))


# into the kernels


def _check_command(function: LawFunction) -> None:
    """Call a law once, in Python."""
    plain = getattr(function, "py_func", function)
    command: Any = plain((1.0, 0.2, 0.1), Limits(), Gains())
    try:
        v, omega = (float(number) for number in command)
    except (TypeError, ValueError):
        v = omega = math.nan
    if not (math.isfinite(v) and math.isfinite(omega)):
        raise InputError(Problem("function", command, "a command (v, omega) of two finite numbers for (1, 0.2, 0.1)"))


def _compiled(function: LawFunction, failure: NDArray[np.float64]) -> Any:
    """The law as a C function; None where numba cannot compile it.

    Args:
        function: the law.
        failure: takes a 1 and the error posture where it raised an exception or gave no finite command, shape (4,).
    """
    if getattr(config, "DISABLE_JIT", False):
        return None
    law = function if hasattr(function, "py_func") else njit(function)
    failure_address = failure.ctypes.data

    @njit
    def call_safely(x: float, y: float, theta: float, limits: Any, gains: Any, out: Any) -> None:
        out[0] = out[1] = math.nan
        try:
            v, omega = law((x, y, theta), limits, gains)
            out[0], out[1] = v, omega
        except Exception:  # a C function cannot raise; raise_errors does
            out[0] = math.nan

    def call(x: float, y: float, theta: float, limits: int, gains: int, command: int) -> None:
        out = carray(_pointer(command), 2, np.float64)
        limits_record, gains_record = carray(_pointer(limits), 1, LIMITS)[0], carray(_pointer(gains), 1, GAINS)[0]
        call_safely(x, y, theta, limits_record, gains_record, out)
        if not math.isfinite(out[0] + out[1]):
            out[0] = out[1] = 0.0
            failed = carray(_pointer(failure_address), 4, np.float64)
            failed[0], failed[1], failed[2], failed[3] = 1.0, x, y, theta

    try:
        return cfunc(_LAW_SIGNATURE)(call)
    except NumbaError:
        return None


def _called_back(law: Law) -> Any:
    """A law in Python as a C function; what it raises is kept for :func:`raise_errors`, and the robot stops."""

    def call(x: float, y: float, theta: float, limits: int, gains: int, command: int) -> None:
        out = (ctypes.c_double * 2).from_address(command)
        try:
            found = law.function((x, y, theta), _tuple_at(limits, Limits), _tuple_at(gains, Gains))
            out[0], out[1] = _finite(law.name, found)
        except BaseException as error:  # a C function cannot raise; raise_errors does
            law.errors.append(error)
            out[0] = out[1] = 0.0

    return _C_LAW(call)


def _finite(name: str, command: Any) -> tuple[float, float]:
    v, omega = (float(number) for number in command)
    if not (math.isfinite(v) and math.isfinite(omega)):
        raise ArithmeticError(f"law {name!r} gave no finite command but {command}")
    return v, omega


def _tuple_at(address: int, kind: Any) -> Any:
    return kind(*(ctypes.c_double * len(kind._fields)).from_address(address))


def law_command(address: int, error: tuple[float, float, float], limits: Any, gains: Any) -> tuple[float, float]:
    """The command of the law at an address, for kernels: records of limits and gains."""
    law = next(law for law in _laws.values() if law.address == address)
    return law.function(error, limits, gains)


@_intrinsic
def _pointer(_: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return types.voidptr(types.int64), generate


def _in_memory(builder: Any, record: Any) -> Any:
    """Where a record stands; a named tuple of as many numbers is put where one can stand."""
    if isinstance(record.type, ir.PointerType):
        return record
    return cgutils.alloca_once_value(builder, record)


@_intrinsic
def _call_law(_: Any, address: Any, x: Any, y: Any, theta: Any, limits: Any, gains: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        command = cgutils.alloca_once(builder, ir.ArrayType(_REAL, 2))
        kind = ir.FunctionType(ir.VoidType(), [_REAL] * 3 + [_ADDRESS] * 3)
        records = [builder.ptrtoint(_in_memory(builder, record), _ADDRESS) for record in (*args[4:6], command)]
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), [*args[1:4], *records])
        numbers = [builder.load(cgutils.gep_inbounds(builder, command, 0, i)) for i in range(2)]
        return context.make_tuple(builder, signature.return_type, numbers)

    return types.UniTuple(types.float64, 2)(types.int64, *[types.float64] * 3, limits, gains), generate


@overload(law_command)
def _compiled_law_command(address, error, limits, gains):  # type: ignore[no-untyped-def]  # numba compares signatures
    def command(address, error, limits, gains):  # type: ignore[no-untyped-def]
        return _call_law(address, error[0], error[1], error[2], limits, gains)

    return command
