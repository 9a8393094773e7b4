"""Look into a wheel of fclib-collection as fclib does where it is installed.

python scripts/check_collection.py WHEEL
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path

from fclib.collections import published, trajectory

LIMIT = 60e6  # bytes; the core sets have a limit of their own in test_trajectory.py


def main() -> int:
    """Unpack the wheel where Python looks for packages, and read every file of it."""
    (wheel,) = map(Path, sys.argv[1:])
    there = published.root()
    assert there is not None
    with tempfile.TemporaryDirectory() as site:
        zipfile.ZipFile(wheel).extractall(site)
        sys.path.insert(0, site)
        published.IN_PLACE = Path(site) / "none"
        found = published.root()
        assert found is not None
        assert found.is_relative_to(site), found
        names = sorted(path.relative_to(found) for path in found.rglob(f"*{trajectory.SUFFIX}"))
        own = sorted(path.relative_to(there) for path in there.rglob(f"*{trajectory.SUFFIX}"))
        assert names == own, f"{wheel} has {names}, not {own}"
        problems = sum(len(trajectory.read(found / name)) for name in names)
    size = wheel.stat().st_size
    assert size < LIMIT, f"{wheel}: {size / 1e6:.1f} MB"
    print(f"{wheel.name}: {len(names)} trajectories, {problems} problems, {size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
