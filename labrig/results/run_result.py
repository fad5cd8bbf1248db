"""Result of a run's analysis or a chain's: a frozen type per protocol, and its `result.json`."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, reduce
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import ConfigDict, PlainSerializer, PlainValidator, TypeAdapter, ValidationError

from labrig.foundation.errors import DataError, LabrigError, UsageError
from labrig.foundation.input_file import MAX_JSON_BYTES, read_text
from labrig.foundation.notebook_views import CsvTable, NotebookViews
from labrig.foundation.output_file import make_folder_in, write_text
from labrig.foundation.plugins import measurement
from labrig.foundation.result_warning import ResultWarning, as_warnings
from labrig.results.text_files import finite, write_csv

if TYPE_CHECKING:
    from labrig.results.budget import Budget

FILE = "result.json"


@dataclass(frozen=True, eq=False, kw_only=True)
class RunResult(NotebookViews):
    """Result of one protocol's analysis.

    A result holds numbers, with units in the names of its fields or in a `Measured`; arrays are
    `FloatArray`, `BoolArray` or `IntArray`. It contains everything that a report shows, an export
    writes or a notebook computes with. A protocol's own type is a frozen dataclass derived from
    this one, named by the measurement's registration.

    Attributes
    ----------
    kind
        Name of the protocol, as it is registered.
    schema_version
        Version of the type's fields: another number means renamed fields or other meanings.
    warnings
        Limits of the result and remedies. A package may give plain texts.
    """

    kind: ClassVar[str]
    schema_version: ClassVar[int] = 1
    #: Run folder to which the result belongs, and its part of a chain's run; set by `of_run`.
    run_folder: ClassVar[Path | None] = None
    run_part: ClassVar[str] = ""
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(
        arbitrary_types_allowed=True, extra="forbid", ser_json_inf_nan="strings"
    )

    warnings: tuple[ResultWarning, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "warnings", as_warnings(self.warnings))

    def provides(self) -> Mapping[str, Any]:
        """Return values for later parts of a chain, by the name of a field of their `Inputs`."""
        return {}

    def budgets(self) -> "Mapping[str, Budget]":
        """Return how far each headline value may be trusted, by its name; none of some protocols.

        They are in `result.json` under `budgets`, and in every report.
        """
        return {}

    def failures(self) -> tuple[str, ...]:
        """Return the reasons why there is no result at all, a line each; none if there is one."""
        return ()

    def write_files(self, folder: Path) -> None:
        """Write the files for later runs and other programs into a folder, such as a material file.

        Those of `csv_tables` are written beside them.

        Raises
        ------
        DiskError
            A file cannot be written.
        """

    def of_run(self, folder: Path, part: str = "") -> Self:
        """Note the run folder to which the result belongs, and its part of a chain's run.

        A notebook shows it by the frames and the protocol that are there, and fits it anew.
        """
        object.__setattr__(self, "run_folder", Path(folder).absolute())
        object.__setattr__(self, "run_part", part)
        return self

    def refit(self, **options: Any) -> Self:
        """Return the result with other options of its measurement; nothing is written.

        The regions, excluded frames and calibrations are those of this result.

        Parameters
        ----------
        options
            Options of `labrig process` for this measurement, such as `states` and `law` of a decay,
            `order` of excitation, `method` of fluorescence under LEDs.

        Raises
        ------
        UsageError
            The result belongs to no run folder, or the measurement has no such option.
        FitError
            Nothing can be fitted.
        """
        refitted: Self = resolve_name("labrig.process:refit")(self, options)
        return refitted

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `result.json`, in which infinity and NaN are texts."""
        own_type: Any = type(self)
        fields = _adapter(own_type).dump_python(self, mode="json")
        content: dict[str, Any] = finite(
            {
                "kind": self.kind,
                "schema_version": self.schema_version,
                "budgets": {name: budget.to_dict() for name, budget in self.budgets().items()},
            }
            | fields,
            _nonfinite_text,
        )
        return content

    def to_json(self) -> str:
        """Return the text of `result.json`, one field of the result a line."""
        lines = [
            f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False, allow_nan=False)}"
            for key, value in self.to_dict().items()
        ]
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Construct the result whose `to_dict` is `content`.

        Raises
        ------
        ValueError
            The content is that of another protocol or version, or of no result at all.
        """
        fields = dict(content)
        kind, version = fields.pop("kind", None), fields.pop("schema_version", None)
        # They follow from the other fields.
        fields.pop("budgets", None)
        if (kind, version) != (cls.kind, cls.schema_version):
            raise ValueError(
                f"a result of '{kind}', version {version}, not of '{cls.kind}', version "
                f"{cls.schema_version}"
            )
        own_type: Any = cls
        read: Self = _adapter(own_type).validate_python(fields)
        return read


def in_folders(tables: Mapping[str, Mapping[str, CsvTable]]) -> dict[str, CsvTable]:
    """Return the tables of several patches or parts, each in a folder of its name."""
    return {
        f"{folder}/{file}" if folder else file: table
        for folder, files in tables.items()
        for file, table in files.items()
    }


@cache
def _adapter(result_type: Any) -> TypeAdapter[Any]:
    """Return the reader and writer of a type: to build it takes longer than to read a result."""
    return TypeAdapter(result_type)


def _to_own_type(content: Any) -> RunResult:
    """Convert the content of a result to its protocol's own type; a result stays as it is."""
    if isinstance(content, RunResult):
        return content
    if not isinstance(content, Mapping) or not isinstance(content.get("kind"), str):
        raise ValueError("a result must say which protocol's it is")
    result_type: type[RunResult] = measurement(content["kind"], FILE).load("result")
    return result_type.from_dict(content)


#: A field that holds the result of any protocol.
AnyResult = Annotated[
    RunResult, PlainValidator(_to_own_type), PlainSerializer(lambda result: result.to_dict())
]


def write_result(folder: Path, result: RunResult) -> None:
    """Write `result.json` and the other files of a result into a folder.

    Parameters
    ----------
    folder
        Folder for the files, which exists.
    result
        The result of a run's analysis.

    Raises
    ------
    DiskError
        A file cannot be written.

    Examples
    --------
    >>> from pathlib import Path
    >>> import labrig
    >>> from labrig.results import write_result
    >>> folder = Path("copied-result")
    >>> folder.mkdir(exist_ok=True)
    >>> write_result(folder, labrig.read_result("runs/decay"))
    >>> sorted(path.name for path in folder.iterdir())
    ['fit.json', 'material.yaml', 'result.json', 'series.csv']
    """
    write_text(folder / FILE, result.to_json())
    for name, table in result.csv_tables().items():
        *inner, file = name.split("/")
        path = reduce(make_folder_in, inner, folder) / file
        write_csv(path, table.head, table.rows, table.comments)
    result.write_files(folder)


def read_result(run: Path | str) -> RunResult:
    """Read the result of a run's latest analysis.

    Parameters
    ----------
    run
        A run folder, or a result folder in one.

    Returns
    -------
    RunResult
        The result, of the type that belongs to the run's protocol.

    Raises
    ------
    UsageError
        There is no result, or its protocol belongs to a package that is not installed.
    DataError
        The file was changed, or another version of labrig wrote it.

    Examples
    --------
    >>> import labrig
    >>> result = labrig.read_result("runs/decay")
    >>> result.kind, list(result.patches)
    ('decay', ['sample'])
    >>> for rate in result.patches["sample"].fit.rates:
    ...     print(f"{rate.value:.2g} {rate.unit}")
    0.2 1/s
    0.01 1/s
    """
    place = Path(run)
    path = place / "result" / FILE if (place / "result").is_dir() else place / FILE
    if not path.is_file():
        raise UsageError(
            f"{place}: expected a run with a result; make it with: labrig process {place}"
        )
    try:
        result = _to_own_type(json.loads(read_text(path, MAX_JSON_BYTES)))
    except (
        LabrigError, ValueError, KeyError, TypeError, AttributeError, RecursionError
    ) as error:  # fmt: skip
        raise DataError(
            f"{path}: expected a result as this labrig writes it, got something else "
            f"({_first_error(error)}); make it again: labrig process {place}"
        ) from None
    return result.of_run(path.absolute().parents[1])


def _first_error(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
    return " ".join(str(error).split())


def _nonfinite_text(number: float) -> str:
    """Return the text for a number that is not finite, in pydantic's spelling."""
    return "NaN" if math.isnan(number) else "Infinity" if number > 0 else "-Infinity"


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainResult(RunResult):
    """Results of the parts of a chain.

    Attributes
    ----------
    parts
        Result of each part by its name, in the order of the run; those that could not be analysed
        are missing.
    failed
        Reason why a part could not be analysed, by its name.
    """

    parts: Mapping[str, AnyResult]
    failed: Mapping[str, str]

    def of_run(self, folder: Path, part: str = "") -> Self:
        """Note the run folder to which the results of all parts belong."""
        for name, result in self.parts.items():
            result.of_run(folder, name)
        return super().of_run(folder, part)

    def provides(self) -> dict[str, Any]:
        """Return the values that all parts provide; the later part has priority."""
        provided: dict[str, Any] = {}
        for part in self.parts.values():
            for name, value in part.provides().items():
                by_patch = isinstance(value, Mapping)
                provided[name] = {**provided.get(name, {}), **value} if by_patch else value
        return provided

    def csv_tables(self) -> dict[str, CsvTable]:
        """Return the tables of every part, in a folder of its name."""
        return in_folders({name: part.csv_tables() for name, part in self.parts.items()})

    def write_files(self, folder: Path) -> None:
        """Write the files of every part into a folder of its name."""
        for name, part in self.parts.items():
            part.write_files(make_folder_in(folder, name))
