"""visualization_msgs: shapes to draw."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta

from messages.base import Message
from messages.geometry import Point, Pose, Vector3
from messages.std import ColorRGBA, Duration, Header

Int32 = Annotated[int, Meta(ge=-(2**31), le=2**31 - 1)]


class Marker(Message, frozen=True, kw_only=True):
    """A shape to draw at ``pose`` in the header's frame, identified by namespace ``ns`` and ``id``.

    ``scale`` [m] is the full extent of a CUBE, SPHERE or CYLINDER (along z) about its centre, and multiplies the
    ``points`` [m] of a TRIANGLE_LIST, three per triangle, and the mesh in ``mesh_resource`` (a URL) of a MESH_RESOURCE.
    ``points`` are also those of lines, which are ``scale.x`` wide, and of lists of shapes of one size; two of them are
    the ends of an ARROW. ``text`` names the shape. It is removed after its ``lifetime``, unless that is 0. ROS's other
    fields (textures, ``frame_locked``) keep their defaults.
    """

    ROS_TYPE: ClassVar[str] = "visualization_msgs/Marker"
    ARROW: ClassVar[int] = 0
    CUBE: ClassVar[int] = 1
    SPHERE: ClassVar[int] = 2
    CYLINDER: ClassVar[int] = 3
    LINE_STRIP: ClassVar[int] = 4
    LINE_LIST: ClassVar[int] = 5
    CUBE_LIST: ClassVar[int] = 6
    SPHERE_LIST: ClassVar[int] = 7
    POINTS: ClassVar[int] = 8
    TEXT_VIEW_FACING: ClassVar[int] = 9
    MESH_RESOURCE: ClassVar[int] = 10
    TRIANGLE_LIST: ClassVar[int] = 11
    ADD: ClassVar[Literal[0]] = 0
    DELETE: ClassVar[Literal[2]] = 2
    DELETEALL: ClassVar[Literal[3]] = 3
    header: Header = Header()
    ns: str = ""
    id: Int32 = 0
    type: Int32 = 0
    action: Literal[0, 2, 3] = 0
    pose: Pose = Pose()
    scale: Vector3 = Vector3()
    color: ColorRGBA = ColorRGBA()
    lifetime: Duration = Duration()
    points: tuple[Point, ...] = ()
    colors: tuple[ColorRGBA, ...] = ()
    text: str = ""
    mesh_resource: str = ""
    mesh_use_embedded_materials: bool = False


class MarkerArray(Message, frozen=True, kw_only=True):
    """Several markers."""

    ROS_TYPE: ClassVar[str] = "visualization_msgs/MarkerArray"
    markers: tuple[Marker, ...] = ()
