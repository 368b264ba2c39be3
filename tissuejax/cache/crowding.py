"""A process holds so many compiled programs and no more: each takes memory maps, and Linux allows 65,530 of them.

Beyond that the compiler ends with "Cannot allocate memory" and the process with it, gigabytes free or not: a hundred
and thirty diagnoses in one process came there.
"""

from pathlib import Path

from tissuejax.cache.programs import forget_programs

MAPS, ALLOWED = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")
SHARE = 0.5  # of the maps that are allowed: from there on programs are dropped


def crowding() -> float:
    """The share of the memory maps that this process has taken of those it may have; 0 where nobody counts them."""
    try:
        with MAPS.open("rb") as file:
            return sum(1 for _ in file) / int(ALLOWED.read_text())
    except (OSError, ValueError):
        return 0.0


def make_room(share: float = SHARE) -> bool:
    """Drop this process's compiled programs if they crowd it, and say whether that was done.

    What is asked for again is compiled again, or read from the disk (`keep_programs`).
    """
    if crowding() < share:
        return False
    forget_programs()
    return True
