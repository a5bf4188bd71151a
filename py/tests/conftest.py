"""What several tests need."""

import sys

import pytest

import netpose_rs as npr


def noted(name: str) -> str:
    """Pattern for the error of a number or object of a wrong type: a note names the argument, which Python has from 3.11 on."""
    return name if sys.version_info >= (3, 11) else ""


@pytest.fixture(scope="session")
def plain() -> npr.sim.SimFrame:
    """A light flat net of 50 mm mesh that fills the view, 1.2 m away."""
    return npr.sim.render("plain")
