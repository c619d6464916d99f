import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import LinkError
from handcal.link.invitation import (
    Invitation,
    qr_lines,
    qr_matrix,
    read_invitation,
)

CODE = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@pytest.mark.parametrize(
    ("host", "text"),
    [
        ("192.168.1.20", f"HANDCAL://192.168.1.20:47800/{CODE}"),
        ("lab-pc.local", f"HANDCAL://LAB-PC.LOCAL:47800/{CODE}"),
        ("fe80::1%eth0", f"HANDCAL://[FE80::1]:47800/{CODE}"),
    ],
)
def test_the_text_is_read_back_in_any_capitals(host: str, text: str) -> None:
    assert Invitation(host, 47800, CODE).text == text
    expected = Invitation(host.partition("%")[0], 47800, CODE)
    for form in (text, text.lower(), f" {text}\n", f"{text}?later=1"):
        assert read_invitation(form) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        CODE,
        "https://192.168.1.20:47800/" + CODE,
        f"HANDCAL://192.168.1.20/{CODE}",
        f"HANDCAL://192.168.1.20:0/{CODE}",
        f"HANDCAL://192.168.1.20:65536/{CODE}",
        f"HANDCAL://192.168.1.20:47800/{CODE[1:]}",
        f"HANDCAL://192.168.1.20:47800/{CODE[1:]}1",
        f"HANDCAL://fe80::1:47800/{CODE}",
    ],
)
def test_another_text_is_no_invitation(text: str) -> None:
    with pytest.raises(LinkError, match="not an invitation"):
        read_invitation(text)


@given(st.text())
def test_any_text_is_read_or_refused_in_one_line(text: str) -> None:
    with pytest.raises(LinkError) as error:
        read_invitation(text)
    assert "\n" not in str(error.value)


def test_a_reader_finds_the_text_in_the_code() -> None:
    # A given code: OpenCV's reader misses 1 of 240 random ones.
    text = Invitation("192.168.178.120", 47800, CODE).text
    modules = np.array(qr_matrix(text))
    image = np.kron(np.where(modules, 0, 255), np.ones((8, 8))).astype(np.uint8)
    assert cv2.QRCodeDetector().detectAndDecode(image)[0] == text
    assert not modules[:4].any()
    lines = qr_lines(text)
    above = [[half in "▀█" for half in line] for line in lines]
    below = [[half in "▄█" for half in line] for line in lines]
    assert np.array_equal(np.stack([above, below], 1).reshape(-1, len(modules))[:37], modules)
