"""JSON Schemas of the files that users write, with which an editor completes and checks them."""

import inspect
import operator
import re
from collections.abc import Callable, Iterator
from functools import reduce
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, TypeAdapter, create_model
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from labrig import plugins
from labrig.acquire import ROLES, DeviceEntry, RigFile
from labrig.errors import UsageError
from labrig.material import Material
from labrig.yaml_file import did_you_mean

KINDS = ("protocol", "rig", "material")


def schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a `protocol`, a `rig` or a `material` file, as YAML loads it.

    Raises
    ------
    UsageError
        There is no such kind of file.
    """
    if kind not in KINDS:
        raise UsageError(f"there is no schema of '{kind}'; {did_you_mean(kind, KINDS)}")
    makers: dict[str, Callable[[], Any]] = {"protocol": _protocol, "rig": _rig}
    model = makers[kind]() if kind in makers else Material
    json_schema = TypeAdapter(model).json_schema(by_alias=True, schema_generator=_Described)
    return {"$schema": _Described.schema_dialect, **json_schema, "title": f"labrig {kind}"}


def _protocol() -> Any:
    """Return the union of the registered protocols, discriminated by the key `protocol`."""
    names = plugins.names(plugins.PROTOCOLS)
    return _one_of("protocol", [plugins.load(plugins.PROTOCOLS, name, "schema") for name in names])


def _rig() -> Any:
    """Return the model of a rig file whose devices have the keys of their drivers."""
    names = plugins.names(plugins.DRIVERS)
    drivers = {name: plugins.load(plugins.DRIVERS, name, "schema") for name in names}
    entries = {name: _entry(name, driver.Settings) for name, driver in drivers.items()}
    roles: dict[str, Any] = {}
    for key, role in ROLES.items():
        fitting = [
            entries[name] for name, driver in drivers.items() if issubclass(driver, role.does)
        ]
        if fitting:
            summary = inspect.cleandoc(role.does.__doc__ or "").splitlines()[0]
            roles[key] = (_one_of("driver", fitting), Field(None, description=summary))
    devices = create_model("Devices", __config__={"extra": "forbid"}, **roles)
    from labrig.sim import Simulation

    return create_model(
        "Rig",
        __base__=RigFile,
        __doc__=RigFile.__doc__,
        devices=(devices, ...),
        simulation=(Simulation | None, None),
    )


def _entry(driver: str, settings: type[BaseModel]) -> type[BaseModel]:
    """Return the model of a device entry of one driver."""
    shared_fields: dict[str, Any] = {
        name: (field.annotation, field) for name, field in DeviceEntry.model_fields.items()
    }
    fields: dict[str, Any] = shared_fields | {"driver": (Literal[driver], ...)}
    return create_model(driver, __base__=settings, __doc__=settings.__doc__, **fields)


def _one_of(key: str, models: list[type[BaseModel]]) -> Any:
    if len(models) == 1:
        return models[0]
    return Annotated[reduce(operator.or_, models), Field(discriminator=key)]


class _Described(GenerateJsonSchema):
    """Schema generator with the models' docstrings as descriptions and defaults as written."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        json_schema = super().model_schema(schema)
        docstring = inspect.cleandoc(schema["cls"].__doc__ or "")
        json_schema["description"] = docstring.partition("\n\n")[0]
        texts = dict(_attributes(docstring))
        for name, field in schema["cls"].model_fields.items():
            entry: dict[str, Any] = json_schema.get("properties", {}).get(field.alias or name, {})
            if name in texts:
                entry["description"] = texts[name]
        return json_schema

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        json_schema = super().default_schema(schema)
        default = json_schema.get("default")
        if default is None or (json_schema.get("type") == "string") != isinstance(default, str):
            json_schema.pop("default", None)
        return json_schema


def _attributes(docstring: str) -> Iterator[tuple[str, str]]:
    """Yield name and text of each entry in the Attributes section of a numpy docstring."""
    _, _, section = docstring.partition("Attributes\n----------\n")
    for names, text in re.findall(r"^(\w[\w, ]*)\n((?:    .*\n?|\n(?=    ))+)", section, re.M):
        for name in names.split(","):
            yield name.strip(), " ".join(text.split())
