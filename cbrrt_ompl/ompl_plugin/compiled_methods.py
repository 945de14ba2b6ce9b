"""The switch of the compiled methods behind OMPL's virtual calls, and what happens where they cannot be used.

They are used unless somebody says otherwise, by an argument or by ``CBRRT_OMPL_COMPILED_METHODS=0`` in the environment,
numba is switched off, or this build of OMPL fails the check before their first use in a process.
The Python methods then do the same, slower.
"""

from __future__ import annotations

import logging
import os
import threading
from functools import cache

from numba import config

VARIABLE = "CBRRT_OMPL_COMPILED_METHODS"
"""Variable of the environment that switches them off."""

OFF = ("0", "off", "false", "no")
"""Its values that do so."""

_checking = threading.local()  # the check itself makes objects with compiled methods, before it is known that they work

_log = logging.getLogger(__name__)


def use_compiled_methods(wanted: bool | None = None) -> bool:
    """Whether objects made from now on have compiled methods.

    Args:
        wanted: what the caller says; None leaves it to the environment.
    """
    if wanted is None:
        wanted = os.environ.get(VARIABLE, "").strip().lower() not in OFF
    wanted = wanted and not vars(config)["DISABLE_JIT"]
    return wanted and (getattr(_checking, "is_on", False) or compiled_methods_work())


@cache
def compiled_methods_work() -> bool:
    """Whether this build of OMPL is what the compiled methods are made for: looked at once a process."""
    from cbrrt_ompl.ompl_plugin.self_check import check_compiled_methods  # here, since it checks what asks us

    _checking.is_on = True
    try:
        check_compiled_methods()
    except Exception as error:  # whatever it is, the Python methods work
        reason = " ".join(str(error).split()) or type(error).__name__
        _log.warning("OMPL calls our Python methods, which are slower than the compiled ones: %s", reason)
        return False
    finally:
        _checking.is_on = False
    return True
