from pathlib import Path

import pytest

from tests.docs.examples import make_examples


@pytest.fixture(scope="session")
def made_examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the examples; what one of them writes, others may find."""
    folder = tmp_path_factory.mktemp("examples")
    make_examples(folder)
    return folder


@pytest.fixture
def examples(made_examples: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the examples, as the working directory."""
    monkeypatch.chdir(made_examples)
    return made_examples
