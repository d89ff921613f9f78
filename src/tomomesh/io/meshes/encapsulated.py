"""DICOM Encapsulated STL: a mesh that an archive keeps beside the study that it was made from."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from ... import __version__
from ...errors import FormatError, TomomeshError, UsageError
from ..files.atomic import check_output, replacing
from ..files.source import third_party, unheard
from .attributes import MeshAttributes
from .pieces.parts import InOnePiece
from .stl import read_stl, stl_parts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from ...model.mesh import TriMesh
    from .cells import Arrays

ARCHIVED = (".dcm",)
"""Suffixes of meshes for an archive."""
UCUM = {name: name for name in ("nm", "um", "mm", "cm", "dm", "m", "km")} | {
    "[in_i]": "in", "[ft_i]": "ft", "[ft_us]": "us-ft", "[yd_i]": "yd",
}  # fmt: skip
"""Code of a unit of length to its name here (The Unified Code for Units of Measure, tables 1, 6 and 7)."""
ENCAPSULATED_STL = "1.2.840.10008.5.1.4.1.1.104.3"
MIME = "model/stl"
PLACE = ("StudyInstanceUID", "FrameOfReferenceUID", "PositionReferenceIndicator")
"""Fields of the study that say where the mesh belongs."""
PERSONAL = (
    "PatientName", "PatientID", "PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "StudyID",
    "AccessionNumber", "ReferringPhysicianName",
)  # fmt: skip
"""Fields of the study that an archive sorts by: empty where they are not asked for (type 2 of PS3.3)."""


def check_archived(study: Mapping[str, Any], *, file: str) -> None:
    """Refuse a study that no archive could find again.

    Parameters
    ----------
    study : mapping of str
        Fields of its header, as `Volume.dicom` holds them.
    file : str
        The output.

    Raises
    ------
    UsageError
        Where it is no DICOM, or names no frame of reference, or several.
    """
    lost = next((keyword for keyword in PLACE[:2] if not study.get(keyword)), "")
    if lost:
        told = "several" if lost in study else "missing"
        raise UsageError(
            "a mesh in the archive belongs to a DICOM study", file=file, found=f"{lost} = {told}",
            expected="a study of DICOM files that names its one frame of reference", hint="another format, as .stl",
        )  # fmt: skip


def write_encapsulated(mesh: TriMesh, path: str | Path, study: Mapping[str, Any], *, patient: bool = False) -> None:
    """Write a mesh as DICOM Encapsulated STL (PS3.3, A.85.1); the same mesh of the same study gives the same bytes.

    Parameters
    ----------
    mesh : TriMesh
        In millimeters, LPS: the coordinates of the study's own frame of reference.
    path : path
        ``.dcm``.
    study : mapping of str
        Fields of the study's header, as `Volume.dicom` holds them.
    patient : bool
        Whether the patient's and the study's personal fields are copied; they are empty otherwise.

    Raises
    ------
    UsageError
        For another suffix, and a study that no archive could find again.
    OutputError
        Where the file cannot be written, or 32 bits cannot keep the vertices apart.
    """
    check_output(path, ARCHIVED)
    check_archived(study, file=str(path))
    document = b"".join(stl_parts(InOnePiece(mesh), path, MeshAttributes("mm", "LPS", {}, {})))
    with replacing(path) as file, unheard("pydicom"):  # which tells of a patient's fields that break its rules
        data = _described(document, study, "named" if patient else "not named")
        for keyword in PERSONAL:
            setattr(data, keyword, study.get(keyword, "") if patient else "")
        data.save_as(file, enforce_file_format=True)


def _described(document: bytes, study: Mapping[str, Any], kind: str) -> Any:
    """Return the object that holds an STL file, without its personal fields; another kind is another instance."""
    from pydicom.dataset import Dataset, FileMetaDataset
    from pydicom.uid import ExplicitVRLittleEndian, generate_uid

    data = Dataset()
    data.SpecificCharacterSet = "ISO_IR 192"
    for keyword in PLACE:
        setattr(data, keyword, study.get(keyword, ""))
    entropy = [study["StudyInstanceUID"], study["FrameOfReferenceUID"], document.hex()]
    data.SOPClassUID, data.SOPInstanceUID = ENCAPSULATED_STL, generate_uid(entropy_srcs=[kind, *entropy])
    data.SeriesInstanceUID, data.SeriesNumber, data.InstanceNumber = generate_uid(entropy_srcs=entropy), 1, 1
    data.Modality, data.SeriesDescription, data.DocumentTitle = "M3D", "Surface mesh", "Surface mesh"
    data.Manufacturer = data.ManufacturerModelName = data.DeviceSerialNumber = "tomomesh"
    data.SoftwareVersions, data.BurnedInAnnotation = __version__, "NO"
    data.ContentDate = data.ContentTime = data.AcquisitionDateTime = ""
    data.ConceptNameCodeSequence, data.MeasurementUnitsCodeSequence = [], [_code("mm", "UCUM", "mm")]
    data.SourceInstanceSequence = [_reference(*one) for one in study.get("sources", ())]
    if data.SourceInstanceSequence and "SeriesInstanceUID" in study:
        data.ReferencedSeriesSequence = [_series(study["SeriesInstanceUID"], study["sources"])]
    data.MIMETypeOfEncapsulatedDocument, data.EncapsulatedDocumentLength = MIME, len(document)
    data.add_new("EncapsulatedDocument", "OB", document + b"\0" * (len(document) % 2))
    data.file_meta = FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    return data


def _code(value: str, scheme: str, meaning: str) -> Any:
    from pydicom.dataset import Dataset

    code = Dataset()
    code.CodeValue, code.CodingSchemeDesignator, code.CodeMeaning = value, scheme, meaning
    return code


def _reference(kind: str, instance: str) -> Any:
    from pydicom.dataset import Dataset

    source = Dataset()
    source.ReferencedSOPClassUID, source.ReferencedSOPInstanceUID = kind, instance
    return source


def _series(identifier: str, sources: Sequence[tuple[str, str]]) -> Any:
    from pydicom.dataset import Dataset

    series = Dataset()
    series.SeriesInstanceUID, series.ReferencedInstanceSequence = identifier, [_reference(*one) for one in sources]
    return series


def is_archived(path: str | Path) -> bool:
    """Tell whether a file is a DICOM Encapsulated STL; one that cannot be read is none."""
    import pydicom

    try:
        with third_party("pydicom", str(path)):
            found = pydicom.dcmread(path, force=True, specific_tags=["SOPClassUID"], stop_before_pixels=True)
            return str(found.get("SOPClassUID")) == ENCAPSULATED_STL
    except (TomomeshError, OSError):
        return False


def encapsulated_frame(data: bytes, file: str) -> dict[str, str]:
    """Return the unit and the frame of a DICOM Encapsulated STL: the standard's, LPS, whatever wrote it.

    The unit is one of `UCUM`, as micrometers, which dcmtk writes where it is not told; another, or none, is not named.
    """
    import pydicom

    with third_party("pydicom", file):
        found = pydicom.dcmread(io.BytesIO(data), force=True, specific_tags=["MeasurementUnitsCodeSequence"])
        code = next((str(item.get("CodeValue")) for item in found.get("MeasurementUnitsCodeSequence") or []), "")
    return {"frame": "LPS"} | ({"unit": UCUM[code]} if code in UCUM else {})


def read_encapsulated(data: bytes, file: str) -> Arrays:
    """Read the vertices and faces of a DICOM Encapsulated STL.

    Raises
    ------
    FormatError
        For DICOM that holds no STL, and STL that is broken.
    """
    import pydicom

    with third_party("pydicom", file):
        found = pydicom.dcmread(io.BytesIO(data), force=True)
        kind = str(found.get("MIMETypeOfEncapsulatedDocument") or "none")
        document = found.get("EncapsulatedDocument") or b""
        length = int(found.get("EncapsulatedDocumentLength") or len(document))
    if kind != MIME or not document:
        raise FormatError(
            "the DICOM file holds no mesh", file=file, found=f"MIMETypeOfEncapsulatedDocument = {kind}",
            expected=f"an Encapsulated STL, {MIME}", hint="tomomesh reconstruct, for slices and segmentations",
        )  # fmt: skip
    return read_stl(bytes(document[:length]), file)
