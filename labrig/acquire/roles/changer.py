"""The changer: it does at the bench what protocols would ask a person to do."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, Role


@runtime_checkable
class Changer(Device, Protocol):
    """Do what a person would do at the bench: a sample changer, a filter wheel. Safe: still."""

    def do(self, task: str) -> None:
        """Do it; returns when it is done.

        Raises
        ------
        DeviceError
            They do not know how, or something went wrong.
        """


#: In a plan everything is done by a person.
CHANGER: Role[Changer] = Role(key="changer", does=Changer, name="changer")
