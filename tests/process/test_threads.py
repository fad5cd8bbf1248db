"""Fits compute in one thread, whatever a notebook has set."""

from pathlib import Path
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from labrig.process import process_run
from labrig.protocols.decay import analysis
from tests.analyse.recorded import recorded, shipped_rig
from tests.conftest import SHORT_DECAY


def blas_threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_an_analysis_computes_in_one_thread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meanwhile: list[set[int]] = []
    analyse = analysis.analyse

    def watched(part: Any) -> Any:
        meanwhile.append(blas_threads())
        return analyse(part)

    monkeypatch.setattr(analysis, "analyse", watched)
    with threadpool_limits(limits=2, user_api="blas"):
        process_run(recorded(tmp_path, SHORT_DECAY, shipped_rig("sim")))
        assert 2 in blas_threads()
    assert meanwhile == [{1}]
