"""Run campaigns one after the other: ``python -m tests.campaigns [--short] [NAME ...]``."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time

from tests.campaigns.campaign import NOT_RUN

SHORT_VARIABLE = "HANDCAL_SHORT_CAMPAIGNS"
PROGRAMS: dict[str, tuple[str, ...]] = {
    name: ("-m", f"tests.campaigns.{name}")
    for name in ("faults", "kills", "powercut", "damage", "files", "privacy", "cameras", "soak")
}
LINK = ("-m", "pytest", "-q", "-s", "-m", "campaign", "tests/campaigns/link")
TESTS: dict[str, tuple[str, ...]] = {"link": LINK}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="all within a minute")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PROGRAMS | TESTS))
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(PROGRAMS | TESTS):
        parser.error(f"no campaign {', '.join(sorted(unknown))}")
    start_s = time.monotonic()
    failed: list[str] = []
    not_run: list[str] = []
    environment = os.environ | ({SHORT_VARIABLE: "1"} if arguments.short else {})
    for name in arguments.names or [*PROGRAMS, *TESTS]:
        words = [sys.executable, *(PROGRAMS | TESTS)[name]]
        if arguments.short and name in PROGRAMS:
            words.append("--short")
        code = subprocess.run(words, env=environment, check=False).returncode
        if code == NOT_RUN:
            not_run.append(name)
        elif code:
            failed.append(name)
    load = os.getloadavg()[1] if hasattr(os, "getloadavg") else float("nan")
    seconds = time.monotonic() - start_s
    ended = f"failed: {', '.join(failed) or 'none'}; not run: {', '.join(not_run) or 'none'}"
    print(f"all campaigns: {seconds:.0f} s, load {load:.1f}; {ended}")  # noqa: T201
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
