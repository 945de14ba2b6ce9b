"""The one import of OMPL.

The wheel of OMPL 1.7.0 brings libompl twice: the modules link the copy in ``ompl.libs``, and ``ompl.dll_loader`` loads
another one from site-packages for all to see. A process with both frees some globals twice at its end and dies by a
signal (exit code 134 or 139). Without the second copy, the modules find their own, and all is well.
"""

from __future__ import annotations

import sys

from cbrrt_ompl.errors import OmplMissingError
from cbrrt_ompl.ompl_plugin.availability import has_ompl

if not has_ompl():
    raise OmplMissingError("cbrrt_ompl.ompl_plugin")

import ompl

if sys.platform == "linux" and "ompl.base" not in sys.modules:
    ompl.dll_loader = lambda *_: None

from ompl import base as ob
from ompl import control as oc
from ompl import tools as ot
from ompl import util as ou

__all__ = ["ob", "oc", "ot", "ou"]
