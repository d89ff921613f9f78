"""LZF, as PCD files have it."""

from __future__ import annotations


def decompress(data: bytes, size: int) -> bytes:
    """Return the bytes under an LZF stream (M. Lehmann's LibLZF).

    A control byte below 32 announces so many literal bytes, and one more. Any other is a copy of earlier output:
    its three upper bits, or one byte more where they are all set, hold the length less two, the lower five and
    the next byte how far back it begins, less one. A copy may run into its own output.

    Parameters
    ----------
    data : bytes
        The stream.
    size : int
        How many bytes it stands for.

    Raises
    ------
    ValueError
        Where the stream is cut off, points before its start, or stands for another number of bytes.
    """
    out, at = bytearray(), 0
    while at < len(data) and len(out) <= size:
        control = data[at]
        at += 1
        if control < 32:
            out += data[at : at + control + 1]
            at += control + 1
            continue
        extended = control >> 5 == 7
        low = data[at : at + 1 + extended]
        at += 1 + extended
        if len(low) <= extended:
            raise ValueError(at)
        _repeat(out, (control >> 5) + 2 + (low[0] if extended else 0), (control & 31) << 8 | low[-1])
    if len(out) != size:
        raise ValueError(size)
    return bytes(out)


def _repeat(out: bytearray, length: int, back: int) -> None:
    """Append bytes that begin `back` before the last one."""
    start = len(out) - back - 1
    if start < 0:
        raise ValueError(start)
    piece = out[start : start + length]
    out += (piece * (length // len(piece) + 1))[:length]
