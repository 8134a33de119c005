"""Frames as Python reads them, against the files that C++ wrote."""

import json
import struct
import unittest

import numpy

from support import ROOT
from pointwright import BadFrame, Frame, Surface

VECTORS = ROOT / "protocol/vectors"


class Frames(unittest.TestCase):
    def test_golden_frames_are_read_as_cpp_reads_them(self):
        for expected in json.loads((VECTORS / "vectors.json").read_text()):
            with self.subTest(expected["file"]):
                frame = Frame((VECTORS / expected["file"]).read_bytes())
                header = expected["header"]
                self.assertEqual(frame.is_key, header["kind"] == "key")
                for mine, theirs in {"level": "level", "attributes": "attributes", "revision": "revision",
                                     "sequence": "sequence", "sample_count": "sampleCount",
                                     "block_size": "blockSize", "block_count": "blockCount",
                                     "detail_range": "detailRange", "stretch_range": "stretchRange"}.items():
                    self.assertEqual(getattr(frame, mine), header[theirs], mine)
                self.assertEqual(list(frame.origin), header["origin"])
                self.assertEqual(list(frame.center), header["bounds"]["center"])
                self.assertEqual([block.number for block in frame.blocks], [b["number"] for b in expected["blocks"]])
                self.check_arrays(frame, expected)

    def check_arrays(self, frame, expected):
        arrays = frame.arrays()
        blocks = sorted(expected["blocks"], key=lambda block: block["number"])

        def column(name, width=1):
            return numpy.array([v for block in blocks for v in block.get(name) or []]).reshape(-1, width)

        numpy.testing.assert_allclose(arrays["position"], column("positions", 3), rtol=0, atol=1e-9)
        raw = column("positionT", 4)
        if frame.has("t"):
            numpy.testing.assert_allclose(arrays["t"], raw[:, 3] / 65535)
        if frame.has("normal"):
            numpy.testing.assert_allclose(arrays["normal"], column("normals", 3), rtol=0, atol=1e-6)
        if frame.has("detail"):
            pair = column("detailStretch", 2)
            signed = pair[:, 0].astype(numpy.uint16).astype(numpy.int16)
            numpy.testing.assert_allclose(arrays["detail"], signed / 32767 * frame.detail_range)
            numpy.testing.assert_allclose(arrays["stretch"], pair[:, 1] / 65535 * frame.stretch_range)
        if frame.has("color"):
            numpy.testing.assert_array_equal(arrays["color"], column("color", 4))
        for name in ("marks", "ids"):
            if frame.has(name):
                numpy.testing.assert_array_equal(arrays[name], column(name)[:, 0])
        if frame.has("radius"):
            bits = [struct.unpack("<f", struct.pack("<I", int(v) << 16))[0] for v in column("radius")[:, 0]]
            numpy.testing.assert_array_equal(arrays["radius"], bits)

    def test_a_delta_changes_its_blocks_of_the_key_frame_alone(self):
        key = Frame((VECTORS / "key.frame").read_bytes())
        delta = Frame((VECTORS / "delta.frame").read_bytes())
        surface = Surface()
        with self.assertRaises(BadFrame):
            surface.apply(delta)
        surface.apply(key)
        before = {name: values.copy() for name, values in surface.arrays.items()}
        surface.apply(delta)
        fresh = delta.arrays()
        changed = numpy.isin(surface.arrays["slot"], fresh["slot"])
        self.assertTrue(0 < changed.sum() < len(changed))
        for name, values in surface.arrays.items():
            numpy.testing.assert_array_equal(values[~changed], before[name][~changed])
            if name in fresh:
                numpy.testing.assert_array_equal(values[changed], fresh[name])
        self.assertEqual((surface.revision, surface.sequence), (delta.revision, delta.sequence))

    def test_what_the_format_forbids_is_refused(self):
        cases = json.loads((VECTORS / "malformed.json").read_text())
        self.assertGreater(len(cases), 20)
        for case in cases:
            with self.subTest(case["name"]):
                data = bytearray((VECTORS / case["file"]).read_bytes())
                if "offset" in case:
                    data[case["offset"] : case["offset"] + len(case["bytes"])] = bytes(case["bytes"])
                if "cut" in case:
                    data = data[: case["cut"]]
                data += bytes(case.get("append", 0))
                with self.assertRaises(BadFrame):
                    Frame(bytes(data))


if __name__ == "__main__":
    unittest.main()
