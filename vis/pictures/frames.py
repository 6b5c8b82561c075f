"""Frames of a run for ParaView: VTU files and one PVD per run.

    frames/driven-0.1-seed1.pvd               every part over time
    frames/driven-0.1-seed1_grains_0000.vtu   grain centres as vertices, with their fields
    frames/driven-0.1-seed1_spike_0000.vtu    a body as a triangle mesh in place
    frames/tumble_row_forces_0000.vtu         points with vectors, for glyphs
    frames/tumble_surface_0000.vti            a height map: warped by its `height`, it lies where the grains' tops are
    frames/robot_grains_at_123000000.vtu      the one frame of a moment of its own, here 0.123 s

The default name, "frames", has no prefix: `frames/frames.pvd`, `frames/grains_0000.vtu`. Reals are float32, blocks are
zlib-compressed, in base64. Every file is written beside its place and moved there, the PVD last, so a run that is
killed leaves frames that open. The PVD ends with digests (SHA-256) of its list and of every file, which other programs
pass over: a damaged frame is refused by name.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid.digests import digest_of, digest_of_data

__all__ = [
    "BODIES", "GRAIN_FIELDS", "Frame", "FrameWriter", "Frames", "HeightMap", "check_frames", "frame_names",
    "frames_of", "grains_box",
    "read_frames",
]  # fmt: skip

#: The fields of a grain that a frame keeps: name -> (components, meaning and unit).
GRAIN_FIELDS: dict[str, tuple[int, str]] = {
    "radius": (1, "radius [m]"),
    "velocity": (3, "velocity [m/s]"),
    "force": (3, "sum of the contact forces [N]"),
    "coordination": (1, "contacts of the grain [1]"),
    "displacement": (3, "displacement since the start of the run [m]"),
    "id": (1, "number of the grain"),
}
BODIES = ("robot", "tumble")
"""Frames of a robot and of a platform. Older run folders have those of a robot as `tumble`."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]*\Z")
_DIGESTS = "Digests"
_OWN = re.compile(r"_at_\d+\.vt[ui]\Z")  # End of the files of a frame of a moment of its own
Body = tuple[ArrayLike, ArrayLike]
Cloud = tuple[ArrayLike, Mapping[str, ArrayLike]]
Points = NDArray[np.float32]
Fields = dict[str, NDArray[Any]]
Faces = NDArray[np.int64]
_Part = tuple[str, Points, Fields, Faces | None]


@dataclass(frozen=True)
class HeightMap:
    """Values on a level grid.

    ``origin``: x and y of the first point [m]. ``spacing``: Between points along x and y [m]. ``fields``: Name ->
    values, shape (points along y, points along x). `height` [m] is what a viewer warps by.
    """

    origin: tuple[float, float]
    spacing: tuple[float, float]
    fields: Fields


class FrameWriter:
    """Writes the frames of one run.

    ``folder``: The run folder; frames go to its `frames/`. ``name``: The run's id, also the PVD's name. ``resume``:
    Continue an existing series; otherwise the old frames of this name are removed. ``keep_until``: With `resume`,
    frames later than this time [s] are removed and will be written again. Raises ValueError: a name that is no plain
    file name; `keep_until` without `resume`; a PVD that cannot be read or is damaged.
    """

    def __init__(
        self, folder: str | Path, *, name: str = "frames", resume: bool = False, keep_until: float | None = None
    ) -> None:
        if not _NAME.match(name):
            raise ValueError(f"name is {name!r}; a run is named with letters, digits and . _ + - only")
        if keep_until is not None and not resume:
            raise ValueError("keep_until is given without resume=True")
        self.folder = Path(folder) / "frames"
        self.name = name
        self.folder.mkdir(parents=True, exist_ok=True)
        self._prefix = "" if name == "frames" else f"{name}_"
        old = _read_pvd(self.path) if self.path.exists() else []
        limit = -np.inf if not resume else np.inf if keep_until is None else keep_until
        limit += 1e-9 * abs(limit) if np.isfinite(limit) else 0.0
        self._entries = [entry for entry in old if entry.time <= limit]
        if old:
            self._write_pvd()  # first the list, then the files: no list ever names a file that is gone
            kept = {entry.file for entry in self._entries}
            for entry in old:
                if entry.file not in kept:
                    (self.folder / entry.file).unlink(missing_ok=True)

    @property
    def path(self) -> Path:
        """The PVD file."""
        return self.folder / f"{self.name}.pvd"

    @property
    def times(self) -> list[float]:
        """Times of the frames written so far [s]."""
        return sorted({entry.time for entry in self._entries})

    def write(
        self,
        time: float,
        grains: Mapping[str, ArrayLike],
        bodies: Mapping[str, Body] | None = None,
        *,
        values: Mapping[str, float] | None = None,
        clouds: Mapping[str, Cloud] | None = None,
        maps: Mapping[str, HeightMap] | None = None,
        own_moment: bool = False,
    ) -> Path:
        """Write one frame.

        ``time``: Time [s], on the clock of the run's series, not before the last frame. A frame at the last frame's
        time takes its place (a run resumed from a checkpoint may write that frame again). ``grains``: `position` [m],
        shape (n, 3), and any of `GRAIN_FIELDS`; a vector field may be given as its magnitude, shape (n,). ``bodies``:
        Name -> (points [m], shape (n, 3), triangles, shape (m, 3)). ``values``: Scalars of this frame, such as depth
        [m] and force [N]. ``clouds``: Name -> (points [m], shape (n, 3), fields), a field of shape (n,) or (n, 3): what
        glyphs are of. ``maps``: Name -> height map. ``own_moment``: Whether it takes the place of the last such frame.
        A run has one beside those at even times. Returns the PVD file. Raises ValueError: a time before the last
        frame's, arrays of unequal length or wrong shape, values that are not finite, an unknown grain field.
        """
        time = float(time)
        last = self._entries[-1].time if self._entries else -np.inf
        again = abs(time - last) <= 1e-9 * abs(last) if self._entries else False
        if not np.isfinite(time) or (time < last and not again):
            raise ValueError(f"time is {time!r}; it must be finite and not before the last frame's, {last!r}")
        scalars = {"TimeValue": time, **{key: float(value) for key, value in (values or {}).items()}}
        before = [entry for entry in self._entries if not again or entry.time != last]
        if own_moment:
            before = [entry for entry in before if not _OWN.search(entry.file)]
        even = len({entry.time for entry in before if not _OWN.search(entry.file)})
        index = f"at_{round(1e9 * time):09d}" if own_moment else f"{even:04d}"
        parts: list[_Part] = [("grains", *_grain_arrays(grains), None)]
        for body, (points, triangles) in (bodies or {}).items():
            parts.append((body, *_body_arrays(body, points, triangles)))
        for cloud, (points, fields) in (clouds or {}).items():
            parts.append((cloud, *_cloud_arrays(cloud, points, fields), None))
        for key in [*(bodies or {}), *(clouds or {}), *(maps or {})]:
            if key == "grains" or not _NAME.match(key):
                raise ValueError(f"a part is named {key!r}; letters, digits and . _ + - only, and not 'grains'")
        fresh = []
        for part, (name, positions, fields, faces) in enumerate(parts):
            file = f"{self._prefix}{name}_{index}.vtu"
            _write_vtu(self.folder / file, positions, fields, faces, scalars)
            fresh.append(_Entry(time, part, name, file, digest_of(self.folder / file)))
        for name, grid in (maps or {}).items():
            file = f"{self._prefix}{name}_{index}.vti"
            _write_vti(self.folder / file, name, grid, scalars)
            fresh.append(_Entry(time, len(fresh), name, file, digest_of(self.folder / file)))
        gone = {entry.file for entry in self._entries} - {entry.file for entry in before + fresh}
        self._entries = before + fresh
        self._write_pvd()
        for file in gone:
            (self.folder / file).unlink(missing_ok=True)
        return self.path

    def _write_pvd(self) -> None:
        root = ElementTree.Element("VTKFile", type="Collection", version="1.0", byte_order="LittleEndian")
        collection = ElementTree.SubElement(root, "Collection")
        for entry in self._entries:
            place = {"timestep": repr(entry.time), "group": self.name, "part": str(entry.part)}
            ElementTree.SubElement(collection, "DataSet", place, name=entry.name, file=entry.file)
        digests = ElementTree.SubElement(root, _DIGESTS, list=_digest_of_list(self._entries))
        for entry in self._entries:
            ElementTree.SubElement(digests, "File", name=entry.file, sha256=entry.digest)
        ElementTree.indent(root)
        temporary = self.path.with_name(self.path.name + ".part")
        temporary.write_text('<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n")
        temporary.replace(self.path)


@dataclass(frozen=True)
class Frame:
    """One written frame of a run.

    ``time``: Time [s]. ``grains``: `position` [m], shape (n, 3), and the fields of `GRAIN_FIELDS` that were written.
    The others as `FrameWriter.write` takes them.
    """

    time: float
    grains: Fields
    bodies: dict[str, tuple[NDArray[np.float64], Faces]]
    values: dict[str, float]
    clouds: dict[str, tuple[NDArray[np.float64], Fields]] = field(default_factory=dict)
    maps: dict[str, HeightMap] = field(default_factory=dict)


class Frames(Sequence[Frame]):
    """The frames of one run; a frame is read from disk at its use."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder = folder
        self.name = name
        self._by_time: dict[float, list[_Entry]] = {}
        for entry in _read_pvd(folder / f"{name}.pvd"):
            self._by_time.setdefault(entry.time, []).append(entry)
        self.times = np.array(sorted(self._by_time))

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        time = float(self.times[index])
        grains: Fields = {"position": np.zeros((0, 3))}
        bodies, values = {}, {}
        clouds: dict[str, tuple[NDArray[np.float64], Fields]] = {}
        maps: dict[str, HeightMap] = {}
        for entry in self._by_time[time]:
            if entry.file.endswith(".vti"):
                maps[entry.name] = _read_vti(self._whole(entry))
                continue
            points, triangles, fields, scalars = _read_vtu(self._whole(entry))
            values.update(scalars)
            if entry.name == "grains":
                grains = {"position": points, **fields}
            elif len(triangles):
                bodies[entry.name] = (points, triangles)
            else:
                clouds[entry.name] = (points, fields)
        values.pop("TimeValue", None)
        return Frame(time, grains, bodies, values, clouds, maps)

    def check(self) -> None:
        """Raise ValueError, naming the file, for a file that has changed since it was written."""
        for entries in self._by_time.values():
            for entry in entries:
                self._whole(entry)

    def _whole(self, entry: _Entry) -> Path:
        """The file of an entry. Raises ValueError where it has changed since it was written."""
        path = self.folder / entry.file
        if entry.digest and path.is_file() and digest_of(path) != entry.digest:
            raise ValueError(f"{path}: is not as the run wrote it: its digest differs from that in {self.name}.pvd")
        return path


def read_frames(folder: str | Path, name: str = "frames") -> Frames:
    """Frames of the run `name` in a run folder, by increasing time.

    Raises FileNotFoundError: the run has no frames. ValueError: its PVD, or when a frame is asked for its VTU, cannot
    be read.
    """
    return Frames(Path(folder) / "frames", name)


def frame_names(folder: str | Path) -> list[str]:
    """Ids of the runs that have frames in a run folder, sorted."""
    return sorted(path.stem for path in (Path(folder) / "frames").glob("*.pvd"))


def frames_of(folder: str | Path) -> str | None:
    """Name of the frames of a platform or robot in a run folder, of `BODIES`; None where there are none."""
    found = frame_names(folder)
    return next((name for name in BODIES if name in found), None)


def check_frames(folder: str | Path) -> None:
    """Raise ValueError, naming the file, for a frame of a run folder that is not as the run wrote it."""
    for name in frame_names(folder):
        read_frames(folder, name).check()


def grains_box(frame: Frame) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of what the grains of a frame fill [m]."""
    position, radius = frame.grains["position"], frame.grains["radius"][:, None]
    return (position - radius).min(axis=0), (position + radius).max(axis=0)


@dataclass(frozen=True)
class _Entry:
    time: float
    part: int
    name: str
    file: str
    digest: str = ""  # of the file; empty in a PVD of an earlier version


def _digest_of_list(entries: Sequence[_Entry]) -> str:
    return digest_of_data([[entry.time, entry.part, entry.name, entry.file, entry.digest] for entry in entries])


def _read_pvd(path: Path) -> list[_Entry]:
    """The entries of a PVD, by time and part. Raises ValueError for one that cannot be read or is damaged."""
    try:
        root = ElementTree.parse(path).getroot()
        own = root.find(_DIGESTS)
        digests = {} if own is None else {file.attrib["name"]: file.attrib["sha256"] for file in own}
        entries = []
        for found in root.iter("DataSet"):
            at, part, file = float(found.attrib["timestep"]), int(found.attrib["part"]), found.attrib["file"]
            entries.append(_Entry(at, part, found.attrib.get("name", "grains"), file, digests.get(file, "")))
        if own is not None and own.attrib["list"] != _digest_of_list(entries):
            raise ValueError("the digest of its list differs")
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise ValueError(
            f"{path} is no PVD file of ours, or is damaged: {error}; without it the run has no frames of this name"
        ) from error
    return sorted(entries, key=lambda entry: (entry.time, entry.part))


def _grain_arrays(grains: Mapping[str, ArrayLike]) -> tuple[Points, Fields]:
    if "position" not in grains:
        raise ValueError("grains has no 'position'")
    position = _checked("position", grains["position"], (3,))
    fields: Fields = {}
    for key, given in grains.items():
        if key in ("position", "spin"):  # spin is not kept: a sphere looks the same
            continue
        if key not in GRAIN_FIELDS:
            raise ValueError(f"grains has the field {key!r}; a frame keeps {', '.join(GRAIN_FIELDS)}")
        array = _checked(key, given, (1, GRAIN_FIELDS[key][0]))
        if len(array) != len(position):
            raise ValueError(f"grains[{key!r}] has {len(array)} rows for {len(position)} positions")
        fields[key] = array.astype(np.int32) if key in ("id", "coordination") else array
    return position, fields


def _body_arrays(body: str, points: ArrayLike, triangles: ArrayLike) -> tuple[Points, Fields, Faces]:
    corners = _checked(body, points, (3,))
    faces = np.ascontiguousarray(triangles, dtype=np.int64)
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"the triangles of {body!r} have shape {faces.shape}; it must be (m, 3)")
    if faces.size and (faces.min() < 0 or faces.max() >= len(corners)):
        raise ValueError(f"the triangles of {body!r} name points beyond its {len(corners)}")
    return corners, {}, faces


def _cloud_arrays(cloud: str, points: ArrayLike, fields: Mapping[str, ArrayLike]) -> tuple[Points, Fields]:
    at = _checked(cloud, np.asarray(points, dtype=float).reshape(-1, 3), (3,))
    found: Fields = {}
    for key, given in fields.items():
        array = _checked(f"{cloud} {key}", given, (1, 3)) if len(at) else np.asarray(given, dtype=np.float32)
        if len(array) != len(at):
            raise ValueError(f"{key!r} of {cloud!r} has {len(array)} rows for {len(at)} points")
        found[key] = array
    return at, found


def _checked(name: str, given: ArrayLike, columns: tuple[int, ...]) -> Points:
    array = np.ascontiguousarray(given, dtype=np.float32)
    width = 1 if array.ndim == 1 else array.shape[1] if array.ndim == 2 else 0
    if width not in columns:
        raise ValueError(
            f"{name!r} has shape {array.shape}; its rows must have {' or '.join(map(str, columns))} numbers"
        )
    if not np.isfinite(array).all():
        raise ValueError(f"{name!r} has values that are not finite")
    return array


def _write_vtu(path: Path, points: Points, fields: Fields, faces: Faces | None, values: Mapping[str, float]) -> None:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import VTK_TRIANGLE, VTK_VERTEX, vtkCellArray, vtkUnstructuredGrid
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    cells = np.arange(len(points), dtype=np.int64).reshape(-1, 1) if faces is None else faces
    grid = vtkUnstructuredGrid()
    vertices = vtkPoints()
    vertices.SetData(numpy_to_vtk(points, deep=True))
    grid.SetPoints(vertices)
    polygons = vtkCellArray()
    offsets = np.arange(len(cells) + 1, dtype=np.int32) * cells.shape[1]
    polygons.SetData(numpy_to_vtk(offsets, deep=True), numpy_to_vtk(cells.astype(np.int32).ravel(), deep=True))
    grid.SetCells(VTK_VERTEX if faces is None else VTK_TRIANGLE, polygons)
    _write_xml(path, vtkXMLUnstructuredGridWriter(), grid, fields, values)


def _write_vti(path: Path, name: str, grid: HeightMap, values: Mapping[str, float]) -> None:
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    shapes = {np.shape(field) for field in grid.fields.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 2:
        raise ValueError(f"the fields of {name!r} have shapes {sorted(shapes)}; they must share one, (ny, nx)")
    rows, columns = next(iter(shapes))
    image = vtkImageData()
    image.SetDimensions(columns, rows, 1)
    image.SetOrigin(*grid.origin, 0.0)
    image.SetSpacing(*grid.spacing, 1.0)
    flat = {key: np.ascontiguousarray(field, dtype=np.float32).ravel() for key, field in grid.fields.items()}
    _write_xml(path, vtkXMLImageDataWriter(), image, flat, values)


def _write_xml(path: Path, writer: Any, content: Any, fields: Fields, values: Mapping[str, float]) -> None:
    """Write content with fields of its points and values of the whole into a neighbour first: a file there is whole.

    Raises OSError where it cannot.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk

    scalars = {name: np.array([value]) for name, value in values.items()}
    for attributes, arrays in ((content.GetPointData(), fields), (content.GetFieldData(), scalars)):
        for name, array in arrays.items():
            data = numpy_to_vtk(array, deep=True)
            data.SetName(name)
            attributes.AddArray(data)
    temporary = path.with_name(path.name + ".part")
    writer.SetFileName(str(temporary))
    writer.SetInputData(content)
    # Not appended raw, a quarter smaller: meshio 5.3.5 cannot read that on Pythons whose base64 reads on after padding.
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()
    if not writer.Write():
        raise OSError(f"{temporary} could not be written")
    temporary.replace(path)


def _read(path: Path, reader: Any, kind: str) -> tuple[Any, Fields]:
    """What VTK's `reader` finds in a file of its kind, and the fields of its points. Raises ValueError for another."""
    if not path.exists():
        raise ValueError(f"{path} is missing though its PVD lists it")
    if not reader.CanReadFile(str(path)):
        raise ValueError(f"{path} is no {kind} file")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader.SetFileName(str(path))
    reader.Update()
    found = reader.GetOutput()
    data = found.GetPointData()
    arrays = (data.GetArray(i) for i in range(data.GetNumberOfArrays()))
    return found, {array.GetName(): vtk_to_numpy(array).copy() for array in arrays}


def _read_vti(path: Path) -> HeightMap:
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    image, fields = _read(path, vtkXMLImageDataReader(), "VTI")
    columns, rows, _ = image.GetDimensions()
    shaped = {name: field.reshape(rows, columns) for name, field in fields.items()}
    return HeightMap(image.GetOrigin()[:2], image.GetSpacing()[:2], shaped)


def _read_vtu(path: Path) -> tuple[NDArray[np.float64], Faces, Fields, dict[str, float]]:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    grid, fields = _read(path, vtkXMLUnstructuredGridReader(), "VTU")
    points = vtk_to_numpy(grid.GetPoints().GetData()).astype(np.float64)
    links = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).astype(np.int64)
    triangles = links.reshape(-1, 3) if len(links) == 3 * grid.GetNumberOfCells() else np.zeros((0, 3), int)
    extra = grid.GetFieldData()
    values = {extra.GetArrayName(i): float(extra.GetArray(i).GetTuple1(0)) for i in range(extra.GetNumberOfArrays())}
    return points, triangles, fields, values
