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

class Refusal(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    REFUSAL_UNSPECIFIED: _ClassVar[Refusal]
    REFUSAL_BUSY: _ClassVar[Refusal]
    REFUSAL_KEY_TAKEN: _ClassVar[Refusal]
    REFUSAL_NO_CODE: _ClassVar[Refusal]
EYE_UNSPECIFIED: Eye
EYE_LEFT: Eye
EYE_RIGHT: Eye
REFUSAL_UNSPECIFIED: Refusal
REFUSAL_BUSY: Refusal
REFUSAL_KEY_TAKEN: Refusal
REFUSAL_NO_CODE: Refusal

class Envelope(_message.Message):
    __slots__ = ("hello", "poses", "confirm", "pong", "device", "nudge", "pair", "retry", "refused", "welcome", "ping", "cursor", "live_hand", "prompt", "projection", "target", "shape", "show", "verify", "paired", "ack", "bye")
    HELLO_FIELD_NUMBER: _ClassVar[int]
    POSES_FIELD_NUMBER: _ClassVar[int]
    CONFIRM_FIELD_NUMBER: _ClassVar[int]
    PONG_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    NUDGE_FIELD_NUMBER: _ClassVar[int]
    PAIR_FIELD_NUMBER: _ClassVar[int]
    RETRY_FIELD_NUMBER: _ClassVar[int]
    REFUSED_FIELD_NUMBER: _ClassVar[int]
    WELCOME_FIELD_NUMBER: _ClassVar[int]
    PING_FIELD_NUMBER: _ClassVar[int]
    CURSOR_FIELD_NUMBER: _ClassVar[int]
    LIVE_HAND_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    PROJECTION_FIELD_NUMBER: _ClassVar[int]
    TARGET_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    SHOW_FIELD_NUMBER: _ClassVar[int]
    VERIFY_FIELD_NUMBER: _ClassVar[int]
    PAIRED_FIELD_NUMBER: _ClassVar[int]
    ACK_FIELD_NUMBER: _ClassVar[int]
    BYE_FIELD_NUMBER: _ClassVar[int]
    hello: Hello
    poses: Poses
    confirm: Confirm
    pong: Pong
    device: Device
    nudge: Nudge
    pair: Pair
    retry: Retry
    refused: Refused
    welcome: Welcome
    ping: Ping
    cursor: Cursor
    live_hand: LiveHand
    prompt: Prompt
    projection: Projection
    target: Target
    shape: Shape
    show: Show
    verify: Verify
    paired: Paired
    ack: Ack
    bye: Bye
    def __init__(self, hello: _Optional[_Union[Hello, _Mapping]] = ..., poses: _Optional[_Union[Poses, _Mapping]] = ..., confirm: _Optional[_Union[Confirm, _Mapping]] = ..., pong: _Optional[_Union[Pong, _Mapping]] = ..., device: _Optional[_Union[Device, _Mapping]] = ..., nudge: _Optional[_Union[Nudge, _Mapping]] = ..., pair: _Optional[_Union[Pair, _Mapping]] = ..., retry: _Optional[_Union[Retry, _Mapping]] = ..., refused: _Optional[_Union[Refused, _Mapping]] = ..., welcome: _Optional[_Union[Welcome, _Mapping]] = ..., ping: _Optional[_Union[Ping, _Mapping]] = ..., cursor: _Optional[_Union[Cursor, _Mapping]] = ..., live_hand: _Optional[_Union[LiveHand, _Mapping]] = ..., prompt: _Optional[_Union[Prompt, _Mapping]] = ..., projection: _Optional[_Union[Projection, _Mapping]] = ..., target: _Optional[_Union[Target, _Mapping]] = ..., shape: _Optional[_Union[Shape, _Mapping]] = ..., show: _Optional[_Union[Show, _Mapping]] = ..., verify: _Optional[_Union[Verify, _Mapping]] = ..., paired: _Optional[_Union[Paired, _Mapping]] = ..., ack: _Optional[_Union[Ack, _Mapping]] = ..., bye: _Optional[_Union[Bye, _Mapping]] = ...) -> None: ...

class Hello(_message.Message):
    __slots__ = ("nonce", "time_ns", "cookie", "name")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    TIME_NS_FIELD_NUMBER: _ClassVar[int]
    COOKIE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    time_ns: int
    cookie: bytes
    name: str
    def __init__(self, nonce: _Optional[bytes] = ..., time_ns: _Optional[int] = ..., cookie: _Optional[bytes] = ..., name: _Optional[str] = ...) -> None: ...

class Retry(_message.Message):
    __slots__ = ("nonce", "cookie")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    COOKIE_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    cookie: bytes
    def __init__(self, nonce: _Optional[bytes] = ..., cookie: _Optional[bytes] = ...) -> None: ...

class Welcome(_message.Message):
    __slots__ = ("nonce", "session", "pc_nonce")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    SESSION_FIELD_NUMBER: _ClassVar[int]
    PC_NONCE_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    session: int
    pc_nonce: bytes
    def __init__(self, nonce: _Optional[bytes] = ..., session: _Optional[int] = ..., pc_nonce: _Optional[bytes] = ...) -> None: ...

class Pair(_message.Message):
    __slots__ = ("nonce", "public_value", "name", "cookie", "by_code")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    PUBLIC_VALUE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    COOKIE_FIELD_NUMBER: _ClassVar[int]
    BY_CODE_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    public_value: bytes
    name: str
    cookie: bytes
    by_code: bool
    def __init__(self, nonce: _Optional[bytes] = ..., public_value: _Optional[bytes] = ..., name: _Optional[str] = ..., cookie: _Optional[bytes] = ..., by_code: _Optional[bool] = ...) -> None: ...

class Paired(_message.Message):
    __slots__ = ("nonce", "public_value", "proof")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    PUBLIC_VALUE_FIELD_NUMBER: _ClassVar[int]
    PROOF_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    public_value: bytes
    proof: bytes
    def __init__(self, nonce: _Optional[bytes] = ..., public_value: _Optional[bytes] = ..., proof: _Optional[bytes] = ...) -> None: ...

class Refused(_message.Message):
    __slots__ = ("nonce", "reason", "other")
    NONCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    OTHER_FIELD_NUMBER: _ClassVar[int]
    nonce: bytes
    reason: Refusal
    other: str
    def __init__(self, nonce: _Optional[bytes] = ..., reason: _Optional[_Union[Refusal, str]] = ..., other: _Optional[str] = ...) -> None: ...

class View(_message.Message):
    __slots__ = ("eye", "T_V_H", "tangents", "width_px", "height_px")
    EYE_FIELD_NUMBER: _ClassVar[int]
    T_V_H_FIELD_NUMBER: _ClassVar[int]
    TANGENTS_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    eye: Eye
    T_V_H: _containers.RepeatedScalarFieldContainer[float]
    tangents: _containers.RepeatedScalarFieldContainer[float]
    width_px: int
    height_px: int
    def __init__(self, eye: _Optional[_Union[Eye, str]] = ..., T_V_H: _Optional[_Iterable[float]] = ..., tangents: _Optional[_Iterable[float]] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ...) -> None: ...

class Device(_message.Message):
    __slots__ = ("name", "runtime", "app", "protocol", "views", "eye_distance_m", "shown_wearer", "shown_rig")
    NAME_FIELD_NUMBER: _ClassVar[int]
    RUNTIME_FIELD_NUMBER: _ClassVar[int]
    APP_FIELD_NUMBER: _ClassVar[int]
    PROTOCOL_FIELD_NUMBER: _ClassVar[int]
    VIEWS_FIELD_NUMBER: _ClassVar[int]
    EYE_DISTANCE_M_FIELD_NUMBER: _ClassVar[int]
    SHOWN_WEARER_FIELD_NUMBER: _ClassVar[int]
    SHOWN_RIG_FIELD_NUMBER: _ClassVar[int]
    name: str
    runtime: str
    app: str
    protocol: int
    views: _containers.RepeatedCompositeFieldContainer[View]
    eye_distance_m: float
    shown_wearer: str
    shown_rig: str
    def __init__(self, name: _Optional[str] = ..., runtime: _Optional[str] = ..., app: _Optional[str] = ..., protocol: _Optional[int] = ..., views: _Optional[_Iterable[_Union[View, _Mapping]]] = ..., eye_distance_m: _Optional[float] = ..., shown_wearer: _Optional[str] = ..., shown_rig: _Optional[str] = ...) -> None: ...

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
    __slots__ = ("t_headset_ns", "cursor_id", "drawn")
    T_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    CURSOR_ID_FIELD_NUMBER: _ClassVar[int]
    DRAWN_FIELD_NUMBER: _ClassVar[int]
    t_headset_ns: int
    cursor_id: int
    drawn: bytes
    def __init__(self, t_headset_ns: _Optional[int] = ..., cursor_id: _Optional[int] = ..., drawn: _Optional[bytes] = ...) -> None: ...

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
    __slots__ = ("cursor_id", "points", "eyes")
    CURSOR_ID_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    EYES_FIELD_NUMBER: _ClassVar[int]
    cursor_id: int
    points: Points
    eyes: _containers.RepeatedScalarFieldContainer[Eye]
    def __init__(self, cursor_id: _Optional[int] = ..., points: _Optional[_Union[Points, _Mapping]] = ..., eyes: _Optional[_Iterable[_Union[Eye, str]]] = ...) -> None: ...

class LiveHand(_message.Message):
    __slots__ = ("frame", "chunk", "chunk_count", "red", "points", "outline", "eyes")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    CHUNK_FIELD_NUMBER: _ClassVar[int]
    CHUNK_COUNT_FIELD_NUMBER: _ClassVar[int]
    RED_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    OUTLINE_FIELD_NUMBER: _ClassVar[int]
    EYES_FIELD_NUMBER: _ClassVar[int]
    frame: int
    chunk: int
    chunk_count: int
    red: bool
    points: Points
    outline: bool
    eyes: _containers.RepeatedScalarFieldContainer[Eye]
    def __init__(self, frame: _Optional[int] = ..., chunk: _Optional[int] = ..., chunk_count: _Optional[int] = ..., red: _Optional[bool] = ..., points: _Optional[_Union[Points, _Mapping]] = ..., outline: _Optional[bool] = ..., eyes: _Optional[_Iterable[_Union[Eye, str]]] = ...) -> None: ...

class Prompt(_message.Message):
    __slots__ = ("text", "eyes")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    EYES_FIELD_NUMBER: _ClassVar[int]
    text: str
    eyes: _containers.RepeatedScalarFieldContainer[Eye]
    def __init__(self, text: _Optional[str] = ..., eyes: _Optional[_Iterable[_Union[Eye, str]]] = ...) -> None: ...

class Projection(_message.Message):
    __slots__ = ("eye", "P", "width_px", "height_px", "T_V_H", "P_offline", "wearer", "rig")
    EYE_FIELD_NUMBER: _ClassVar[int]
    P_FIELD_NUMBER: _ClassVar[int]
    WIDTH_PX_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_PX_FIELD_NUMBER: _ClassVar[int]
    T_V_H_FIELD_NUMBER: _ClassVar[int]
    P_OFFLINE_FIELD_NUMBER: _ClassVar[int]
    WEARER_FIELD_NUMBER: _ClassVar[int]
    RIG_FIELD_NUMBER: _ClassVar[int]
    eye: Eye
    P: _containers.RepeatedScalarFieldContainer[float]
    width_px: int
    height_px: int
    T_V_H: _containers.RepeatedScalarFieldContainer[float]
    P_offline: _containers.RepeatedScalarFieldContainer[float]
    wearer: str
    rig: str
    def __init__(self, eye: _Optional[_Union[Eye, str]] = ..., P: _Optional[_Iterable[float]] = ..., width_px: _Optional[int] = ..., height_px: _Optional[int] = ..., T_V_H: _Optional[_Iterable[float]] = ..., P_offline: _Optional[_Iterable[float]] = ..., wearer: _Optional[str] = ..., rig: _Optional[str] = ...) -> None: ...

class Target(_message.Message):
    __slots__ = ("eye", "corners_V_m")
    EYE_FIELD_NUMBER: _ClassVar[int]
    CORNERS_V_M_FIELD_NUMBER: _ClassVar[int]
    eye: Eye
    corners_V_m: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, eye: _Optional[_Union[Eye, str]] = ..., corners_V_m: _Optional[_Iterable[float]] = ...) -> None: ...

class Shape(_message.Message):
    __slots__ = ("corners_W_m", "eyes")
    CORNERS_W_M_FIELD_NUMBER: _ClassVar[int]
    EYES_FIELD_NUMBER: _ClassVar[int]
    corners_W_m: _containers.RepeatedScalarFieldContainer[float]
    eyes: _containers.RepeatedScalarFieldContainer[Eye]
    def __init__(self, corners_W_m: _Optional[_Iterable[float]] = ..., eyes: _Optional[_Iterable[_Union[Eye, str]]] = ...) -> None: ...

class Show(_message.Message):
    __slots__ = ("offline",)
    OFFLINE_FIELD_NUMBER: _ClassVar[int]
    offline: bool
    def __init__(self, offline: _Optional[bool] = ...) -> None: ...

class Verify(_message.Message):
    __slots__ = ("verify_id", "eye", "step_arcmin", "step_size")
    VERIFY_ID_FIELD_NUMBER: _ClassVar[int]
    EYE_FIELD_NUMBER: _ClassVar[int]
    STEP_ARCMIN_FIELD_NUMBER: _ClassVar[int]
    STEP_SIZE_FIELD_NUMBER: _ClassVar[int]
    verify_id: int
    eye: Eye
    step_arcmin: float
    step_size: float
    def __init__(self, verify_id: _Optional[int] = ..., eye: _Optional[_Union[Eye, str]] = ..., step_arcmin: _Optional[float] = ..., step_size: _Optional[float] = ...) -> None: ...

class Nudge(_message.Message):
    __slots__ = ("verify_id", "right_arcmin", "down_arcmin", "size", "fits", "t_headset_ns", "drawn")
    VERIFY_ID_FIELD_NUMBER: _ClassVar[int]
    RIGHT_ARCMIN_FIELD_NUMBER: _ClassVar[int]
    DOWN_ARCMIN_FIELD_NUMBER: _ClassVar[int]
    SIZE_FIELD_NUMBER: _ClassVar[int]
    FITS_FIELD_NUMBER: _ClassVar[int]
    T_HEADSET_NS_FIELD_NUMBER: _ClassVar[int]
    DRAWN_FIELD_NUMBER: _ClassVar[int]
    verify_id: int
    right_arcmin: float
    down_arcmin: float
    size: float
    fits: bool
    t_headset_ns: int
    drawn: bytes
    def __init__(self, verify_id: _Optional[int] = ..., right_arcmin: _Optional[float] = ..., down_arcmin: _Optional[float] = ..., size: _Optional[float] = ..., fits: _Optional[bool] = ..., t_headset_ns: _Optional[int] = ..., drawn: _Optional[bytes] = ...) -> None: ...

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
