"""The protobuf types of a recording, built from one table.

Those of Foxglove have its names and numbers, so that its program shows them; a scan has further
fields from 101 on, which its program passes over, because it must come back bit by bit.
"""

from collections.abc import Iterator
from typing import Any

from google.protobuf import timestamp_pb2
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass

_Field = tuple[int, str, str]  # number, name, type; [] after the type: many

TYPES: dict[str, list[_Field]] = {
    "foxglove.Vector3": [(1, "x", "double"), (2, "y", "double"), (3, "z", "double")],
    "foxglove.Quaternion": [
        (1, "x", "double"),
        (2, "y", "double"),
        (3, "z", "double"),
        (4, "w", "double"),
    ],
    "foxglove.Pose": [
        (1, "position", "foxglove.Vector3"),
        (2, "orientation", "foxglove.Quaternion"),
    ],
    "foxglove.FrameTransform": [
        (1, "timestamp", "google.protobuf.Timestamp"),
        (2, "parent_frame_id", "string"),
        (3, "child_frame_id", "string"),
        (4, "translation", "foxglove.Vector3"),
        (5, "rotation", "foxglove.Quaternion"),
    ],
    "foxglove.LaserScan": [
        (1, "timestamp", "google.protobuf.Timestamp"),
        (2, "frame_id", "string"),
        (3, "pose", "foxglove.Pose"),
        (4, "start_angle", "double"),
        (5, "end_angle", "double"),
        (6, "ranges", "double[]"),
        (7, "intensities", "double[]"),
        (101, "stamp", "double"),
        (102, "angle_increment", "double"),
        (103, "time_increment", "double"),
        (104, "range_min", "double"),
        (105, "range_max", "double"),
        (106, "base_laser", "gvgbot.Pose"),
    ],
    "gvgbot.Pose": [(1, "x", "double"), (2, "y", "double"), (3, "theta", "double")],
    "gvgbot.Twist": [(1, "linear", "double"), (2, "angular", "double")],
    "gvgbot.Contact": [
        (1, "stamp", "double"),
        (2, "bumper_left", "bool"),
        (3, "bumper_centre", "bool"),
        (4, "bumper_right", "bool"),
        (5, "cliff_left", "bool"),
        (6, "cliff_centre", "bool"),
        (7, "cliff_right", "bool"),
        (8, "wheel_drop_left", "bool"),
        (9, "wheel_drop_right", "bool"),
        (10, "over_current", "bool"),
        (11, "charger_cable", "bool"),
    ],
    "gvgbot.Cycle": [
        (1, "stamp", "double"),
        (2, "odom_base", "gvgbot.Pose"),
        (3, "measured", "gvgbot.Twist"),
        (4, "contact", "gvgbot.Contact"),
        (5, "stopped_for", "string"),
        (6, "wish", "gvgbot.Twist"),
        (7, "permitted", "gvgbot.Twist"),
        (8, "breaks", "uint32"),
    ],
    "gvgbot.Battery": [
        (1, "stamp", "double"),
        (2, "voltage", "double"),
        (3, "fraction", "double"),
        (4, "charging", "bool"),
    ],
}
_SCALARS = {
    "double": FieldDescriptorProto.TYPE_DOUBLE,
    "string": FieldDescriptorProto.TYPE_STRING,
    "bool": FieldDescriptorProto.TYPE_BOOL,
    "uint32": FieldDescriptorProto.TYPE_UINT32,
}


def _field(number: int, name: str, kind: str) -> FieldDescriptorProto:
    base = kind.removesuffix("[]")
    field = FieldDescriptorProto(
        name=name,
        number=number,
        label=FieldDescriptorProto.LABEL_REPEATED
        if base != kind
        else FieldDescriptorProto.LABEL_OPTIONAL,
        type=_SCALARS.get(base, FieldDescriptorProto.TYPE_MESSAGE),
    )
    if base not in _SCALARS:
        field.type_name = f".{base}"
    return field


def _files() -> Iterator[FileDescriptorProto]:
    """One file of definitions for each package, those first that others need."""
    timestamp = FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(timestamp)
    yield timestamp
    for package, needed in (("gvgbot", []), ("foxglove", [timestamp.name, "gvgbot.proto"])):
        messages = [
            DescriptorProto(
                name=name.removeprefix(f"{package}."), field=[_field(*field) for field in fields]
            )
            for name, fields in TYPES.items()
            if name.startswith(f"{package}.")
        ]
        yield FileDescriptorProto(
            name=f"{package}.proto",
            package=package,
            dependency=needed,
            message_type=messages,
            syntax="proto3",
        )


DESCRIPTORS = FileDescriptorSet(file=list(_files())).SerializeToString()
"""All definitions, as MCAP wants them beside each schema's name."""

_pool = DescriptorPool()
for _file in _files():
    _pool.Add(_file)
_classes = {name: GetMessageClass(_pool.FindMessageTypeByName(name)) for name in TYPES}


def message(kind: str, **fields: Any) -> Any:
    """A message of a type in the table."""
    return _classes[kind](**fields)


def decoded(kind: str, data: bytes) -> Any:
    """A message from its bytes. Raises google.protobuf.message.DecodeError."""
    return _classes[kind].FromString(data)
