"""Where measurements of other people are.

Tests take these folders from the fixtures `real_data` and `shared_data`; the programs in
`tests/acceptance` and what they share with tests take them from here.
"""

from pathlib import Path

#: In the repository: data whose licence allows it. Its README.md says what is there.
REAL = Path(__file__).parent / "data"
#: Beside the repository, if at all: data that may be used and not be copied.
SHARED = Path(__file__).parents[2] / "shared" / "data"
