import dataclasses
import io
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.types import Alignment
from handcal.session.alignment_file import decode_alignment, encode_alignment


def assert_identical(a: Alignment, b: Alignment) -> None:
    for name in ("cursor_m", "hand_m", "cursor_is_cut", "hand_is_cut", "rotation_rad"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
    assert {eye: T.tobytes() for eye, T in a.T_E_W.items()} == {
        eye: T.tobytes() for eye, T in b.T_E_W.items()
    }
    assert (a.eyes, a.t_a_ns, a.t_b_ns) == (b.eyes, b.t_a_ns, b.t_b_ns)


def test_an_alignment_comes_back_bit_for_bit(alignment: Alignment) -> None:
    assert_identical(decode_alignment(encode_alignment(alignment)), alignment)


def test_the_order_of_axes_in_memory_does_not_change_what_is_stored(alignment: Alignment) -> None:
    turned = dataclasses.replace(alignment, cursor_m=np.asfortranarray(alignment.cursor_m))
    assert encode_alignment(turned) == encode_alignment(alignment)


def test_odd_but_legal_alignments_come_back(alignment: Alignment) -> None:
    odd = dataclasses.replace(
        alignment,
        cursor_m=np.empty((0, 3)),
        cursor_is_cut=np.empty(0, bool),
        hand_m=np.array([[np.nan, -0.0, np.inf]]),
        hand_is_cut=np.array([True]),
        T_E_W={"left": np.eye(4)},
        eyes=("right", "left"),
    )
    assert_identical(decode_alignment(encode_alignment(odd)), odd)


def test_numpy_itself_reads_it(alignment: Alignment) -> None:
    with np.load(io.BytesIO(encode_alignment(alignment)), allow_pickle=False) as archive:
        assert np.array_equal(archive["hand_m"], alignment.hand_m)
        assert archive["eyes"].tolist() == ["right"]


@pytest.mark.parametrize("eyes", [["left", "left"], ["middle"], []])
def test_eyes_that_are_not_one_or_both_are_refused(alignment: Alignment, eyes: list[str]) -> None:
    with np.load(io.BytesIO(encode_alignment(alignment)), allow_pickle=False) as archive:
        arrays = dict(archive)
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **(arrays | {"eyes": np.array(eyes, "<U5")}))
    with pytest.raises(ValueError, match="one eye, or each of both once"):
        decode_alignment(stream.getvalue())


def archive_with(name: str, content: bytes, compression: int = zipfile.ZIP_STORED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        archive.writestr(name, content)
    return stream.getvalue()


def npy(array: object) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.asarray(array))
    return stream.getvalue()


def test_what_a_header_promises_is_not_allocated() -> None:
    lie = npy(np.zeros((1, 3))).replace(b"(1, 3), }       ", b"(9999999999, 3)}", 1)
    assert b"9999999999" in lie
    with pytest.raises(ValueError, match="damaged"):
        decode_alignment(archive_with("cursor_m.npy", lie))


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "damaged"),
        (archive_with("cursor_m.npy", b"not an array"), "magic string"),
        (archive_with("cursor_m.npy", npy(np.zeros((1, 3), np.float32))), "holds <f4, not <f8"),
        (archive_with("cursor_m.npy", npy(np.asfortranarray(np.zeros((2, 3))))), "C order"),
        (archive_with("stranger.npy", npy(np.zeros(3))), "not None"),
        (archive_with("cursor_m.npy", bytes(10**6), zipfile.ZIP_DEFLATED), "is compressed"),
        (archive_with("cursor_m.npy", npy(np.zeros(3)).replace(b"}", b" ")), "damaged"),
        (archive_with("cursor_m.npy", npy(np.zeros((1, 3)))), "has no array 't_ns'"),
    ],
)
def test_what_is_no_alignment_is_refused(data: bytes, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        decode_alignment(data)


@given(st.data())
def test_damage_is_refused_or_harmless(alignment: Alignment, data: st.DataObject) -> None:
    content = bytearray(encode_alignment(alignment))
    start = data.draw(st.integers(0, len(content)))
    end = data.draw(st.integers(start, min(start + 50, len(content))))
    content[start:end] = data.draw(st.binary(max_size=8))
    try:
        decoded = decode_alignment(bytes(content))
    except ValueError:
        return
    assert_identical(decoded, alignment)
