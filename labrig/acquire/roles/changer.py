"""The changer, a device that does the manual steps of protocols."""

from typing import Protocol, runtime_checkable

from labrig.acquire.roles.role import Device, Role


@runtime_checkable
class Changer(Device, Protocol):
    """A device that replaces the person: a sample changer, a filter wheel. Safe state: at rest."""

    def do(self, task: str) -> None:
        """Perform a task; return when it is done.

        Raises
        ------
        DeviceError
            If the changer does not know the task, or fails.
        """


#: Without a stand-in: in a plan, manual steps are done by a person.
CHANGER: Role[Changer] = Role(key="changer", protocol_class=Changer, name="changer")
