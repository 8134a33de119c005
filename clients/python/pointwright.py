"""A client of pointwrightd, the service that edits point clouds at several scales.

One file on `requests`; numpy only where samples are decoded. Python 3.9 and later.

    from pointwright import Client, box, translation

    client = Client("http://127.0.0.1:8080")
    session = client.upload("scan.ply").open_session(name="Arm")
    session.paint("zero", box((-1, -1, -1), (0, 1, 1)))
    session.paint("one", box((0.5, -1, -1), (1, 1, 1)))
    session.edit(translation((0, 0, 0.1)))
    session.download("edited.ply")

Every refusal of the server is a `Problem`, by its status of one of the subclasses below. Requests are made again, after
a growing pause or the one that Retry-After asks for, where the server is overloaded (429, 503) and where the connection
failed and a repetition does no harm.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json as json_module
import os
import random
import struct
import time
import urllib.parse
import uuid
from typing import IO, Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import requests  # type: ignore[import]

try:
    import numpy
except ImportError:  # everything but Frame's and Surface's arrays works without
    numpy = None  # type: ignore[assignment]

__version__ = "0.1.0"

Document = Dict[str, Any]
Vector = Sequence[float]
Progress = Callable[[float], None]
BuildProgress = Callable[[str, float], None]

DEFAULT_URL = "http://127.0.0.1:8080"
FRAME_TYPE = "application/vnd.pointwright.frame"
#: Files from this size on are uploaded in resumable parts where the server can take them.
RESUMABLE_BYTES = 32 << 20
#: In the place of a revision: change whatever is there.
ANY = "*"


# --- errors ---------------------------------------------------------------------------------------------------------


class PointwrightError(Exception):
    """Everything that this module raises of itself."""


class Unreachable(PointwrightError):
    """The server cannot be reached, or the connection broke and repeating the request might have done it twice."""


class WaitedTooLong(PointwrightError):
    """What was waited for did not happen in the time given; it may still happen."""


class BadFrame(PointwrightError):
    """Bytes that are not a sample frame, or a stream that was cut off."""


class Problem(PointwrightError):
    """A refusal of the server (RFC 9457). Members that the server did not give are None, `errors` is then empty."""

    def __init__(self, document: Mapping[str, Any], retry_after: Optional[float] = None) -> None:
        self.document: Document = dict(document)
        self.type: str = str(document.get("type", "about:blank"))
        self.title: str = str(document.get("title", ""))
        self.status: int = int(document.get("status", 0))
        self.detail: Optional[str] = document.get("detail")
        self.instance: Optional[str] = document.get("instance")
        self.request_id: Optional[str] = document.get("request_id")
        #: [{"pointer": RFC 6901, "detail": text}], every member at fault
        self.errors: List[Dict[str, str]] = list(document.get("errors") or [])
        self.limit: Optional[float] = document.get("limit")
        self.actual: Optional[float] = document.get("actual")
        #: Of a stale revision: the current one
        self.revision: Optional[int] = document.get("revision")
        #: Seconds after which the server says to try again
        self.retry_after = retry_after
        super().__init__(self.detail or self.title or f"the server answered {self.status}")

    @property
    def slug(self) -> str:
        """The last part of the type, like "stale-revision"."""
        return self.type.rsplit("/", 1)[-1]


class Malformed(Problem):
    """400"""


class Unauthorized(Problem):
    """401: no token, or one that the server does not know"""


class Forbidden(Problem):
    """403: the token does not reach so far"""


class NotFound(Problem):
    """404 and 410"""


class NotSupported(NotFound):
    """The server does not have this part of the interface."""


class Conflict(Problem):
    """409: not in this state"""


class StaleRevision(Problem):
    """412: the session has moved on; `revision` is the current one"""


class TooLarge(Problem):
    """413: beyond `limit`"""


class UnsupportedFormat(Problem):
    """415"""


class Invalid(Problem):
    """422: `errors` has every member at fault"""


class RevisionRequired(Problem):
    """428"""


class QuotaReached(Problem):
    """429 that waiting does not lift: something must be deleted first"""


class Overloaded(Problem):
    """429 and 503, after all repetitions"""


class OutOfSpace(Problem):
    """507"""


class ServerError(Problem):
    """Any other 5xx"""


class BuildFailed(Problem):
    """A session that could not be built, with the problem that its document tells"""


class JobFailed(Problem):
    """A job that failed or was dismissed"""


_BY_STATUS = {
    400: Malformed, 401: Unauthorized, 403: Forbidden, 404: NotFound, 409: Conflict, 410: NotFound, 412: StaleRevision,
    413: TooLarge, 415: UnsupportedFormat, 422: Invalid, 428: RevisionRequired, 429: Overloaded, 503: Overloaded,
    507: OutOfSpace,
}  # fmt: skip


def _problem_of(response: requests.Response) -> Problem:
    document: Document = {}
    try:
        parsed = response.json()
        if isinstance(parsed, dict):
            document = parsed
    except ValueError:
        pass  # a proxy's own page, or nothing at all
    if "title" not in document:
        document = {"title": response.reason or f"the server answered {response.status_code}"}
    document.setdefault("status", response.status_code)
    kind = _BY_STATUS.get(response.status_code, ServerError if response.status_code >= 500 else Problem)
    problem = kind(document, _retry_after(response))
    # Where time lifts it, the server says when to come again; proxies need not.
    if response.status_code == 429 and problem.slug == "too-many" and problem.retry_after is None:
        return QuotaReached(document)
    return problem


def _retry_after(response: requests.Response) -> Optional[float]:
    try:
        return max(0.0, float(response.headers.get("Retry-After", "")))
    except ValueError:
        return None


# --- shapes, operations, deformations -------------------------------------------------------------------------------


def _vector(values: Vector) -> List[float]:
    return [float(value) for value in values]


def _given(**members: Any) -> Document:
    """The members that are not None."""
    return {name: value for name, value in members.items() if value is not None}


def sphere(center: Vector, radius: float) -> Document:
    """Everything in a ball."""
    return {"type": "sphere", "center": _vector(center), "radius": float(radius)}


def stroke(vertices: Sequence[Vector], radius: float) -> Document:
    """Everything within the radius of a polyline."""
    return {"type": "stroke", "vertices": [_vector(v) for v in vertices], "radius": float(radius)}


def box(minimum: Vector, maximum: Vector) -> Document:
    """Everything in a box along the axes."""
    return {"type": "box", "min": _vector(minimum), "max": _vector(maximum)}


def half_space(point: Vector, normal: Vector) -> Document:
    """The side of a plane that its normal points to."""
    return {"type": "half_space", "point": _vector(point), "normal": _vector(normal)}


def everything() -> Document:
    """All samples."""
    return {"type": "all"}


def points(
    places: Sequence[Vector], radius: Optional[float] = None, radii: Optional[Sequence[float]] = None
) -> Document:
    """Everything within a radius of any of the places: one for all of them, or one for each."""
    if (radius is None) == (radii is None):
        raise ValueError("one of radius and radii")
    sizes = None if radii is None else _vector(radii)
    return {"type": "points", "points": [_vector(p) for p in places], **_given(radius=radius, radii=sizes)}


def polygon(vertices: Sequence[Vector]) -> Document:
    """A lasso in normalised device coordinates, closed by itself."""
    return {"type": "polygon", "vertices": [_vector(v) for v in vertices]}


def ellipse(center: Vector, half_axes: Vector) -> Document:
    """An ellipse in normalised device coordinates."""
    return {"type": "ellipse", "center": _vector(center), "half_axes": _vector(half_axes)}


def polyline(vertices: Sequence[Vector], width: float) -> Document:
    """Everything within half the width of a line in normalised device coordinates."""
    return {"type": "polyline", "vertices": [_vector(v) for v in vertices], "width": float(width)}


def _matrix(rows: Sequence[Any]) -> List[float]:
    """16 numbers, row after row, from themselves or from four rows."""
    flat: List[float] = []
    for row in rows:
        if hasattr(row, "__len__"):
            flat.extend(float(value) for value in row)
        else:
            flat.append(float(row))
    if len(flat) != 16:
        raise ValueError("a matrix has 16 numbers")
    return flat


def screen(view: Sequence[Any], outline: Document, visible: bool = False) -> Document:
    """Everything that a view (model to clip space) projects into a polygon, ellipse or polyline."""
    shape: Document = {"type": "screen", "view": _matrix(view), "outline": outline}
    return {**shape, "visible": True} if visible else shape


def texture(repeat: bool = False) -> Document:
    """An image laid by the samples' texture coordinates."""
    return {"type": "texture", "repeat": bool(repeat)}


def planar(origin: Vector, u: Vector, v: Vector, depth: Optional[Vector] = None) -> Document:
    """An image laid on a plane: its lower left corner, whole width and whole height."""
    reach = None if depth is None else _vector(depth)
    return {"type": "planar", "origin": _vector(origin), "u": _vector(u), "v": _vector(v), **_given(depth=reach)}


def image(
    image_id: str, projection: Document, *, channel: str = "luminance", threshold: float = 0.5, side: str = "above"
) -> Document:
    """Everything whose value in an image is on one side of a threshold."""
    return {
        "type": "image", "image": image_id, "channel": channel, "threshold": float(threshold), "side": side,
        "projection": projection,
    }  # fmt: skip


_IDENTITY = (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1)


def model(cloud: Union[str, "Cloud"], thickness: float, matrix: Sequence[Any] = _IDENTITY) -> Document:
    """Everything within a distance of a sample of another cloud, once the matrix has moved it."""
    identity = cloud if isinstance(cloud, str) else cloud.id
    return {"type": "model", "cloud": identity, "matrix": _matrix(matrix), "thickness": float(thickness)}


def region(name: str) -> Document:
    """The samples that a region of the session has when it is painted: "zero", "one", or one under another name."""
    return {"type": "region", "region": name}


def _shaped(mode: str, shape: Document, facing: Optional[Vector], steal: bool) -> Document:
    direction = None if facing is None else _vector(facing)
    return {"mode": mode, "shape": shape, **_given(facing=direction, steal=True if steal else None)}


def add(shape: Document, *, facing: Optional[Vector] = None, steal: bool = False) -> Document:
    """Samples in the shape join the region; with `steal` they leave the other one."""
    return _shaped("add", shape, facing, steal)


def remove(shape: Document, *, facing: Optional[Vector] = None) -> Document:
    """Samples in the shape leave the region."""
    return _shaped("remove", shape, facing, False)


def intersect(shape: Document, *, facing: Optional[Vector] = None) -> Document:
    """Samples outside of the shape leave the region."""
    return _shaped("intersect", shape, facing, False)


def assign(shape: Document, *, facing: Optional[Vector] = None, steal: bool = False) -> Document:
    """The region becomes exactly the samples in the shape (mode "set")."""
    return _shaped("set", shape, facing, steal)


def invert(*, steal: bool = False) -> Document:
    """Members leave the region, all other samples join it."""
    return {"mode": "invert", **_given(steal=True if steal else None)}


def clear() -> Document:
    """All samples leave the region."""
    return {"mode": "clear"}


def grow(distance: float, *, steal: bool = False) -> Document:
    """Samples within the distance of a member join the region."""
    return {"mode": "grow", "distance": float(distance), **_given(steal=True if steal else None)}


def shrink(distance: float) -> Document:
    """Members within the distance of a sample that is none leave the region."""
    return {"mode": "shrink", "distance": float(distance)}


def flood(
    seed: Vector,
    *,
    angle_deg: Optional[float] = None,
    radius: Optional[float] = None,
    stop_at_other: bool = False,
    steal: bool = False,
) -> Document:
    """Samples that a flood from the sample nearest to the seed reaches join the region."""
    return {
        "mode": "flood", "seed": _vector(seed),
        **_given(angle_deg=angle_deg, radius=radius, stop_at_other=True if stop_at_other else None,
                 steal=True if steal else None),
    }  # fmt: skip


def translation(vector: Vector) -> Document:
    """p + t vector"""
    return {"type": "translation", "vector": _vector(vector)}


def along_normal(distance: float) -> Document:
    """p + t distance n: embosses or carves."""
    return {"type": "along_normal", "distance": float(distance)}


def toward_point(target: Vector, amount: float) -> Document:
    """p + t amount (target - p)"""
    return {"type": "toward_point", "target": _vector(target), "amount": float(amount)}


def _axis(point: Vector, direction: Vector) -> Document:
    return {"point": _vector(point), "direction": _vector(direction)}


def rotation(point: Vector, direction: Vector, angle_deg: float) -> Document:
    """Turns p about an axis by t angle_deg."""
    return {"type": "rotation", "axis": _axis(point, direction), "angle_deg": float(angle_deg)}


def scale(center: Vector, factors: Union[float, Vector]) -> Document:
    """center + (1 + t (factors - 1)) (p - center); one factor for all axes, or three."""
    three = [float(factors)] * 3 if isinstance(factors, (int, float)) else _vector(factors)
    return {"type": "scale", "center": _vector(center), "factors": three}


def twist(point: Vector, direction: Vector, angle_deg: float, length: float) -> Document:
    """Turns p about an axis by t angle_deg h / length, with h its height along the axis."""
    return {"type": "twist", "axis": _axis(point, direction), "angle_deg": float(angle_deg), "length": float(length)}


def sequence(*steps: Document) -> Document:
    """One deformation after the other, all with the t of the sample at rest."""
    return {"type": "sequence", "steps": list(steps)}


def resampling(
    *,
    bound: Optional[float] = None,
    min_spacing: Optional[float] = None,
    max_samples: Optional[int] = None,
    shear_aware: Optional[bool] = None,
    sweeps: Optional[int] = None,
    collect: Optional[float] = None,
) -> Document:
    """Inserts samples where an edit stretches the surface; what is not given has the server's default."""
    return _given(
        bound=bound, min_spacing=min_spacing, max_samples=max_samples, shear_aware=shear_aware, sweeps=sweeps,
        collect=collect,
    )  # fmt: skip


# --- frames ---------------------------------------------------------------------------------------------------------

_HEADER = struct.Struct("<4sHHIBBHQQIIIIdddffffff")
_BLOCK = struct.Struct("<IIffffff")
_ATTRIBUTES = {"normal": 1, "t": 2, "detail": 4, "color": 8, "marks": 16, "ids": 32, "radius": 64}
_MAX_NUMBER = 2**53 - 1
_MAX_FLOAT = 3.4028234663852886e38


def _padded(count: int) -> int:
    return (count + 3) & ~3


def _finite(*values: float) -> bool:
    return all(-_MAX_FLOAT <= value <= _MAX_FLOAT for value in values)


class Block(NamedTuple):
    """One block of a frame, its columns as the bytes of the frame; a column that is not there is None."""

    number: int
    lanes: int
    minimum: Tuple[float, float, float]
    extent: Tuple[float, float, float]
    position_t: memoryview
    normal: Optional[memoryview]
    detail_stretch: Optional[memoryview]
    color: Optional[memoryview]
    marks: Optional[memoryview]
    ids: Optional[memoryview]
    radius: Optional[memoryview]


def _record_bytes(count: int, attributes: int) -> int:
    size = _BLOCK.size + 8 * count
    size += sum(4 * count for name in ("normal", "detail", "color", "ids") if attributes & _ATTRIBUTES[name])
    if attributes & _ATTRIBUTES["marks"]:
        size += _padded(count)
    if attributes & _ATTRIBUTES["radius"]:
        size += _padded(2 * count)
    return size


class Frame:
    """A sample frame (protocol/FRAMES.md), checked as strictly as the format demands. Raises BadFrame."""

    def __init__(self, data: bytes, max_samples: int = 100_000_000) -> None:
        self.data = bytes(data)
        self._view = memoryview(self.data)
        self._read_header(max_samples)
        self.blocks: List[Block] = []
        self._read_blocks()

    @staticmethod
    def _refuse(wrong: bool, why: str) -> None:
        if wrong:
            raise BadFrame(f"not a frame: {why}")

    def _read_header(self, max_samples: int) -> None:
        refuse = self._refuse
        refuse(len(self.data) < _HEADER.size, "shorter than the header")
        (magic, version, header_bytes, frame_bytes, kind, self.level, self.attributes, self.revision, self.sequence,
         self.sample_count, self.block_size, self.block_count, present, x, y, z, self.detail_range,
         self.stretch_range, *bounds) = _HEADER.unpack_from(self.data)  # fmt: skip
        refuse(magic != b"PWFR", "another magic than PWFR")
        refuse(version != 1, "an unknown version")
        refuse(header_bytes != _HEADER.size, "another header size than 96")
        refuse(frame_bytes != len(self.data), "another length than announced")
        refuse(kind > 1, "an unknown kind")
        refuse(self.attributes & ~127 != 0, "unknown attribute bits")
        refuse(kind == 1 and self.attributes & _ATTRIBUTES["radius"] != 0, "radii in a delta")
        refuse(max(self.revision, self.sequence) > _MAX_NUMBER, "a revision or sequence beyond 2^53 - 1")
        #: Whether every block is present
        self.is_key: bool = kind == 0
        self.origin: Tuple[float, float, float] = (x, y, z)
        self.center: Tuple[float, float, float] = (bounds[0], bounds[1], bounds[2])
        self.radius: float = bounds[3]
        refuse(self.sample_count > max_samples, f"{self.sample_count} samples, beyond the limit")
        refuse(not 1 <= self.block_size <= 65536, "a block size out of range")
        refuse(self.block_count > self.sample_count, "more blocks than samples")
        refuse(self.block_count * self.block_size < self.sample_count, "more samples than slots")
        refuse(present > self.block_count, "more blocks present than there are")
        refuse(self.is_key and present != self.block_count, "a key frame without all blocks")
        least = _record_bytes(1, self.attributes)
        refuse(len(self.data) - _HEADER.size < present * least, "more blocks than bytes")
        refuse(not all(abs(value) < float("inf") for value in self.origin), "an origin that is not finite")
        for value in (self.detail_range, self.stretch_range, self.radius):
            refuse(not (_finite(value) and value >= 0), "a range that is not a length")
        refuse(not _finite(*self.center), "bounds that are not a ball")
        self._present = present

    def _read_blocks(self) -> None:
        refuse = self._refuse
        at = _HEADER.size
        seen = set()
        previous = -1
        samples = 0
        for _ in range(self._present):
            refuse(len(self.data) - at < _BLOCK.size, "a block record is cut off")
            number, count, *numbers = _BLOCK.unpack_from(self.data, at)
            refuse(number >= self.block_count, "a block number out of range")
            refuse(not 1 <= count <= self.block_size, "a lane count out of range")
            refuse(len(self.data) - at < _record_bytes(count, self.attributes), "a block record is cut off")
            repeated = number in seen if self.is_key else number <= previous
            refuse(repeated, "blocks repeated or out of order")
            minimum, extent = numbers[:3], numbers[3:]
            refuse(not _finite(*numbers), "a quantisation box that is not finite")
            for low, size in zip(minimum, extent):
                refuse(size < 0 or _rounds_to_infinity(low + size), "a quantisation box that is not finite or negative")
            seen.add(number)
            previous = number
            samples += count
            self.blocks.append(self._read_columns(at + _BLOCK.size, number, count, minimum, extent))
            at += _record_bytes(count, self.attributes)
        refuse(at != len(self.data), "more bytes than the blocks fill")
        whole = samples == self.sample_count if self.is_key else samples <= self.sample_count
        refuse(not whole, "a sample count that the blocks contradict")

    def _read_columns(
        self, at: int, number: int, count: int, minimum: Sequence[float], extent: Sequence[float]
    ) -> Block:
        def take(size: int) -> memoryview:
            nonlocal at
            at += size
            return self._view[at - size : at]

        def padded(size: int) -> memoryview:
            column = take(size)
            self._refuse(any(take(_padded(size) - size)), "padding that is not zero")
            return column

        position_t = take(8 * count)
        normal, detail, color = (take(4 * count) if self.has(name) else None for name in ("normal", "detail", "color"))
        marks = padded(count) if self.has("marks") else None
        ids = take(4 * count) if self.has("ids") else None
        radius = padded(2 * count) if self.has("radius") else None
        if radius is not None:
            # From 0x7f80 on: infinities, what is not a number, and everything with a sign. -0 alone is a length.
            wrong = any(high >= 0x7F80 and high != 0x8000 for (high,) in struct.iter_unpack("<H", radius))
            self._refuse(wrong, "a radius that is not a length")
        low, size = (minimum[0], minimum[1], minimum[2]), (extent[0], extent[1], extent[2])
        return Block(number, count, low, size, position_t, normal, detail, color, marks, ids, radius)

    def has(self, attribute: str) -> bool:
        """Whether the frame carries "normal", "t", "detail" (with stretch), "color", "marks", "ids" or "radius"."""
        return bool(self.attributes & _ATTRIBUTES[attribute])

    def arrays(self) -> Dict[str, Any]:
        """The samples of the present blocks, by ascending slot, as numpy arrays: `position` (n, 3) float64 in model
        space, and as far as the frame has them `normal` (n, 3), `t`, `detail` (model units), `stretch`, `color` (n, 4)
        uint8, `marks` uint8, `ids` uint32, `radius`; `slot` tells each sample's place in the surface."""
        _need_numpy()
        columns = [self._block_arrays(block) for block in sorted(self.blocks, key=lambda block: block.number)]
        if not columns:
            columns = [self._block_arrays(_empty_block(self.attributes))]
        return {name: numpy.concatenate([column[name] for column in columns]) for name in columns[0]}

    def _block_arrays(self, block: Block) -> Dict[str, Any]:
        raw = numpy.frombuffer(block.position_t, "<u2").reshape(-1, 4).astype(numpy.float64)
        low = numpy.array(block.minimum) + numpy.array(self.origin)
        first = block.number * self.block_size
        result = {
            "slot": numpy.arange(first, first + block.lanes, dtype=numpy.int64),
            "position": low + numpy.array(block.extent) * raw[:, :3] / 65535,
        }
        if self.has("t"):
            result["t"] = raw[:, 3] / 65535
        if block.normal is not None:
            result["normal"] = _octahedral(numpy.frombuffer(block.normal, "<i2").reshape(-1, 2))
        if block.detail_stretch is not None:
            pair = numpy.frombuffer(block.detail_stretch, "<u2").reshape(-1, 2)
            result["detail"] = pair[:, 0].astype(numpy.uint16).view(numpy.int16) / 32767 * self.detail_range
            result["stretch"] = pair[:, 1] / 65535 * self.stretch_range
        if block.color is not None:
            result["color"] = numpy.frombuffer(block.color, numpy.uint8).reshape(-1, 4)
        if block.marks is not None:
            result["marks"] = numpy.frombuffer(block.marks, numpy.uint8)
        if block.ids is not None:
            result["ids"] = numpy.frombuffer(block.ids, "<u4")
        if block.radius is not None:
            bits = numpy.frombuffer(block.radius, "<u2").astype(numpy.uint32) << 16
            result["radius"] = bits.astype(numpy.uint32).view(numpy.float32)
        return result


def _rounds_to_infinity(value: float) -> bool:
    """Whether the sum of two single-precision numbers passes their range."""
    try:
        struct.pack("<f", value)
    except OverflowError:
        return True
    return False


def _empty_block(attributes: int) -> Block:
    none = memoryview(b"")
    has = [none if attributes & _ATTRIBUTES[name] else None
           for name in ("normal", "detail", "color", "marks", "ids", "radius")]  # fmt: skip
    return Block(0, 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), none, *has)


def _need_numpy() -> None:
    if numpy is None:
        raise PointwrightError("arrays of samples need numpy (Debian: python3-numpy)")


def _octahedral(raw: Any) -> Any:
    uv = numpy.maximum(-1.0, raw / 32767)
    u, v = uv[:, 0], uv[:, 1]
    z = 1 - numpy.abs(u) - numpy.abs(v)
    below = z < 0
    x = numpy.where(below, (1 - numpy.abs(v)) * numpy.where(u < 0, -1.0, 1.0), u)
    y = numpy.where(below, (1 - numpy.abs(u)) * numpy.where(v < 0, -1.0, 1.0), v)
    normal = numpy.stack([x, y, z], axis=1)
    return normal / numpy.linalg.norm(normal, axis=1, keepdims=True)


class Surface:
    """What a stream shows: key frames replace it, delta frames change the blocks that they bring. Needs numpy."""

    def __init__(self) -> None:
        self.arrays: Dict[str, Any] = {}
        self.revision = 0
        self.sequence = 0
        self.level = 0
        self._places: Any = None

    def apply(self, frame: Frame) -> None:
        """Takes a frame. Raises BadFrame where a delta does not fit what is there."""
        fresh = frame.arrays()
        if frame.is_key:
            slots = frame.block_count * frame.block_size
            self._places = numpy.full(slots, -1, dtype=numpy.int64)
            self._places[fresh["slot"]] = numpy.arange(len(fresh["slot"]))
            self.arrays = fresh
        else:
            if self._places is None or frame.block_count * frame.block_size != len(self._places):
                raise BadFrame("a delta frame without the key frame that it changes")
            rows = self._places[fresh["slot"]]
            if (rows < 0).any() or any(name not in self.arrays for name in fresh):
                raise BadFrame("a delta frame that does not fit its key frame")
            for name, values in fresh.items():
                if not self.arrays[name].flags.writeable:
                    self.arrays[name] = self.arrays[name].copy()
                self.arrays[name][rows] = values
        self.revision, self.sequence, self.level = frame.revision, frame.sequence, frame.level


# --- the client -----------------------------------------------------------------------------------------------------


class Client:
    """A server. `url`, `token` and `ca` default to $POINTWRIGHT_SERVER, $POINTWRIGHT_TOKEN and $POINTWRIGHT_CA.

    The certificate and the host name of an https server are always verified: by the authorities in the file `ca` (PEM),
    or by those that `requests` trusts where none is given.

    `retries` bounds how often a request is made again; `timeout` is that of connecting and of every silence of the
    server, in seconds."""

    def __init__(
        self,
        url: Optional[str] = None,
        token: Optional[str] = None,
        *,
        ca: Optional[str] = None,
        retries: int = 5,
        timeout: float = 60.0,
        backoff: float = 0.5,
    ) -> None:
        self.url = (url or os.environ.get("POINTWRIGHT_SERVER") or DEFAULT_URL).rstrip("/")
        self.retries = retries
        self.timeout = timeout
        self.backoff = backoff
        self._http = requests.Session()
        token = token if token is not None else os.environ.get("POINTWRIGHT_TOKEN")
        if token:
            self._http.headers["Authorization"] = f"Bearer {token}"
        authorities = ca or os.environ.get("POINTWRIGHT_CA") or None
        if authorities and not os.path.isfile(authorities):
            raise ValueError(f"{authorities}: no file of authorities")
        # With each request: one of the session's gives way to variables of the environment.
        self._verify: Union[str, bool] = authorities or True
        self._info: Optional[Document] = None

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Lets the connections go."""
        self._http.close()

    def request(
        self,
        method: str,
        path: str,
        *,
        json: Any = None,
        data: Any = None,
        params: Optional[Mapping[str, Any]] = None,
        headers: Optional[Mapping[str, str]] = None,
        stream: bool = False,
        repeat: bool = True,
    ) -> requests.Response:
        """Any request to the server: `path` below its URL. Answers a response of success, or raises.

        POST requests, and DELETE of an edit, carry an Idempotency-Key, the same one on each repetition. One whose
        answer was lost is made again only where the server says that it knows such keys ("idempotency-keys" among the features of /v1/info)."""
        sent = dict(headers or {})
        keyed = method == "POST" or (method == "DELETE" and "/edits/" in path)
        if keyed:
            sent.setdefault("Idempotency-Key", str(uuid.uuid4()))
        body = data
        if json is not None:
            body = json_module.dumps(json, allow_nan=False).encode()
            sent.setdefault("Content-Type", "application/json")
        query = {name: value for name, value in (params or {}).items() if value is not None}
        for attempt in range(self.retries + 1):
            last = attempt == self.retries or not repeat
            try:
                if callable(data):
                    body = data()
                response = self._http.request(
                    method, self.url + path, data=body, params=query, headers=sent, stream=stream,
                    timeout=self.timeout, verify=self._verify,
                )  # fmt: skip
            except requests.exceptions.SSLError as error:
                raise Unreachable(f"{method} {self.url}{path}: {error}") from error
            except (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError) as error:
                if last or not self._may_repeat(keyed, error):
                    raise Unreachable(f"{method} {self.url}{path}: {error}") from error
                self._pause(attempt, None)
                continue
            except requests.RequestException as error:
                raise Unreachable(f"{method} {self.url}{path}: {error}") from error
            if response.status_code < 400:
                return response
            problem = _problem_of(response)
            response.close()
            # A repetition that came while the first one was still at work is told to wait.
            waits = problem.status == 409 and attempt > 0 and problem.retry_after is not None
            if last or not (isinstance(problem, Overloaded) or waits):
                raise problem
            self._pause(attempt, problem.retry_after)
        raise AssertionError("not reached")

    def _may_repeat(self, keyed: bool, error: Exception) -> bool:
        never_sent = "NewConnectionError" in repr(error) or isinstance(error, requests.exceptions.ConnectTimeout)
        if not keyed or never_sent:
            return True
        try:
            return self.has_feature("idempotency-keys")
        except PointwrightError:
            return False

    def _pause(self, attempt: int, asked: Optional[float]) -> None:
        """Sleeps for what the server asked, or twice as long each time, spread so that clients do not come at once."""
        grown = min(30.0, self.backoff * 2**attempt) * random.uniform(0.75, 1.25)
        time.sleep(grown if asked is None or not 0.0 <= asked <= 60.0 else asked)

    def _json(self, method: str, path: str, **options: Any) -> Any:
        return self.request(method, path, **options).json()

    def info(self) -> Document:
        """Version, limits, formats and features."""
        self._info = self._json("GET", "/v1/info")
        return dict(self._info or {})

    def has_feature(self, name: str) -> bool:
        """Whether /v1/info, as it was first asked for, names this feature."""
        if self._info is None:
            self._info = self._json("GET", "/v1/info", repeat=False)
        return name in (self._info or {}).get("features", [])

    def ready(self) -> bool:
        """Whether the server says that it serves requests."""
        try:
            self.request("GET", "/readyz", repeat=False)
        except (Overloaded, Unreachable):
            return False
        return True

    # clouds and images

    def clouds(self) -> List["Cloud"]:
        """All clouds."""
        return [Cloud(self, document) for document in self._json("GET", "/v1/clouds")["clouds"]]

    def cloud(self, cloud_id: str) -> "Cloud":
        """One cloud."""
        return Cloud(self, self._json("GET", f"/v1/clouds/{cloud_id}"))

    def upload(
        self,
        source: Union[str, "os.PathLike[str]", bytes, IO[bytes]],
        name: Optional[str] = None,
        *,
        nonfinite: Optional[str] = None,
        resumable: Optional[bool] = None,
        resume_file: Optional[str] = None,
        part_bytes: int = 8 << 20,
        progress: Optional[Progress] = None,
    ) -> "Cloud":
        """Uploads a file (a path, bytes, or an open binary file that can seek) as a cloud.

        Resumable uploads (tus 1.0) go in parts of `part_bytes`, each with its checksum; after a break they go on where
        they were. By default files of 32 MiB and more are sent so where the server can. `resume_file` names a file that
        remembers an upload that did not end: with it the next call, of another process too, goes on with it.
        `progress` is told the fraction sent."""
        with _opened(source) as (file, size, file_name, modified):
            name = name or file_name
            tus = None
            if resumable or resume_file or (resumable is None and size >= RESUMABLE_BYTES):
                tus = self._tus_options()
                if tus is None and (resumable or resume_file):
                    raise NotSupported({"title": "This server takes no resumable uploads", "status": 404})
            if tus is not None:
                upload = _ResumableUpload(self, file, size, name, modified, tus, resume_file, part_bytes, progress)
                return self._import(upload.send(), name, nonfinite, upload.forget)
            # The server answers before the body is sent; asked first, it can say so.
            limit = self.info()["limits"].get("max_upload_bytes")
            if limit is not None and size > limit:
                raise TooLarge({"type": "/problems/body-too-large", "title": "The body is too large", "status": 413,
                                "detail": f"{size} bytes, beyond the limit of {int(limit)}", "limit": limit,
                                "actual": size})  # fmt: skip
            params = {"name": name, "nonfinite": nonfinite}
            headers = {"Content-Type": _media_type(file_name or "")}

            def body() -> Any:
                file.seek(0)
                return _Counted(file, size, progress) if size else b""

            return Cloud(self, self._json("POST", "/v1/clouds", data=body, params=params, headers=headers))

    def _tus_options(self) -> Optional[Mapping[str, str]]:
        try:
            answer = self.request("OPTIONS", "/v1/uploads")
        except Problem as problem:
            if problem.status in (404, 405, 501):
                return None
            raise
        return answer.headers if "1.0.0" in answer.headers.get("Tus-Version", "") else None

    def _import(
        self, upload: str, name: Optional[str], nonfinite: Optional[str], forget: Callable[[], None]
    ) -> "Cloud":
        body = {"upload": upload, **_given(name=name, nonfinite=nonfinite)}
        response = self.request("POST", "/v1/clouds", json=body)
        document = response.json()
        pause = 0.05
        while response.status_code == 202 or document.get("state") in ("importing", "building"):
            time.sleep(pause)
            pause = min(1.0, 1.5 * pause)
            response = self.request("GET", _path(response.headers.get("Location") or f"/v1/clouds/{document['id']}"))
            document = response.json()
        if document.get("state") == "failed":
            raise BuildFailed(document.get("error") or {"title": "The cloud could not be read", "status": 422})
        forget()
        return Cloud(self, document)

    def images(self) -> List[Document]:
        """All images."""
        return list(self._json("GET", "/v1/images")["images"])

    def upload_image(self, source: Union[str, "os.PathLike[str]", bytes]) -> Document:
        """Uploads a PNG file to paint with."""
        with _opened(source) as (file, _, _, _):
            data = file.read()
        return self._json("POST", "/v1/images", data=data, headers={"Content-Type": "image/png"})

    def delete_image(self, image_id: str) -> None:
        """Deletes an image; what was painted with it stays painted."""
        self.request("DELETE", f"/v1/images/{image_id}")

    # sessions

    def sessions(self) -> List[Document]:
        """All sessions, in short."""
        return list(self._json("GET", "/v1/sessions")["sessions"])

    def session(self, session_id: str) -> "Session":
        """One session, as it stands."""
        response = self.request("GET", f"/v1/sessions/{session_id}")
        return Session(self, response.json())

    def create_session(
        self,
        cloud: Union[str, "Cloud"],
        *,
        name: Optional[str] = None,
        scales: Optional[Sequence[float]] = None,
        neighbors: Optional[int] = None,
        preview: Optional[int] = None,
    ) -> "Session":
        """Begins to build a session; `wait()` tells when it is ready. `preview`: of so many of the cloud's samples."""
        identity = cloud if isinstance(cloud, str) else cloud.id
        levels = None if scales is None else _vector(scales)
        part = None if preview is None else {"count": preview}
        body = {"cloud": identity, **_given(name=name, scales=levels, neighbors=neighbors, preview=part)}
        return Session(self, self._json("POST", "/v1/sessions", json=body))

    # jobs

    def jobs(self) -> List["Job"]:
        """All jobs."""
        return [Job(self, document) for document in self._job_request("GET", "/v1/jobs").json()["jobs"]]

    def job(self, job_id: str) -> "Job":
        """One job."""
        return Job(self, self._json("GET", f"/v1/jobs/{job_id}"))

    def submit_job(
        self,
        *,
        recipe: Optional[Document] = None,
        session: Union[str, "Session", None] = None,
        cloud: Union[str, "Cloud", None] = None,
        upload: Optional[str] = None,
        preview: Union[int, str, "Cloud", None] = None,
        format: Optional[str] = None,  # noqa: A002
        steps: Optional[int] = None,
        mode: Optional[str] = None,
        s: Optional[float] = None,
        timing: Optional[str] = None,
        name: Optional[str] = None,
        priority: Optional[int] = None,
        launcher: Optional[str] = None,
    ) -> "Job":
        """Submits a job: the edits of a session or of a recipe, at full resolution on a cloud or on a complete resumable
        upload (its id); on the session's own cloud where neither is given.

        preview: beside a recipe, the cloud that was edited, or how many of the scan's samples stand in for it
        format: of the result: ply, las, draco, draco-tiles or xyz; that of the scan where it is not given
        steps: of an animation, so many clouds from s = 0 on
        mode: tiles (bounded memory), memory or direct; tiles where that can be, where it is not given
        """
        body = _job_body(recipe, session, cloud, upload, preview, format, steps, mode, s, timing, name, priority, launcher)
        response = self._job_request("POST", "/v1/jobs", json=body)
        return Job(self, response.json(), response.headers.get("Location"))

    def validate_job(self, **terms: Any) -> Document:
        """What a job would take, with the arguments of submit_job(): mode, samples, memory, disk, seconds."""
        arguments = ("recipe", "session", "cloud", "upload", "preview", "format", "steps", "mode", "s", "timing", "name",
                     "priority", "launcher")  # fmt: skip
        unknown = set(terms) - set(arguments)
        if unknown:
            raise TypeError(f"validate_job() takes no {', '.join(sorted(unknown))}")
        body = {**_job_body(*(terms.get(argument) for argument in arguments)), "validate": True}
        estimate: Document = self._job_request("POST", "/v1/jobs", json=body).json()["estimate"]
        return estimate

    def _job_request(self, method: str, path: str, **options: Any) -> requests.Response:
        try:
            return self.request(method, path, **options)
        except Problem as problem:
            if problem.status == 405 or (isinstance(problem, NotFound) and not self.has_feature("jobs")):
                raise NotSupported({**problem.document, "detail": "This server has no jobs"}) from problem
            raise


def _job_body(
    recipe: Optional[Document],
    session: Union[str, "Session", None],
    cloud: Union[str, "Cloud", None],
    upload: Optional[str],
    preview: Union[int, str, "Cloud", None],
    format: Optional[str],  # noqa: A002
    steps: Optional[int],
    mode: Optional[str],
    s: Optional[float],
    timing: Optional[str],
    name: Optional[str],
    priority: Optional[int],
    launcher: Optional[str],
) -> Document:
    """POST /v1/jobs"""
    if (recipe is None) == (session is None):
        raise ValueError("one of recipe and session")

    def identity(thing: Any) -> Any:
        return thing.id if isinstance(thing, (Cloud, Session)) else thing

    seen: Optional[Document] = None
    if preview is not None:
        seen = {"count": preview} if isinstance(preview, int) else {"cloud": identity(preview)}
    return _given(
        recipe=recipe, session=identity(session), cloud=identity(cloud), upload=upload, preview=seen,
        output=_given(format=format, steps=steps) or None, mode=mode, s=s, timing=timing, name=name,
        priority=priority, launcher=launcher,
    )  # fmt: skip


def _path(location: str) -> str:
    """The path of a Location, absolute or not."""
    parts = urllib.parse.urlsplit(location)
    return parts.path + (f"?{parts.query}" if parts.query else "")


def _media_type(name: str) -> str:
    extension = name.lower().rsplit(".", 1)[-1]
    known = {
        "drc": "model/x-draco",
        "ply": "application/x-ply",
        "txt": "text/plain",
        "xyz": "text/plain",
        "zip": "application/zip",
    }
    return known.get(extension, "application/octet-stream")


class _opened:
    """A source as (file, size, name, time of change); closes what it opened."""

    def __init__(self, source: Union[str, "os.PathLike[str]", bytes, IO[bytes]]) -> None:
        self._source = source
        self._own: Optional[IO[bytes]] = None

    def __enter__(self) -> Tuple[IO[bytes], int, Optional[str], int]:
        if isinstance(self._source, (bytes, bytearray)):
            return io.BytesIO(self._source), len(self._source), None, 0
        if isinstance(self._source, (str, os.PathLike)):
            self._own = open(self._source, "rb")
            status = os.fstat(self._own.fileno())
            return self._own, status.st_size, os.path.basename(os.fspath(self._source)), int(status.st_mtime)
        size = self._source.seek(0, os.SEEK_END)
        name = getattr(self._source, "name", None)
        return self._source, size, os.path.basename(name) if isinstance(name, str) else None, 0

    def __exit__(self, *_: object) -> None:
        if self._own is not None:
            self._own.close()


class _Counted:
    """A body of known length that tells how much of it was read."""

    def __init__(self, file: IO[bytes], size: int, progress: Optional[Progress]) -> None:
        self._file, self._size, self._progress = file, size, progress
        self._read = 0

    def __len__(self) -> int:
        return self._size

    def read(self, size: int = -1) -> bytes:
        data = self._file.read(size)
        self._read += len(data)
        if self._progress is not None and data:
            self._progress(self._read / self._size)
        return data


class _ResumableUpload:
    """One upload by tus 1.0. send() answers the upload's id."""

    def __init__(
        self,
        client: Client,
        file: IO[bytes],
        size: int,
        name: Optional[str],
        modified: int,
        options: Mapping[str, str],
        resume_file: Optional[str],
        part_bytes: int,
        progress: Optional[Progress],
    ) -> None:
        self._client, self._file, self._size, self._name = client, file, size, name
        self._modified, self._resume_file = modified, resume_file
        self._part_bytes, self._progress = part_bytes, progress
        self._checksums = "sha256" in options.get("Tus-Checksum-Algorithm", "")
        limit = options.get("Tus-Max-Size", "")
        if limit.isdigit() and size > int(limit):
            raise TooLarge({"type": "/problems/body-too-large", "title": "The file is too large", "status": 413,
                            "detail": f"{size} bytes, beyond the limit of {limit}", "limit": int(limit),
                            "actual": size})  # fmt: skip

    def send(self) -> str:
        location = self._remembered()
        offset = None if location is None else self._offset(location)
        if location is None or offset is None:
            location, offset = self._create(), 0
        failures = 0
        while offset < self._size:
            self._file.seek(offset)
            part = self._file.read(self._part_bytes)
            if not part:
                raise PointwrightError("the file became shorter during its upload")
            try:
                answer = self._client.request("PATCH", location, data=part, headers=self._part_headers(part, offset),
                                              repeat=False)  # fmt: skip
                reached = int(answer.headers["Upload-Offset"])
                if not offset < reached <= self._size:
                    raise PointwrightError(f"the server says that {reached} bytes arrived, of {self._size}")
                offset, failures = reached, 0
            except (Unreachable, Overloaded, Problem) as error:
                # 409: another offset than the server's; 423: the part before is still being taken; 460: the part was damaged.
                passing = (409, 423, 460)
                if isinstance(error, Problem) and not isinstance(error, Overloaded) and error.status not in passing:
                    raise
                failures += 1
                is_untrusted = isinstance(error.__cause__, requests.exceptions.SSLError)
                if is_untrusted or failures > self._client.retries:
                    raise
                self._client._pause(failures - 1, getattr(error, "retry_after", None))
                now = self._offset(location)
                if now is None:
                    raise
                failures = failures if now <= offset else 0
                offset = now
            if self._progress is not None:
                self._progress(offset / self._size)
        return urllib.parse.unquote(location.rstrip("/").rsplit("/", 1)[-1])

    def _part_headers(self, part: bytes, offset: int) -> Dict[str, str]:
        headers = {"Tus-Resumable": "1.0.0", "Upload-Offset": str(offset),
                   "Content-Type": "application/offset+octet-stream"}  # fmt: skip
        if self._checksums:
            headers["Upload-Checksum"] = "sha256 " + base64.b64encode(hashlib.sha256(part).digest()).decode()
        return headers

    def _create(self) -> str:
        headers = {"Tus-Resumable": "1.0.0", "Upload-Length": str(self._size)}
        if self._name:
            headers["Upload-Metadata"] = "filename " + base64.b64encode(self._name.encode()).decode()
        location = _path(self._client.request("POST", "/v1/uploads", headers=headers).headers["Location"])
        base = urllib.parse.urlsplit(self._client.url).path
        location = location[len(base) :] if base and location.startswith(base) else location
        if self._resume_file:
            state = {"server": self._client.url, "upload": location, "bytes": self._size, "modified": self._modified}
            with open(self._resume_file, "w", encoding="utf-8") as file:
                json_module.dump(state, file)
        return location

    def _remembered(self) -> Optional[str]:
        """The upload that the file remembers, where it is of the same bytes on the same server."""
        if not self._resume_file or not os.path.exists(self._resume_file):
            return None
        with open(self._resume_file, encoding="utf-8") as file:
            try:
                state = json_module.load(file)
            except ValueError:
                return None
        same = isinstance(state, dict) and state.get("server") == self._client.url
        same = same and state.get("bytes") == self._size and state.get("modified") == self._modified
        return str(state["upload"]) if same and "upload" in state else None

    def _offset(self, location: str) -> Optional[int]:
        """How much the server has; None where it does not know the upload any more."""
        try:
            answer = self._client.request("HEAD", location, headers={"Tus-Resumable": "1.0.0"})
        except NotFound:
            return None
        return int(answer.headers["Upload-Offset"])

    def forget(self) -> None:
        """The upload ended: there is nothing to resume."""
        if self._resume_file and os.path.exists(self._resume_file):
            os.remove(self._resume_file)


def _save(
    response: requests.Response, target: Union[str, "os.PathLike[str]"], expected: Optional[int] = None
) -> int:
    """Writes a streamed body into a file, whole or not at all. Answers its bytes.

    expected: how many there are, where that is known otherwise than from the answer's head.
    """
    part = f"{os.fspath(target)}.{uuid.uuid4().hex[:8]}.part"
    announced = response.headers.get("Content-Length")
    written = 0
    try:
        with response, open(part, "wb") as file:
            for chunk in response.iter_content(1 << 20):
                written += file.write(chunk)
        if expected is None and announced is not None and "Content-Encoding" not in response.headers:
            expected = int(announced)
        if expected is not None and written != expected:
            raise Unreachable(f"the download ended after {written} of {expected} bytes")
        os.replace(part, target)
    except requests.RequestException as error:
        raise Unreachable(str(error)) from error
    finally:
        if os.path.exists(part):
            os.remove(part)
    return written


class Cloud:
    """A cloud that the server has; `document` is as the server gave it."""

    def __init__(self, client: Client, document: Document) -> None:
        self.client = client
        self.document = document
        self.id: str = document["id"]
        self.name: str = document.get("name", "")
        self.sample_count: int = document.get("sample_count", 0)

    def __repr__(self) -> str:
        return f"<Cloud {self.id} {self.name!r}, {self.sample_count} samples>"

    def open_session(
        self,
        *,
        name: Optional[str] = None,
        scales: Optional[Sequence[float]] = None,
        neighbors: Optional[int] = None,
        preview: Optional[int] = None,
        timeout: Optional[float] = None,
        progress: Optional[BuildProgress] = None,
    ) -> "Session":
        """A session on the cloud, or on `preview` of its samples, ready."""
        made = self.client.create_session(
            self, name=name, scales=scales, neighbors=neighbors, preview=preview
        )
        return made.wait(timeout=timeout, progress=progress)

    def download(self, target: Union[str, "os.PathLike[str]"], format: str = "ply") -> int:  # noqa: A002
        """Writes the cloud into a file; answers its bytes."""
        path = f"/v1/clouds/{self.id}/data"
        return _save(self.client.request("GET", path, params={"format": format}, stream=True), target)

    def delete(self) -> None:
        """Deletes the cloud; raises Conflict while a session uses it."""
        self.client.request("DELETE", f"/v1/clouds/{self.id}")


class Session:
    """A session. `revision` is the newest one that this object has seen: edits are made for it, and the server refuses
    them (StaleRevision) where somebody else changed the session meanwhile; `refresh()` takes over the present state."""

    def __init__(self, client: Client, document: Document) -> None:
        self.client = client
        self.id: str = document["id"]
        self.document = document
        self.revision: int = document["revision"]
        self._path = f"/v1/sessions/{self.id}"

    def __repr__(self) -> str:
        return f"<Session {self.id} {self.document.get('name')!r}, {self.state}, revision {self.revision}>"

    @property
    def state(self) -> str:
        """building, ready or failed, as last seen"""
        return str(self.document["state"])

    @property
    def levels(self) -> List[Document]:
        """The levels, the smoothest first, as last seen"""
        return list(self.document["levels"])

    def refresh(self) -> "Session":
        """Takes over what the server has now."""
        return self._take(self.client.request("GET", self._path).json())

    def _take(self, document: Document) -> "Session":
        self.document = {name: value for name, value in document.items() if name != "changed"}
        self.revision = document["revision"]
        return self

    def wait(self, timeout: Optional[float] = None, progress: Optional[BuildProgress] = None) -> "Session":
        """Waits until the session is built. Raises BuildFailed, or WaitedTooLong after `timeout` seconds. `progress` is
        told phase and fraction."""
        ends = None if timeout is None else time.monotonic() + timeout
        pause = 0.02
        while True:
            self.refresh()
            if progress is not None:
                progress(self.document["progress"]["phase"], self.document["progress"]["fraction"])
            if self.state in ("ready", "asleep"):  # one that sleeps wakes when it is used
                return self
            if self.state == "failed":
                raise BuildFailed(self.document.get("error") or {"title": "The session failed", "status": 409})
            if ends is not None and time.monotonic() >= ends:
                raise WaitedTooLong(f"the session is still {self.state} after {timeout} s")
            time.sleep(pause)
            pause = min(1.0, 1.5 * pause)

    def rename(self, name: str) -> "Session":
        """Gives the session another name."""
        return self._changed("PATCH", "", {"name": name})

    def delete(self) -> None:
        """Deletes the session; one that is being built is cancelled."""
        self.client.request("DELETE", self._path)

    # painting

    def paint(self, region: str, operation: Document, *, revision: Union[int, str, None] = None) -> int:
        """Paints on the zero- or the one-region, or on one that is kept under another name: an operation, or a shape, which
        is added. Answers how many samples changed."""
        if "mode" not in operation:
            operation = add(operation)
        headers = _if_match(revision)
        path = f"{self._region_path(region)}/operations"
        document = self.client.request("POST", path, json=operation, headers=headers).json()
        self._take(document)
        return int(document["changed"])

    def painting(self, region: str) -> Document:
        """The region's operations, as they are recorded, and its number of samples."""
        return self.client.request("GET", self._region_path(region)).json()

    def regions(self) -> List[Document]:
        """All regions, in short: zero, one, then those under other names."""
        return list(self.client.request("GET", f"{self._path}/regions").json()["regions"])

    def save_region(self, name: str, source: str = "one", *, revision: Union[int, str, None] = None) -> "Session":
        """Keeps the samples that a region has now under a name."""
        return self.replace_painting(name, [assign(region(source))], revision=revision)

    def replace_painting(
        self, region: str, operations: Sequence[Document], *, revision: Union[int, str, None] = None
    ) -> "Session":
        """Replaces the whole painting of a region."""
        made = [operation if "mode" in operation else add(operation) for operation in operations]
        return self._changed("PUT", f"/regions/{urllib.parse.quote(region, safe='')}", {"operations": made}, revision)

    def clear_region(self, region: str) -> "Session":
        """Takes all samples out of the zero- or the one-region; deletes another one."""
        return self._take(self.client.request("DELETE", self._region_path(region)).json())

    def _region_path(self, region: str) -> str:
        return f"{self._path}/regions/{urllib.parse.quote(region, safe='')}"

    def _changed(
        self, method: str, path: str, body: Any, revision: Union[int, str, None] = None
    ) -> "Session":
        response = self.client.request(method, self._path + path, json=body, headers=_if_match(revision))
        return self._take(response.json())

    # editing

    def preview(
        self,
        deformation: Document,
        *,
        level: int = 0,
        blend: Optional[str] = None,
        gains: Optional[Vector] = None,
        resampling: Optional[Document] = None,
        sequence: int = 1,
        attributes: Sequence[str] = ("normal",),
    ) -> Frame:
        """The frame that an edit would show; nothing is recorded."""
        body = {**_edit_body(deformation, level, blend, gains, resampling), "sequence": sequence}
        answer = self.client.request("POST", f"{self._path}/preview", json=body, params=_attributes(attributes))
        return Frame(answer.content)

    def show_preview(
        self,
        deformation: Document,
        sequence: int,
        *,
        level: int = 0,
        blend: Optional[str] = None,
        gains: Optional[Vector] = None,
        resampling: Optional[Document] = None,
    ) -> None:
        """Shows an edit on the session's streams without recording it; `sequence` rises from call to call."""
        body = {**_edit_body(deformation, level, blend, gains, resampling), "sequence": sequence}
        self.client.request("PUT", f"{self._path}/preview", json=body)

    def end_preview(self) -> None:
        """Ends a drag: streams get the committed state back."""
        self.client.request("DELETE", f"{self._path}/preview")

    def edit(
        self,
        deformation: Document,
        *,
        level: int = 0,
        blend: Optional[str] = None,
        gains: Optional[Vector] = None,
        resampling: Optional[Document] = None,
        revision: Union[int, str, None] = None,
    ) -> Document:
        """Records an edit, for the revision that this object has seen or for another one; `ANY` for whatever is there.
        Answers the record."""
        body = _edit_body(deformation, level, blend, gains, resampling)
        headers = _if_match(self.revision if revision is None else revision)
        response = self.client.request("POST", f"{self._path}/edits", json=body, headers=headers)
        record = response.json()
        self.revision = _revision_of(response, self.revision)
        edits = {"head": record["index"], "edits": record["index"]}
        self.document = {**self.document, "revision": self.revision, "history": edits,
                         "sample_count": record["sample_count"]}  # fmt: skip
        return record

    def edits(self) -> Document:
        """The history: {"head": how many are applied, "edits": all records, those undone included}."""
        return self.client.request("GET", f"{self._path}/edits").json()

    def amend(
        self,
        index: int,
        deformation: Document,
        *,
        level: int = 0,
        blend: Optional[str] = None,
        gains: Optional[Vector] = None,
        resampling: Optional[Document] = None,
        revision: Union[int, str, None] = None,
    ) -> "Session":
        """Puts another edit in the place of an old one; those after it are made once more. Raises NotSupported where the
        server cannot."""
        body = _edit_body(deformation, level, blend, gains, resampling)
        return self._amended("PUT", index, body, revision)

    def remove_edit(self, index: int, *, revision: Union[int, str, None] = None) -> "Session":
        """Takes an old edit out of the history; those after it are made once more."""
        return self._amended("DELETE", index, None, revision)

    def _amended(self, method: str, index: int, body: Any, revision: Union[int, str, None]) -> "Session":
        try:
            return self._changed(method, f"/edits/{index}", body, self.revision if revision is None else revision)
        except Problem as problem:
            there = problem.status == 405 or (problem.status == 404 and 1 <= index <= len(self.edits()["edits"]))
            if there:
                detail = "This server cannot change old edits"
                raise NotSupported({**problem.document, "detail": detail}) from problem
            raise

    def head(self, edit: int, *, revision: Union[int, str, None] = None) -> "Session":
        """Jumps to where so many edits are applied."""
        return self._changed("PUT", "/head", {"edit": edit}, revision)

    def undo(self, count: int = 1) -> "Session":
        """Takes edits back, not beyond the first."""
        self.refresh()
        return self.head(max(0, self.document["history"]["head"] - count), revision=self.revision)

    def redo(self, count: int = 1) -> "Session":
        """Makes edits once more, not beyond the last."""
        history = self.refresh().document["history"]
        return self.head(min(history["edits"], history["head"] + count), revision=self.revision)

    def recipe(self) -> Document:
        """The applied edits as a portable document."""
        return self.client.request("GET", f"{self._path}/recipe").json()

    def apply_recipe(
        self, recipe: Document, *, s: float = 1.0, timing: str = "sequence", revision: Union[int, str, None] = None
    ) -> "Session":
        """Appends a recipe's edits, all or none; with s below 1 part of the way."""
        body = {"recipe": recipe, "s": s, "timing": timing}
        return self._changed("POST", "/recipe", body, self.revision if revision is None else revision)

    # samples

    def samples(
        self,
        *,
        level: Optional[int] = None,
        attributes: Sequence[str] = ("normal",),
        s: Optional[float] = None,
        timing: Optional[str] = None,
    ) -> Frame:
        """The committed state as a frame; `arrays()` of it decodes with numpy."""
        params = {"format": "frame", "level": level, "s": s, "timing": timing, **_attributes(attributes)}
        return Frame(self.client.request("GET", f"{self._path}/samples", params=params).content)

    def download(
        self,
        target: Union[str, "os.PathLike[str]"],
        format: str = "ply",  # noqa: A002
        *,
        level: Optional[int] = None,
        s: Optional[float] = None,
        timing: Optional[str] = None,
    ) -> int:
        """Writes the committed state into a file, with all attributes of the upload; answers its bytes."""
        params = {"format": format, "level": level, "s": s, "timing": timing}
        return _save(self.client.request("GET", f"{self._path}/samples", params=params, stream=True), target)

    def stream(
        self, *, attributes: Sequence[str] = ("normal",), reconnect: bool = True
    ) -> Iterator[Union[Frame, Document]]:
        """Frames and events (dictionaries with a member "event") for as long as the session is there.

        A broken stream is opened again, as often as requests are repeated; it then begins with a key frame. Ends after
        the event "end"."""
        failures = 0
        while True:
            try:
                for item in self._stream_once(attributes):
                    failures = 0
                    yield item
                    if isinstance(item, dict) and item.get("event") == "end":
                        return
                raise Unreachable("the stream ended")
            except (Unreachable, BadFrame):
                if not reconnect or failures >= self.client.retries:
                    raise
                self.client._pause(failures, None)
                failures += 1

    def _stream_once(self, attributes: Sequence[str]) -> Iterator[Union[Frame, Document]]:
        response = self.client.request("GET", f"{self._path}/stream", params=_attributes(attributes), stream=True)
        with response:
            for kind, payload in _records(response):
                if kind == 1:
                    yield Frame(payload)
                elif kind == 2:
                    event = json_module.loads(payload)
                    if event.get("event") == "session":
                        self._take({name: value for name, value in event.items() if name != "event"})
                    yield event


def _records(response: requests.Response) -> Iterator[Tuple[int, bytes]]:
    """The records of a stream: (type, payload)."""
    raw = response.raw
    raw.decode_content = True

    def take(size: int, may_end: bool) -> Optional[bytes]:
        parts: List[bytes] = []
        missing = size
        while missing > 0:
            try:
                part = raw.read(missing)
            except Exception as error:  # urllib3 has errors of its own, by version
                raise Unreachable(f"the stream broke: {error}") from error
            if not part:
                if may_end and not parts:
                    return None
                raise BadFrame("the stream was cut off inside a record")
            parts.append(part)
            missing -= len(part)
        return b"".join(parts)

    while True:
        head = take(8, True)
        if head is None:
            return
        kind, length = struct.unpack("<II", head)
        if length > (1 << 31 if kind == 1 else 1 << 24):
            raise BadFrame(f"a record of {length} bytes")
        yield kind, take(length, False) or b""


def _edit_body(
    deformation: Document, level: int, blend: Optional[str], gains: Optional[Vector], again: Optional[Document]
) -> Document:
    factors = None if gains is None else _vector(gains)
    return {"level": level, "deformation": deformation, **_given(blend=blend, gains=factors, resampling=again)}


def _attributes(names: Sequence[str]) -> Dict[str, str]:
    return {"attributes": ",".join(names)}


def _if_match(revision: Union[int, str, None]) -> Dict[str, str]:
    if revision is None:
        return {}
    return {"If-Match": ANY if revision == ANY else f'"r{int(revision)}"'}


def _revision_of(response: requests.Response, otherwise: int) -> int:
    tag = response.headers.get("ETag", "").strip('"')
    return int(tag[1:]) if tag[:1] == "r" and tag[1:].isdigit() else otherwise


class Job:
    """A job, as OGC API – Processes has them: accepted, running, successful, failed or dismissed."""

    def __init__(self, client: Client, document: Document, location: Optional[str] = None) -> None:
        self.client = client
        self.document = document
        self.id: str = str(document.get("jobID") or _path(location or "").rsplit("/", 1)[-1])
        self._path = f"/v1/jobs/{self.id}"

    def __repr__(self) -> str:
        return f"<Job {self.id}, {self.status}>"

    @property
    def status(self) -> str:
        """As last seen"""
        return str(self.document.get("status", "accepted"))

    def refresh(self) -> "Job":
        """Takes over what the server has now."""
        self.document = self.client.request("GET", self._path).json()
        return self

    def wait(self, timeout: Optional[float] = None, progress: Optional[Progress] = None) -> "Job":
        """Waits until the job has ended well. Raises JobFailed, or WaitedTooLong after `timeout` seconds."""
        ends = None if timeout is None else time.monotonic() + timeout
        pause = 0.1
        while True:
            self.refresh()
            if progress is not None and "progress" in self.document:
                progress(float(self.document["progress"]) / 100)
            if self.status == "successful":
                return self
            if self.status in ("failed", "dismissed"):
                title = self.document.get("message") or f"The job was {self.status}"
                raise JobFailed(self.document.get("exception") or {"title": title, "status": 409})
            if ends is not None and time.monotonic() >= ends:
                raise WaitedTooLong(f"the job is still {self.status} after {timeout} s")
            time.sleep(pause)
            pause = min(3.0, 1.5 * pause)

    def log(self, offset: int = 0) -> Tuple[str, int]:
        """What the log says from an offset on, and the offset to go on from."""
        content = self.client.request("GET", f"{self._path}/log", params={"offset": offset}).content
        return content.decode("utf-8", "replace"), offset + len(content)

    def cancel(self) -> "Job":
        """Dismisses the job. One that has ended stays as it is, with its results: a Conflict."""
        response = self.client.request("DELETE", self._path, params={"only": "dismiss"})
        if response.content:
            self.document = response.json()
        return self

    def restart(self) -> "Job":
        """Runs the job once more; it goes on from its checkpoints."""
        self.document = self.client.request("POST", f"{self._path}/restart").json()
        return self

    def results(self) -> Document:
        """What the job made: "results", each with name, type, bytes, sha256 and href; and the worker's "report"."""
        results: Document = self.client.request("GET", f"{self._path}/results").json()
        return results

    def download(self, target: Union[str, "os.PathLike[str]"], name: Optional[str] = None) -> int:
        """Writes a file that the job made, the first one where no name is given; returns its bytes."""
        for result in self.results()["results"]:
            if name is None or result["name"] == name:
                response = self.client.request("GET", result["href"], stream=True)
                return _save(response, target, result["bytes"])
        raise ValueError(f"the job has made no {name or 'file'}")

    def delete(self) -> None:
        """Forgets a job that has ended, with its results. One that has not ended goes on: a Conflict."""
        self.client.request("DELETE", self._path, params={"only": "forget"})
