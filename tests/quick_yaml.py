"""YAML of rigs and protocols that tests write by the hundred: by libyaml, where there is one."""

from typing import Any

import yaml

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def read_quickly(text: str) -> Any:
    """As `yaml.safe_load`."""
    return yaml.load(text, _LOADER)


def write_quickly(content: Any) -> str:
    """As `yaml.safe_dump`."""
    text: str = yaml.dump(content, Dumper=_DUMPER)
    return text
