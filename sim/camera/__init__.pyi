from .body_settings import BodySettings as BodySettings
from .camera import SimulatedCamera as SimulatedCamera
from .faults import CameraFaults as CameraFaults
from .photograph import Sensor as Sensor
from .ptpip.server import Pace as Pace, PtpIpServer as PtpIpServer
from .standard.body import StandardHabits as StandardHabits
