"""The children of a tree's nodes, as a directed sampler has to remember them: it sees states alone."""

from __future__ import annotations

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from cbrrt_ompl.kernels import inner_kernel, kernel
from cbrrt_ompl.motion.records import Records, record_array
from cbrrt_ompl.ompl_plugin.native_memory import bits_of
from cbrrt_ompl.planners.extension import CHILD, NO_CHILD, UNTRIED

FIRST_CAPACITY = 64
"""Nodes and children that there is room for at first; doubled when full."""

EMPTY = -9
"""In place of a node's latest child where the table has no node."""

SLOTS_PER_NODE = 4
"""Size of the hash table for each node that there is room for; a power of two."""

PARENT = np.dtype(
    [
        *((name, np.float64) for name in ("x", "y", "theta", "v", "omega")),  # the node's state
        ("first_child", np.int32),  # its latest child, NO_CHILD or UNTRIED; EMPTY where there is no node
        ("unused", np.int32),
    ],
    align=True,
)
"""A slot of the hash table of nodes."""

COUNTS = np.dtype([("nodes", np.int64), ("children", np.int64)], align=True)
"""How many nodes and children there are."""

_HASH_FACTOR = 0x2545F4914F6CDD1D
"""Of xorshift64*."""


class Children:
    """Commands of the children of each node that was ever extended.

    Nodes are found by their state in a hash table with open addressing, so that compiled code can.

    Attributes:
        parents: the table, records of type `PARENT`.
        records: children, records of type :data:`cbrrt_ompl.planners.extension.CHILD`.
        counts: one record of type `COUNTS`.
    """

    def __init__(self) -> None:
        """No children yet."""
        self.counts = record_array(1, COUNTS)
        self.records: Records = record_array(FIRST_CAPACITY, CHILD)
        self.parents = _empty_table(FIRST_CAPACITY)

    def __len__(self) -> int:
        """Number of children."""
        return int(self.counts["children"][0])

    def make_room(self) -> bool:
        """Have room for one more node and one more child; whether the arrays are others now."""
        capacity = len(self.records)
        if max(self.counts[0].tolist()) < capacity:
            return False
        old_records, old_parents = self.records, self.parents
        self.records, self.parents = record_array(2 * capacity, CHILD), _empty_table(2 * capacity)
        self.records[:capacity] = old_records
        _move(old_parents, self.parents)
        return True

    def slot(self, node: NDArray[np.float64]) -> int:
        """Where a node of shape (5,) is; it is entered as `UNTRIED` if it was not there."""
        return int(_slot_of_values(node, self.parents, self.counts))

    def first_child(self, slot: int) -> int:
        """Latest child of the node in a slot, `NO_CHILD` or `UNTRIED`."""
        return int(self.parents["first_child"][slot])

    def note_trial(self, slot: int) -> None:
        """The node in a slot is no longer untried."""
        if self.parents["first_child"][slot] == UNTRIED:
            self.parents["first_child"][slot] = NO_CHILD

    def add(self, slot: int, v: float, omega: float) -> None:
        """Note the command of a new child of the node in a slot."""
        add_child(slot, v, omega, self.parents, self.records, self.counts)


def _empty_table(capacity: int) -> Records:
    table = record_array(SLOTS_PER_NODE * capacity, PARENT)
    table["first_child"] = EMPTY
    return table


def hash_of(node: tuple[float, ...]) -> int:
    """A number that spreads over the slots; in compiled code a quicker one."""
    return hash(node)


@overload(hash_of)
def _compiled_hash_of(node):  # type: ignore[no-untyped-def]  # numba compares signatures
    def mix(node):  # type: ignore[no-untyped-def]
        number = 0
        for value in node:
            number = (number ^ bits_of(value)) * _HASH_FACTOR
            number ^= number >> 29
        return number

    return mix


@inner_kernel
def find_slot(node: tuple[float, float, float, float, float], parents: Records) -> int:
    """The slot of a node, or the empty one that it would get."""
    mask = len(parents) - 1
    i = hash_of(node) & mask
    while True:
        slot = parents[i]
        if slot.first_child == EMPTY or (
            slot.x == node[0]
            and slot.y == node[1]
            and slot.theta == node[2]
            and slot.v == node[3]
            and slot.omega == node[4]
        ):
            return i
        i = (i + 1) & mask


@kernel
def slot_of_node(node: tuple[float, float, float, float, float], parents: Records, counts: Records) -> int:
    """The slot of a node, which is entered if it was not there."""
    i = find_slot(node, parents)
    slot = parents[i]
    if slot.first_child == EMPTY:
        slot.x, slot.y, slot.theta, slot.v, slot.omega = node
        slot.first_child = UNTRIED
        counts[0].nodes += 1
    return i


@kernel
def _slot_of_values(node: NDArray[np.float64], parents: Records, counts: Records) -> int:
    return slot_of_node((node[0], node[1], node[2], node[3], node[4]), parents, counts)


@kernel
def add_child(slot: int, v: float, omega: float, parents: Records, records: Records, counts: Records) -> None:
    """Enter a new child of the node in a slot."""
    number = counts[0].children
    child = records[number]
    child.v_command, child.omega_command = v, omega
    child.sibling = max(parents[slot].first_child, NO_CHILD)
    parents[slot].first_child = number
    counts[0].children = number + 1


@kernel
def _move(parents: Records, larger: Records) -> None:
    """Enter all nodes of one table into another."""
    for i in range(len(parents)):
        old = parents[i]
        if old.first_child != EMPTY:
            larger[find_slot((old.x, old.y, old.theta, old.v, old.omega), larger)] = old
