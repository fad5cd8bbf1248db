from .body_settings import BodySettings as BodySettings, CameraFaults as CameraFaults
from .camera import SimulatedCamera as SimulatedCamera
from .photograph import Pace as Pace, Sensor as Sensor
from .ptpip.server import PtpIpServer as PtpIpServer
from .standard import StandardHabits as StandardHabits
