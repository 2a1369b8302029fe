"""Robots that many of these tests share."""

from collections.abc import Callable
from typing import Any

import pytest

from remembered import remembered


@pytest.fixture(scope="session")
def batch_of(batch_of: Callable[..., Any]) -> Callable[..., Any]:
    """As for all tests; a robot that was asked for before is not read again."""
    return remembered(batch_of)
