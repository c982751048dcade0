"""Image files: size from the header alone, depth in millimetres, colour as RGB."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from sixd.datasets.spec import Size
from sixd.errors import FormatError, MissingDataError, Problem


def image_size_px(path: Path) -> Size:
    """``(width, height)`` of a PNG, JPEG or TIFF, from its first bytes.

    Raises:
        MissingDataError: the file cannot be read.
        FormatError: it is none of the three, or its header is broken.
    """
    try:
        with path.open("rb") as file:
            size = _size(file)
    except OSError as error:
        raise MissingDataError(f"{path}: {error.strerror}") from error
    except (struct.error, ValueError, IndexError):
        size = None
    if size is None or min(size) < 1:
        raise _broken(path, "has no readable header", "a PNG, JPEG or TIFF image")
    return size


def read_depth_mm(path: Path, depth_scale: float) -> NDArray[np.float32]:
    """Depth ``(H, W)`` in millimetres, 0 where the sensor gave none.

    ``float32(stored value) * float32(depth_scale)``, as the BOP rules have it.

    Raises:
        MissingDataError: there is no such file.
        FormatError: it cannot be decoded, has colour channels, or values that are not finite.
    """
    stored = _decode(path)
    if stored.ndim != 2:
        got = f"{stored.shape[2]} channels"
        raise _broken(path, "is not a depth image", "one channel of 16 bits", got)
    if stored.dtype.kind == "f" and not np.isfinite(stored).all():
        got = f"{int((~np.isfinite(stored)).sum())} pixels are not"
        raise _broken(path, "holds NaN or infinity", "finite depth, 0 where there is none", got)
    depth_mm = stored.astype(np.float32)
    depth_mm *= np.float32(depth_scale)
    return depth_mm


def read_image(path: Path) -> NDArray[np.uint8]:
    """Colour ``(H, W, 3)`` as RGB, or grey ``(H, W)``, as the file has it; alpha is dropped.

    Raises:
        MissingDataError: there is no such file.
        FormatError: it cannot be decoded, or has more than 8 bits a channel.
    """
    import cv2

    stored = _decode(path)
    if stored.dtype != np.uint8:
        raise _broken(path, "is not an 8-bit image", "uint8", str(stored.dtype))
    image = stored.astype(np.uint8, copy=False)
    if image.ndim == 2:
        return image
    code = cv2.COLOR_BGR2RGB if image.shape[2] == 3 else cv2.COLOR_BGRA2RGB
    return np.asarray(cv2.cvtColor(image, code), np.uint8)


def _decode(path: Path) -> NDArray[np.generic]:
    import cv2

    try:
        raw = path.read_bytes()
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise MissingDataError(f"{path}: {reason}") from error
    # OpenCV fills what a cut-off file lacks with zeros, which would read as "no depth here".
    if _is_cut_off(raw):
        raise _broken(path, "was cut off", "the image to its end", f"{len(raw)} bytes")
    flags = (
        cv2.IMREAD_UNCHANGED
    )  # which also leaves EXIF rotation alone, as K belongs to the pixels
    try:
        image = cv2.imdecode(np.frombuffer(raw, np.uint8), flags) if raw else None
    except cv2.error:
        image = None
    if image is None:
        raise _broken(path, "cannot be decoded", "a PNG, JPEG or TIFF image")
    decoded: NDArray[np.generic] = image
    return decoded


def _is_cut_off(raw: bytes) -> bool:
    if raw.startswith(b"\x89PNG"):
        return b"IEND" not in raw[-64:]
    if raw.startswith(b"\xff\xd8"):
        return b"\xff\xd9" not in raw[-64:]
    return False


def _broken(path: Path, what: str, expected: str, got: str = "") -> FormatError:
    fix = "restore the file from the archive it came from"
    return FormatError(
        [Problem("bad-image", what, file=str(path), expected=expected, got=got, fix=fix)]
    )


def _size(file: BinaryIO) -> Size | None:
    head = file.read(26)
    if head.startswith(b"\x89PNG\r\n\x1a\n") and head[12:16] == b"IHDR":
        width, height = struct.unpack(">II", head[16:24])
        return width, height
    if head.startswith(b"\xff\xd8"):
        return _jpeg_size(file)
    if head[:4] in (b"II*\x00", b"MM\x00*"):
        return _tiff_size(file, "<" if head.startswith(b"II") else ">")
    return None


def _jpeg_size(file: BinaryIO) -> Size | None:
    """The first frame header (SOF0 to SOF15 without DHT, JPG, DAC) has the size. ITU T.81, B.2."""
    file.seek(2)
    while marker := file.read(2):
        if marker[0] != 0xFF:
            return None
        if marker[1] == 0xFF:  # fill byte
            file.seek(-1, 1)
            continue
        (length,) = struct.unpack(">H", file.read(2))
        if 0xC0 <= marker[1] <= 0xCF and marker[1] not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">xHH", file.read(5))
            return width, height
        file.seek(length - 2, 1)
    return None


def _tiff_size(file: BinaryIO, order: str) -> Size | None:
    """Tags 256 and 257 of the first directory. TIFF 6.0, section 2."""
    file.seek(4)
    file.seek(struct.unpack(order + "I", file.read(4))[0])
    found: dict[int, int] = {}
    for _ in range(struct.unpack(order + "H", file.read(2))[0]):
        tag, kind, _count, value = struct.unpack(order + "HHI4s", file.read(12))
        if tag in (256, 257):
            found[tag] = struct.unpack(order + ("Hxx" if kind == 3 else "I"), value)[0]
    return (found[256], found[257]) if len(found) == 2 else None
