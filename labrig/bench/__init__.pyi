from .execution import (
    Watch as Watch,
)
from .opening import (
    Bench as Bench,
    open_bench as open_bench,
    serve_camera as serve_camera,
    wall_at_start as wall_at_start,
    with_frame_size as with_frame_size,
)
from .recording import (
    Recording as Recording,
    free_disk_bytes as free_disk_bytes,
    resume_run as resume_run,
)
from .run_log import (
    logging_to as logging_to,
)
