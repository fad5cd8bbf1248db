"""JSON Schemas of the files that users write, with which an editor completes and checks them."""

import inspect
import operator
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from functools import cache, reduce
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, TypeAdapter, create_model
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import SchemaError, SchemaSerializer, core_schema

from labrig.acquire import ROLES, BoardDevice, DeviceEntry, RigFile
from labrig.design import WishFile
from labrig.foundation import plugins
from labrig.foundation.errors import UsageError
from labrig.foundation.key_texts import descriptions
from labrig.foundation.yaml_file import did_you_mean
from labrig.material import FluorescentMaterial, Material
from labrig.reproduce import SceneFile

KINDS = ("protocol", "rig", "material", "scene", "design")


def schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, one of `KINDS`, as YAML loads it.

    Raises
    ------
    UsageError
        There is no such kind of file.
    """
    if kind not in KINDS:
        raise UsageError(f"there is no schema of '{kind}'; {did_you_mean(kind, KINDS)}")
    makers: dict[str, Callable[[], Any]] = {
        "protocol": _protocol,
        "rig": _rig,
        "material": lambda: _one_of("kind", [Material, FluorescentMaterial]),
        "scene": lambda: SceneFile,
        "design": lambda: WishFile,
    }
    model = makers[kind]()
    json_schema = TypeAdapter(model).json_schema(by_alias=True, schema_generator=_Described)
    _describe_in_markdown(json_schema)
    return {"$schema": _Described.schema_dialect, **json_schema, "title": f"labrig {kind}"}


def _describe_in_markdown(node: Any) -> None:
    """Repeat descriptions under the key by which editors show Markdown, such as `code`."""
    children = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    for child in list(children):
        _describe_in_markdown(child)
    text = node.get("description") if isinstance(node, dict) else None
    if isinstance(text, str) and "`" in text:
        node["markdownDescription"] = text


def _protocol() -> Any:
    """Return the union of the registered protocols, discriminated by the key `protocol`."""
    models = [registered.load("protocol") for _, registered in plugins.measurements()]
    return _one_of("protocol", models)


def _rig() -> Any:
    """Return the model of a rig file whose devices have the keys of their drivers."""
    names = plugins.names(plugins.DRIVERS)
    drivers = {name: plugins.load(plugins.DRIVERS, name, "schema") for name in names}
    roles: dict[str, Any] = {}
    for key, role in ROLES.items():
        fitting = [
            _entry(name, fitted)  # type: ignore[arg-type]
            for name, driver in drivers.items()
            if (fitted := role.driver(driver)) is not None
        ]
        if fitting:
            summary = inspect.cleandoc(role.protocol_class.__doc__ or "").splitlines()[0]
            roles[key] = (_one_of("driver", fitting), Field(None, description=summary))
    devices = create_model(
        "Devices",
        __config__={"extra": "forbid"},
        __doc__="Devices of the bench by their roles.",
        **roles,
    )
    from labrig.sim import Simulation

    return create_model(
        "Rig",
        __base__=RigFile,
        __doc__=RigFile.__doc__,
        devices=(devices, ...),
        simulation=(Simulation | None, None),
    )


@cache
def _entry(driver: str, fitted: type) -> type[BaseModel]:
    """Return the model of a device's entry with that driver, as the class that fills its role."""
    texts = descriptions(DeviceEntry)
    shared: dict[str, Any] = {}
    for name, field in DeviceEntry.model_fields.items():
        described = copy(field)
        described.description = texts[name]
        shared[name] = (Literal[driver] if name == "driver" else field.annotation, described)
    # On a board, devices of different roles have different keys.
    name = f"{driver} as {fitted.noun}" if issubclass(fitted, BoardDevice) else driver
    settings: type[BaseModel] = fitted.Settings  # type: ignore[attr-defined]
    return create_model(name, __base__=settings, __doc__=settings.__doc__, **shared)


def _one_of(key: str, models: list[type[BaseModel]]) -> Any:
    if len(models) == 1:
        return models[0]
    return Annotated[reduce(operator.or_, models), Field(discriminator=key)]


class _Described(GenerateJsonSchema):
    """Describes keys as the models' docstrings do; defaults have the form that YAML has."""

    def model_schema(self, schema: core_schema.ModelSchema) -> JsonSchemaValue:
        made = super().model_schema(schema)
        model = schema["cls"]
        made["description"] = inspect.cleandoc(model.__doc__ or "").partition("\n\n")[0]
        texts = descriptions(model)
        for branch in (made, *made.get("anyOf", [])):
            for name, field in model.model_fields.items():
                place: dict[str, Any] = branch.get("properties", {}).get(field.alias or name, {})
                if name in texts:
                    place["description"] = texts[name]
        return made

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        made = super().default_schema(schema)
        if made.get("default") is None:
            made.pop("default", None)
            return made
        with suppress(SchemaError):  # a model's own serializer has done it
            written = SchemaSerializer(schema["schema"])
            made["default"] = written.to_python(schema["default"], mode="json", by_alias=True)
        return made
