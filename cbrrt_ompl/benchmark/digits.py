"""Numbers as reports tell them."""

from __future__ import annotations

import math


def three_digits(value: float, missing: str = "-") -> str:
    """Three significant digits, thousands with commas.

    Args:
        value: any number.
        missing: what stands for NaN.
    """
    if not math.isfinite(value):
        return missing if math.isnan(value) else "∞"
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{digits}f}" if abs(value) < 1000.0 else f"{float(f'{value:.3g}'):,.0f}"
