"""Compare what the command line writes: with another commit, or with the manifest.

python -m tests.golden against COMMIT [--only TEXT] [--quick] [--fresh]
python -m tests.golden cost COMMIT
python -m tests.golden check
python -m tests.golden update
"""

from __future__ import annotations

import argparse
import sys
import time

from tests.golden.against import against
from tests.golden.case import ROOT
from tests.golden.cases import all_cases
from tests.golden.cost import compare_costs
from tests.golden.manifest import changed, write_manifest


def main() -> int:
    """Do what the command line says; 1 where something differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("action", choices=("against", "check", "cost", "update"))
    parser.add_argument("base", nargs="?", default="HEAD", help="commit to compare to")
    parser.add_argument("--only", default="", help="cases whose names contain this")
    parser.add_argument("--quick", action="store_true", help="the set of the tests")
    parser.add_argument("--fresh", action="store_true", help="run the base again")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    start = time.perf_counter()
    quick = given.quick or given.action != "against"
    cases = [c for c in all_cases() if given.only in c.name and (c.quick or not quick)]
    if given.action == "update":
        write_manifest(ROOT, given.workers)
        print(f"manifest.json: {len(cases)} cases")
        return 0
    if given.action == "check":
        found = changed(cases, ROOT, given.workers)
    elif given.action == "cost":
        found = compare_costs(given.base)
    else:
        found = against(given.base, cases, given.workers, given.fresh)
        if not (given.only or quick):
            found |= compare_costs(given.base)
    for name, lines in found.items():
        print(f"DIFFERS {name}", *(f"  {line}" for line in lines), sep="\n")
    seconds = time.perf_counter() - start
    print(f"{len(cases)} cases, {len(found)} differ ({seconds:.0f} s)")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
