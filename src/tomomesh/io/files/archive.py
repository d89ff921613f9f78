"""Zip files: checked member by member, and unpacked where nobody else looks."""

from __future__ import annotations

import shutil
import stat
import zipfile
from contextlib import contextmanager
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from ...errors import NO_ROOM, FormatError, ResourceError, TomomeshError
from .limits import require_memory
from .private import private_folder
from .source import leaves_folder, third_party

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MOST_MEMBERS = 2**16
"""Most files of an archive: one more than zip can list without its extension of 64 bits."""

DIRECTORY_BYTES = 512 * MOST_MEMBERS
"""Longest table of contents, which is read into the memory whole: an entry has 46 bytes and its name."""

BOMB_RATIO = 500
"""An archive that promises more than this many times its own bytes is a bomb: deflate reaches 1,032, label maps stay
below."""

SMALL_BYTES = 2**26
"""Unpacked bytes from which on the ratio counts: what is smaller does no harm."""

TAIL_BYTES = 2**16 + 200
"""The table's length stands among the last bytes of an archive, before a comment of at most 64 KiB."""


@contextmanager
def unpacked_zip(path: Path) -> Iterator[Path]:
    """Unpack a zip file into a private folder, which is gone afterwards.

    Errors from inside name the archive in place of the folder.

    Parameters
    ----------
    path : Path
        The archive, as the user typed it.

    Raises
    ------
    FormatError
        For archives that are broken or encrypted, and members that leave the folder, or are links or devices.
    ResourceError
        For more files or bytes than the limits.
    """
    with private_folder() as folder:
        try:
            _unpack(path, folder)
            yield folder
        except TomomeshError as fault:
            fault.args = (str(fault).replace(f"{folder}/", f"{path}: ").replace(str(folder), str(path)),)
            raise


def _unpack(path: Path, folder: Path) -> None:
    _check_table(path)
    with third_party("zipfile", str(path)), zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
        for member in archive.infolist():
            _check_member(member, path)
        _check_size(members, path, folder)
        for member in members:
            _write(archive, member, folder, path)


def _check_table(path: Path) -> None:
    """Refuse a table of contents that is too long, before it is read."""
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - TAIL_BYTES, 0))
        tail = file.read()
    short, wide = tail.rfind(b"PK\x05\x06"), tail.rfind(b"PK\x06\x06")
    lengths = [int.from_bytes(tail[short + 12 : short + 16], "little")] if short >= 0 else []
    lengths += [int.from_bytes(tail[wide + 40 : wide + 48], "little")] if wide >= 0 else []
    known = [length for length in lengths if length != 2**32 - 1]
    if max(known, default=0) > DIRECTORY_BYTES:
        raise _too_much("table of contents", f"{max(known)} bytes", f"{DIRECTORY_BYTES} bytes", path)


def _check_member(member: zipfile.ZipInfo, path: Path) -> None:
    """Refuse what could be written outside of the folder, is no regular file, or cannot be read."""
    name, kind = member.filename, stat.S_IFMT(member.external_attr >> 16)
    if leaves_folder(name):
        raise _refused("a member of the archive would leave its folder", "names without .. and without a root", path)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise _refused("a member of the archive is a link or a device", "files and folders", path)
    if member.flag_bits & 1:
        raise _refused("the archive is encrypted", "files without a password", path, "the unpacked folder")


def _refused(what: str, expected: str, path: Path, hint: str = "") -> FormatError:
    return FormatError(what, file=str(path), expected=expected, hint=hint)


def _check_size(members: list[zipfile.ZipInfo], path: Path, folder: Path) -> None:
    """Compare what the archive promises with the limits, the memory and the disk."""
    promised, packed = sum(member.file_size for member in members), path.stat().st_size
    if len(members) > MOST_MEMBERS:
        raise _too_much("files", str(len(members)), str(MOST_MEMBERS), path)
    if promised > max(BOMB_RATIO * packed, SMALL_BYTES):
        raise _too_much("unpacked size", f"{promised} bytes", f"{BOMB_RATIO} times the archive's {packed} bytes", path)
    require_memory(promised, file=str(path))
    if promised > (free := shutil.disk_usage(folder).free):
        raise _too_much("unpacked size", f"{promised} bytes", f"{free} bytes, the free space for it", path)


def _too_much(field: str, found: str, limit: str, path: Path) -> ResourceError:
    return ResourceError(
        "the archive holds too much",
        file=str(path),
        found=f"{field} = {found}",
        expected=f"at most {limit}",
        hint="the unpacked folder of the series",
    )


def _write(archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path, path: Path) -> None:
    """Write a member; zipfile gives no more bytes than promised, and compares the check sum."""
    target = folder / PurePosixPath(member.filename.replace("\\", "/"))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(member) as packed, target.open("xb") as file:
            shutil.copyfileobj(packed, file, 2**20)
    except OSError as fault:
        if fault.errno in NO_ROOM:
            raise _too_much("unpacked size", "more than there is room for", "the free space", path) from None
        raise _refused("a member of the archive cannot be unpacked", "names that a folder can hold", path) from None
