"""The one import of OMPL; :mod:`cbrrt_ompl.one_libompl` has seen to it before that libompl is loaded once only."""

from __future__ import annotations

from cbrrt_ompl.errors import OmplMissingError
from cbrrt_ompl.ompl_plugin.availability import has_ompl

if not has_ompl():
    raise OmplMissingError("cbrrt_ompl.ompl_plugin")

from ompl import base as ob
from ompl import control as oc
from ompl import geometric as og  # also registers the type that PathControl.asGeometric() returns
from ompl import tools as ot
from ompl import util as ou

__all__ = ["ob", "oc", "og", "ot", "ou"]
