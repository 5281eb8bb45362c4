"""The accuracy model: effects, their sum, what it predicts and how surely."""

from __future__ import annotations
