"""Measurement protocols: a pydantic model each, beside the commented YAML file that people copy."""

if __name__ != "labrig.protocols":
    raise ImportError("this package is labrig.protocols; import it by that name")
