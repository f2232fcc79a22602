"""All benchmarks, or those named: ``python -m bench [cell pulses ...]``."""

import sys
from importlib import import_module
from pathlib import Path
from typing import cast

from bench.rows import Row, print_table


def main(names: list[str]) -> None:
    """Run the benchmarks named, all of them without a name; each is a module here with `rows()`."""
    found = sorted(path.stem for path in Path(__file__).parent.glob("*.py"))
    known = [name for name in found if name not in ("__init__", "__main__", "rows")]
    unknown = [name for name in names if name not in known]
    if unknown:
        sys.exit(f"no benchmark {unknown[0]!r}; there are: {', '.join(known)}")
    for name in names or known:
        print(f"\n{name}")
        print_table(cast("list[Row]", import_module(f"bench.{name}").rows()))


if __name__ == "__main__":
    main(sys.argv[1:])
