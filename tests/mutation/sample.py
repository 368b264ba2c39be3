"""Score a room's tests on mutants drawn at random: how many of N changed lines does some test notice?

    python tests/mutation/sample.py ROOM [N] [SEED]         ROOM: a file of this folder, N: 24 by default

Run it in a checkout of its own: mutants are written into the package while their tests run. Prints every survivor as a
patch, and the share killed with its 95 % interval (Wilson).
"""

import random
import subprocess
import sys
import tempfile
from pathlib import Path

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome

HERE = Path(__file__).parent


def main(room: str, n: int = 24, seed: int = 0) -> str:
    """Draw, run, count."""
    config = HERE / f"{room}.toml"
    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "session.sqlite"
        subprocess.run(["cosmic-ray", "init", config, session], check=True, stdout=subprocess.DEVNULL)
        with use_db(str(session), WorkDB.Mode.open) as db:
            items = sorted(db.work_items, key=lambda item: str(item.mutations))
            drawn = random.Random(seed).sample(items, min(n, len(items)))
            db.clear()
            db.add_work_items(drawn)
        subprocess.run(["cosmic-ray", "exec", config, session], check=True)
        with use_db(str(session), WorkDB.Mode.open) as db:
            results = [result for _, result in db.results]
    survived = [r for r in results if r.test_outcome == TestOutcome.SURVIVED]
    for r in survived:
        print(r.diff)
    k, total, z = len(results) - len(survived), len(results), 1.96
    centre = (k / total + z**2 / (2 * total)) / (1 + z**2 / total)
    half = z / (1 + z**2 / total) * (k / total * (1 - k / total) / total + z**2 / (4 * total**2)) ** 0.5
    return f"{room}: {k} of {total} drawn of {len(items)} killed, {centre - half:.0%} to {centre + half:.0%}"


if __name__ == "__main__":
    print(main(sys.argv[1], *map(int, sys.argv[2:])))
