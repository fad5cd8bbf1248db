"""Very many PTP containers that come to harm between driver and camera, over USB.

    python -m tests.acceptance.ptp_fuzz [--cases 100000] [--seed 1] [--way NAME [--session N]]

What must hold is in `tests/drivers/ptp/fuzz/sessions.py`; memory has a bound, too.
"""

import argparse
import resource
from collections import Counter
from time import perf_counter

from tests.drivers.ptp.fuzz.sessions import WAYS, Tally, session, sessions, template

MAX_MEMORY_BYTES = 2 << 30


def report(name: str, cases: int, seed: int) -> Tally:
    """Run one way, and print a few lines about it."""
    tally, began_s = Tally(), perf_counter()
    failures: Counter[str] = Counter()
    examples: dict[str, str] = {}
    for failure in filter(None, sessions(name, cases, seed, tally)):
        failures[template(failure)] += 1
        examples.setdefault(template(failure), failure)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{name:25} {tally.cases.total():7} cases, {failures.total()} failures, "
        f"{perf_counter() - began_s:.0f} s; longest session {tally.longest_s:.0f} s of lab time, "
        f"memory {peak_mb:.0f} MB"
    )
    print(f"   sessions: {_listed(tally.sessions)}; {tally.bulbs} photographs at bulb")
    print("   photograph afterwards, by attempt (0: gave up): " + _listed(tally.attempts))
    print("   harm:     " + _listed(tally.cases))
    print("   refused:  " + _listed(tally.refused))
    for kind, count in failures.most_common():
        print(f"   FAILED {count} times: {examples[kind]}")
    print(end="", flush=True)
    return tally


def _listed(counts: Counter[str] | Counter[int]) -> str:
    return ", ".join(f"{count} {what}" for what, count in counts.most_common())


def main() -> None:
    """Print a few lines a way, and what failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000, help="harmed containers each way")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--way", choices=WAYS)
    parser.add_argument("--session", type=int, help="only this one of that way, with its traceback")
    parser.add_argument("--texts", action="store_true", help="an example of each refusal")
    asked = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
    if asked.session is not None:
        session(asked.way, asked.seed, asked.session, Tally())
        return
    for name in [asked.way] if asked.way else WAYS:
        tally = report(name, asked.cases, asked.seed)
        if asked.texts:
            print(*(f"      {text}" for text in sorted(tally.texts.values())), sep="\n")


if __name__ == "__main__":
    main()
