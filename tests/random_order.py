"""A pytest plugin: the tests in a random order, and of them one of two random halves.

``pytest -p tests.random_order --order-seed 7`` shuffles; ``--half 1`` or ``--half 2`` keeps a half, so that
the two together are a random split over two processes.
"""

from __future__ import annotations

import random

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """--order-seed and --half."""
    parser.addoption("--order-seed", type=int, default=0, help="of the order of the tests")
    parser.addoption("--half", type=int, choices=(1, 2), help="run this half of the tests alone")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Shuffle, after marks have deselected theirs."""
    random.Random(config.getoption("order_seed")).shuffle(items)
    half = config.getoption("half")
    if half:
        left_out = items[2 - half :: 2]
        items[:] = items[half - 1 :: 2]
        config.hook.pytest_deselected(items=left_out)
