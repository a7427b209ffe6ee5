"""The readable kernel against what can be worked out by hand."""

import numpy as np
import pytest

from monochord.physics.split_string.reference import leapfrog


def test_a_driven_node_moves_by_its_load_times_the_signal() -> None:
    now, before = np.zeros(5), np.zeros(5)
    load = np.array([[0.0, 0.0, 3.0, 0.0, 9.0]])
    heard = np.zeros((1, 1))
    leapfrog(now, before, (1.0, 0.5, -1.0), load, np.array([[0.5]]), np.array([1]), np.array([0.5]), heard)
    assert before.tolist() == [0.0, 0.0, 1.5, 0.0, 0.0]  # the ends are fixed, whatever pushes them
    assert heard.item() == 0.75  # half of node 1 and half of node 2


def test_a_standing_wave_of_the_grid_turns_by_the_scheme_s_own_frequency() -> None:
    courant, nodes, steps = 0.8, 17, 40
    shape = np.sin(np.pi * np.arange(nodes) / (nodes - 1))
    shape[-1] = 0.0
    turn = 2.0 * np.arcsin(courant * np.sin(np.pi / (nodes - 1) / 2.0))
    now, before = shape.copy(), shape * np.cos(turn)
    coefficients = (2.0 - 2.0 * courant**2, courant**2, -1.0)
    silent, heard = np.zeros((1, steps)), np.zeros((1, steps))
    leapfrog(now, before, coefficients, np.zeros((1, nodes)), silent, np.array([8]), np.zeros(1), heard)
    assert now == pytest.approx(shape * np.cos(turn * steps), abs=1e-13)
