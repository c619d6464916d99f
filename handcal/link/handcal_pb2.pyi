from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Eye(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    EYE_UNSPECIFIED: _ClassVar[Eye]
    EYE_LEFT: _ClassVar[Eye]
    EYE_RIGHT: _ClassVar[Eye]
EYE_UNSPECIFIED: Eye
EYE_LEFT: Eye
EYE_RIGHT: Eye

class Envelope(_message.Message):
    __slots__ = ("hello", "poses", "confirm", "pong", "welcome", "ping", "cursor", "live_hand", "prompt", "projection", "target", "ack", "bye")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    CONFIRM_FIELD_NUMBER: _ClassVar[int]
    PONG_FIELD_NUMBER: _ClassVar[int]
    WELCOME_FIELD_NUMBER: _ClassVar[int]
    PING_FIELD_NUMBER: _ClassVar[int]
    CURSOR_FIELD_NUMBER: _ClassVar[int]
    LIVE_HAND_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    PROJECTION_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    ACK_FIELD_NUMBER: _ClassVar[int]
    BYE_FIELD_NUMBER: _ClassVar[int]
    hello: Hello
    poses: Poses
    confirm: Confirm
    pong: Pong
    welcome: Welcome
    ping: Ping
    cursor: Cursor
    live_hand: LiveHand
    prompt: Prompt
    projection: Projection
    target: Target
    ack: Ack
    bye: Bye
    def __init__(self, hello: _Optional[_Union[Hello, _Mapping]] = ..., poses: _Optional[_Union[Poses, _Mapping]] = ..., confirm: _Optional[_Union[Confirm, _Mapping]] = ..., pong: _Optional[_Union[Pong, _Mapping]] = ..., welcome: _Optional[_Union[Welcome, _Mapping]] = ..., ping: _Optional[_Union[Ping, _Mapping]] = ..., cursor: _Optional[_Union[Cursor, _Mapping]] = ..., live_hand: _Optional[_Union[LiveHand, _Mapping]] = ..., prompt: _Optional[_Union[Prompt, _Mapping]] = ..., projection: _Optional[_Union[Projection, _Mapping]] = ..., target: _Optional[_Union[Target, _Mapping]] = ..., ack: _Optional[_Union[Ack, _Mapping]] = ..., bye: _Optional[_Union[Bye, _Mapping]] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("nonce",)
    NONCE_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    def __init__(self, nonce: _Optional[int] = ...) -> None: ...

class Welcome(_message.Message):
    __slots__ = ("nonce", "session")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    nonce: int
    session: int
    def __init__(self, nonce: _Optional[int] = ..., session: _Optional[int] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("t_headset_ns", "T_W_H")
    T_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    T_W_H_FIELD_NUMBER: _ClassVar[int]
    t_headset_ns: int
    T_W_H: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_headset_ns: _Optional[int] = ..., T_W_H: _Optional[_Iterable[float]] = ...) -> None: ...

class Poses(_message.Message):
    __slots__ = ("poses",)
    POSES_FIELD_NUMBER: _ClassVar[int]
    poses: _containers.RepeatedCompositeFieldContainer[Pose]
    def __init__(self, poses: _Optional[_Iterable[_Union[Pose, _Mapping]]] = ...) -> None: ...

class Confirm(_message.Message):
    __slots__ = ("t_headset_ns", "cursor_id", "T_E_W_left", "T_E_W_right")
    T_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    CURSOR_ID_FIELD_NUMBER: _ClassVar[int]
    T_E_W_LEFT_FIELD_NUMBER: _ClassVar[int]
    T_E_W_RIGHT_FIELD_NUMBER: _ClassVar[int]
    t_headset_ns: int
    cursor_id: int
    T_E_W_left: _containers.RepeatedScalarFieldContainer[float]
    T_E_W_right: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, t_headset_ns: _Optional[int] = ..., cursor_id: _Optional[int] = ..., T_E_W_left: _Optional[_Iterable[float]] = ..., T_E_W_right: _Optional[_Iterable[float]] = ...) -> None: ...

class Ping(_message.Message):
    __slots__ = ("t_sent_host_ns",)
    T_SENT_HOST_NS_FIELD_NUMBER: _ClassVar[int]
    t_sent_host_ns: int
    def __init__(self, t_sent_host_ns: _Optional[int] = ...) -> None: ...

class Pong(_message.Message):
    __slots__ = ("t_sent_host_ns", "t_received_headset_ns", "t_sent_headset_ns", "highest_sequence", "accepted")
    T_SENT_HOST_NS_FIELD_NUMBER: _ClassVar[int]
    T_RECEIVED_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    T_SENT_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    HIGHEST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    ACCEPTED_FIELD_NUMBER: _ClassVar[int]
    t_sent_host_ns: int
    t_received_headset_ns: int
    t_sent_headset_ns: int
    highest_sequence: int
    accepted: int
    def __init__(self, t_sent_host_ns: _Optional[int] = ..., t_received_headset_ns: _Optional[int] = ..., t_sent_headset_ns: _Optional[int] = ..., highest_sequence: _Optional[int] = ..., accepted: _Optional[int] = ...) -> None: ...

class Points(_message.Message):
    __slots__ = ("origin_m", "offsets")
    ORIGIN_M_FIELD_NUMBER: _ClassVar[int]
    OFFSETS_FIELD_NUMBER: _ClassVar[int]
    origin_m: _containers.RepeatedScalarFieldContainer[float]
    offsets: bytes
    def __init__(self, origin_m: _Optional[_Iterable[float]] = ..., offsets: _Optional[bytes] = ...) -> None: ...

class Cursor(_message.Message):
    __slots__ = ("cursor_id", "points")
    CURSOR_ID_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    cursor_id: int
    points: Points
    def __init__(self, cursor_id: _Optional[int] = ..., points: _Optional[_Union[Points, _Mapping]] = ...) -> None: ...

class LiveHand(_message.Message):
    __slots__ = ("frame", "chunk", "chunk_count", "red", "points")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    CHUNK_COUNT_FIELD_NUMBER: _ClassVar[int]
    RED_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    frame: int
    chunk: int
    chunk_count: int
    red: bool
    points: Points
    def __init__(self, frame: _Optional[int] = ..., chunk: _Optional[int] = ..., chunk_count: _Optional[int] = ..., red: _Optional[bool] = ..., points: _Optional[_Union[Points, _Mapping]] = ...) -> None: ...

class Prompt(_message.Message):
    __slots__ = ("text", "eyes")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    EYES_FIELD_NUMBER: _ClassVar[int]
    text: str
    eyes: _containers.RepeatedScalarFieldContainer[Eye]
    def __init__(self, text: _Optional[str] = ..., eyes: _Optional[_Iterable[_Union[Eye, str]]] = ...) -> None: ...

class Projection(_message.Message):
    __slots__ = ("eye", "P", "width_px", "height_px")
    EYE_FIELD_NUMBER: _ClassVar[int]
    P_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    eye: Eye
    P: _containers.RepeatedScalarFieldContainer[float]
    width_px: int
    height_px: int
    def __init__(self, eye: _Optional[_Union[Eye, str]] = ..., P: _Optional[_Iterable[float]] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ...) -> None: ...

class Target(_message.Message):
    __slots__ = ("eye", "corners_V_m")
    EYE_FIELD_NUMBER: _ClassVar[int]
    CORNERS_V_M_FIELD_NUMBER: _ClassVar[int]
    eye: Eye
    corners_V_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, eye: _Optional[_Union[Eye, str]] = ..., corners_V_m: _Optional[_Iterable[float]] = ...) -> None: ...

class Ack(_message.Message):
    __slots__ = ("received",)
    class Received(_message.Message):
        __slots__ = ("slot", "message_id", "fragments")
        SLOT_FIELD_NUMBER: _ClassVar[int]
        MESSAGE_ID_FIELD_NUMBER: _ClassVar[int]
        FRAGMENTS_FIELD_NUMBER: _ClassVar[int]
        slot: int
        message_id: int
        fragments: bytes
        def __init__(self, slot: _Optional[int] = ..., message_id: _Optional[int] = ..., fragments: _Optional[bytes] = ...) -> None: ...
    RECEIVED_FIELD_NUMBER: _ClassVar[int]
    received: _containers.RepeatedCompositeFieldContainer[Ack.Received]
    def __init__(self, received: _Optional[_Iterable[_Union[Ack.Received, _Mapping]]] = ...) -> None: ...

class Bye(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...
