"""Rig files, materials and optical data that are shipped with labrig."""

if __name__ != "labrig.config":
    raise ImportError("this package is labrig.config; import it by that name")
