"""What the site needs besides Markdown: docstrings name their neighbours by Sphinx's roles, which Markdown lacks."""

import re

ROLE = re.compile(r":(?:attr|class|data|exc|func|meth|mod):(?=<code>)")


def on_page_content(html: str, **_: object) -> str:
    """Leave the roles out."""
    return ROLE.sub("", html)
