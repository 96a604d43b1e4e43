"""nav_msgs: odometry, paths and maps."""

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Message
from messages.geometry import Pose, PoseStamped, PoseWithCovariance, TwistWithCovariance
from messages.std import Header, Time


class Odometry(Message, frozen=True, kw_only=True):
    """Pose of ``child_frame_id`` in the header's frame, twist in ``child_frame_id``."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/Odometry"
    header: Header = Header()
    child_frame_id: str = ""
    pose: PoseWithCovariance = PoseWithCovariance()
    twist: TwistWithCovariance = TwistWithCovariance()


class Path(Message, frozen=True, kw_only=True):
    """Poses to drive through, in order."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/Path"
    header: Header = Header()
    poses: tuple[PoseStamped, ...] = ()


MOST_CELLS = 8_000_000
"""Maximum number of cells of a map."""

UInt32 = Annotated[int, Meta(ge=0, lt=2**32)]
Occupancy = Annotated[int, Meta(ge=-128, le=127)]


class MapMetaData(Message, frozen=True, kw_only=True):
    """Size of a map in cells of ``resolution`` [m]; ``origin`` is the pose of its lower left corner."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/MapMetaData"
    map_load_time: Time = Time()
    resolution: Annotated[float, Meta(ge=0, le=1e6, extra={"unit": "m"})] = 0.0
    width: UInt32 = 0
    height: UInt32 = 0
    origin: Pose = Pose()


class OccupancyGrid(Message, frozen=True, kw_only=True):
    """A map: the probability [%] that each cell is occupied, -1 if unknown; row by row from the origin."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/OccupancyGrid"
    header: Header = Header()
    info: MapMetaData = MapMetaData()
    data: Annotated[tuple[Occupancy, ...], Meta(max_length=MOST_CELLS)] = ()


class GetMap(Message, frozen=True, kw_only=True):
    """Get the map of a map server."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/GetMap"


class GetMapResponse(Message, frozen=True, kw_only=True):
    """The map."""

    ROS_TYPE: ClassVar[str] = "nav_msgs/GetMapResponse"
    map: OccupancyGrid = OccupancyGrid()
