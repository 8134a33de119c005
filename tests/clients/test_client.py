"""The Python client against the real daemon, and what its README says."""

import contextlib
import io
import itertools
import os
import pathlib
import re
import struct
import tempfile
import unittest
import zlib

import numpy

import support
from pointwright import (
    ANY, BadFrame, Client, Conflict, Frame, Invalid, NotFound, NotSupported, StaleRevision, Surface, TooLarge,
    Unreachable, UnsupportedFormat, add, along_normal, assign, box, clear, ellipse, everything, flood, grow, half_space,
    image, intersect, invert, model, planar, points, polygon, polyline, region, remove, resampling, rotation, scale, screen,
    sequence, shrink, sphere, stroke, texture, toward_point, translation, twist,
)  # fmt: skip

SIDE = 40
LEFT = box((-1, -1, -1), (0.2, 2, 1))
RIGHT = box((0.8, -1, -1), (2, 2, 1))
ORTHOGRAPHIC = (2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 1, 0, 0, 0, 0, 1)  # the unit square fills the picture
def white_pixel():
    """A grey PNG file of one white pixel."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 1, 1, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0\xff")) + chunk(b"IEND", b"")




class AgainstTheDaemon(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = support.Daemon()
        cls.client = Client(cls.daemon.url, retries=1)
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        (cls.path / "sheet.ply").write_bytes(support.ply(support.sheet(SIDE)))
        cls.cloud = cls.client.upload(cls.path / "sheet.ply")

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        cls.daemon.stop()
        cls.folder.cleanup()

    def setUp(self):
        self.session = self.cloud.open_session(scales=[0.05])
        self.addCleanup(self.session.delete)

    def painted(self):
        self.session.paint("zero", LEFT)
        self.session.paint("one", RIGHT)
        return self.session

    def test_an_edit_moves_the_one_region_and_leaves_the_zero_region_its_bits(self):
        session = self.painted()
        record = session.edit(translation((0, 0, 0.4)), blend="cubic")
        self.assertEqual(record["index"], 1)
        self.assertEqual(session.download(self.path / "edited.ply"), (self.path / "edited.ply").stat().st_size)
        before, after = support.sheet(SIDE), support.read_ply(self.path / "edited.ply")
        self.assertEqual(len(after), len(before))
        kept = support.read_ply(self.path / "sheet.ply")
        for old, exact, new in zip(before, kept, after):
            if old[0] <= 0.2:
                self.assertEqual(new, exact)
            elif old[0] >= 0.8:
                self.assertAlmostEqual(new[2], old[2] + 0.4, places=2)

    def test_a_session_edits_a_part_of_its_cloud(self):
        part = self.cloud.open_session(scales=[0.05], preview=200)
        self.addCleanup(part.delete)
        self.assertEqual(part.document["preview"], {"count": 200, "of": SIDE * SIDE})
        self.assertEqual(part.document["sample_count"], 200)
        self.assertNotIn("preview", self.session.document)
        with self.assertRaises(Invalid) as caught:
            self.cloud.open_session(preview=0)
        self.assertEqual(caught.exception.errors[0]["pointer"], "/preview/count")

    def test_regions_are_kept_under_names_and_used_again(self):
        session = self.painted()
        samples = session.painting("one")["samples"]
        session.save_region("right end", "one")
        self.assertEqual(session.painting("right end")["samples"], samples)
        session.clear_region("one")
        self.assertEqual(session.paint("one", region("right end")), samples)
        names = [each["region"] for each in session.regions()]
        self.assertEqual(names, ["zero", "one", "right end"])
        session.clear_region("right end")
        with self.assertRaises(NotFound):
            session.painting("right end")
        with self.assertRaises(Invalid):
            session.paint("one", region("right end"))

    def test_history_goes_back_and_forth_and_stale_edits_are_refused(self):
        session = self.painted()
        session.edit(translation((0, 0, 0.1)))
        session.edit(along_normal(0.02), level=0, gains=[0.5])
        other = self.client.session(session.id)
        self.assertEqual(session.undo().document["history"], {"head": 1, "edits": 2})
        self.assertEqual(session.undo(5).document["history"]["head"], 0)
        self.assertEqual(session.redo(5).document["history"]["head"], 2)
        self.assertEqual(session.head(1).document["history"]["head"], 1)
        with self.assertRaises(StaleRevision) as caught:
            other.edit(translation((0, 0, 0.1)))
        self.assertEqual(caught.exception.revision, session.revision)
        self.assertEqual(other.refresh().edit(translation((0, 0, 0.1)))["index"], 2)
        session.edit(translation((0, 0, 0.1)), revision=ANY)
        self.assertEqual(session.edits()["head"], 3)
        self.assertEqual([edit["index"] for edit in session.edits()["edits"]], [1, 2, 3])
        with self.assertRaises(Invalid):
            session.head(9)

    def test_old_edits_are_amended_where_the_server_can(self):
        session = self.painted()
        session.edit(translation((0, 0, 0.1)))
        try:
            session.amend(1, translation((0, 0, 0.3)))
        except NotSupported as problem:
            self.assertIn("cannot change old edits", str(problem))
            return
        self.assertEqual(session.edits()["edits"][0]["edit"]["deformation"]["vector"], [0, 0, 0.3])
        self.assertEqual(session.remove_edit(1).document["history"]["edits"], 0)
        self.assertEqual(session.rename("another").document["name"], "another")

    def test_every_deformation_is_recorded_as_it_was_made(self):
        session = self.painted()
        axis = ((0.8, 0.5, 0), (0, 1, 0))
        for deformation in (
            translation((0, 0, 0.01)), along_normal(0.01), toward_point((1, 1, 1), 0.1), rotation(*axis, 5),
            scale((0.5, 0.5, 0), 1.1), scale((0.5, 0.5, 0), (1, 1.1, 1)), twist(*axis, 5, 0.5),
            sequence(translation((0, 0, 0.01)), rotation(*axis, 5)),
        ):  # fmt: skip
            with self.subTest(deformation["type"]):
                self.assertEqual(session.edit(deformation)["edit"]["deformation"], deformation)

    def test_resampling_inserts_samples(self):
        wanted = resampling(bound=1.5, min_spacing=0, max_samples=0, shear_aware=False, sweeps=2, collect=0)
        record = self.painted().edit(translation((1, 0, 0.5)), resampling=wanted)
        self.assertGreater(record["inserted"], 0)
        self.assertEqual(record["edit"]["resampling"], wanted)
        self.assertEqual(record["sample_count"], SIDE * SIDE + record["inserted"])
        self.assertEqual(self.session.samples(attributes=["ids"]).sample_count, record["sample_count"])

    def test_every_shape_paints_what_it_covers(self):
        picture = self.client.upload_image(white_pixel())
        self.addCleanup(self.client.delete_image, picture["id"])
        self.assertIn(picture["id"], [entry["id"] for entry in self.client.images()])
        everywhere = planar((0, 0, 0), (1, 0, 0), (0, 1, 0), depth=(-1, 1))
        all_samples = SIDE * SIDE
        for shape, wanted in (
            (sphere((0.5, 0.5, 0), 5), all_samples),
            (sphere((0, 0, 0), 0.04), range(1, 10)),
            (stroke([(0, 0, 0), (1, 0, 0)], 0.01), sum(y == 0 and abs(z) <= 0.01 for _, y, z in support.sheet(SIDE))),
            (LEFT, SIDE * sum(i / (SIDE - 1) <= 0.2 for i in range(SIDE))),
            (half_space((0.5, 0, 0), (1, 0, 0)), all_samples // 2),
            (everything(), all_samples),
            (points([(0, 0, 0), (1, 1, 0)], radius=0.03), range(2, 20)),
            (points([(0, 0, 0), (1, 1, 0)], radii=[0.01, 0.03]), range(2, 20)),
            (screen(ORTHOGRAPHIC, polygon([(-1.1, -1.1), (0, -1.1), (0, 1.1), (-1.1, 1.1)])), all_samples // 2),
            (screen(numpy.reshape(ORTHOGRAPHIC, (4, 4)), ellipse((0, 0), (3, 3)), visible=True), all_samples),
            (screen(ORTHOGRAPHIC, polyline([(-2, -1), (2, -1)], 0.01)), SIDE),
            (image(picture["id"], everywhere), all_samples),
            (image(picture["id"], everywhere, channel="red", threshold=0.5, side="below"), 0),
            (model(self.cloud, 0.001), all_samples),
        ):  # fmt: skip
            with self.subTest(shape["type"]):
                self.session.clear_region("one")
                changed = self.session.paint("one", shape)
                self.assertTrue(changed in wanted if isinstance(wanted, range) else changed == wanted, changed)
        with self.assertRaises(Invalid):  # the cloud has no texture coordinates
            self.session.paint("one", image(picture["id"], texture(repeat=True)))
        with self.assertRaises(ValueError):
            points([(0, 0, 0)])

    def test_every_operation_changes_the_region_that_is_there(self):
        paint = lambda operation: self.session.paint("one", operation)  # noqa: E731
        members = lambda: self.session.painting("one")["samples"]  # noqa: E731
        total = SIDE * SIDE
        self.assertEqual(paint(assign(LEFT)), members())
        left = members()
        self.assertEqual(paint(invert()), total)
        self.assertEqual(members(), total - left)
        gone = paint(remove(RIGHT))
        self.assertGreater(gone, 0)
        self.assertEqual(members(), total - left - gone)
        self.assertGreater(paint(grow(0.03)), 0)
        self.assertGreater(paint(shrink(0.03)), 0)
        paint(intersect(half_space((0.5, 0, 0), (1, 0, 0))))
        self.assertLess(members(), total // 2)
        paint(clear())
        self.assertEqual(members(), 0)
        self.assertEqual(paint(flood((0.5, 0.5, 0), angle_deg=180)), total)
        paint(clear())
        # Each normal points to one side: the two facings share the samples out.
        self.assertEqual(paint(add(everything(), facing=(0, 0, 1))) + paint(add(everything(), facing=(0, 0, -1))), total)
        paint(clear())
        self.session.paint("zero", LEFT)
        self.assertEqual(paint(add(everything(), steal=True)), total)
        self.assertEqual(self.session.painting("zero")["samples"], 0)
        self.session.replace_painting("zero", [LEFT, remove(box((-1, -1, -1), (0.1, 2, 1)))])
        self.assertEqual(len(self.session.painting("zero")["operations"]), 2)
        with self.assertRaises(StaleRevision):
            self.session.paint("zero", LEFT, revision=self.session.revision - 1)

    def test_frames_say_where_the_samples_are(self):
        session = self.painted()
        session.edit(translation((0, 0, 0.4)))
        arrays = session.samples(attributes=["normal", "t", "detail", "marks", "ids", "radius"]).arrays()
        session.download(self.path / "exact.ply")
        exact = numpy.array(support.read_ply(self.path / "exact.ply"))
        self.assertEqual(sorted(arrays["ids"]), list(range(SIDE * SIDE)))
        # Ids are in the service's order; each place of the file is met by the nearest sample of the frame.
        gaps = [numpy.abs(arrays["position"] - place).max(axis=1).min() for place in exact]
        self.assertLess(max(gaps), 1e-4)
        self.assertEqual({1: int((arrays["marks"] == 1).sum()), 2: int((arrays["marks"] == 2).sum())},
                         {1: 8 * SIDE, 2: 8 * SIDE})  # fmt: skip
        self.assertTrue((arrays["t"][arrays["marks"] == 2] == 1).all())
        numpy.testing.assert_allclose(numpy.linalg.norm(arrays["normal"], axis=1), 1, atol=1e-6)
        rest = session.samples(s=0, timing="together", level=0)
        self.assertEqual((rest.level, rest.sample_count), (0, SIDE * SIDE))

    def test_previews_show_what_edits_then_record(self):
        session = self.painted()
        shown = session.preview(translation((0, 0, 0.3)), attributes=["ids"], sequence=7)
        self.assertEqual(shown.sequence, 7)
        session.edit(translation((0, 0, 0.3)))
        places = [frame.arrays() for frame in (shown, session.samples(attributes=["ids"]))]
        order = [numpy.argsort(arrays["ids"]) for arrays in places]
        numpy.testing.assert_allclose(places[0]["position"][order[0]], places[1]["position"][order[1]], atol=1e-4)

    def test_a_stream_shows_events_and_frames_as_the_session_changes(self):
        session = self.painted()
        surface = Surface()
        stream = session.stream(attributes=["normal", "t"])
        first = next(stream)
        self.assertEqual((first["event"], first["revision"]), ("session", session.revision))
        for item in stream:
            if isinstance(item, Frame):
                surface.apply(item)
                break
        self.assertEqual(surface.revision, session.revision)
        rest = surface.arrays["position"].copy()
        other = self.client.session(session.id)
        other.show_preview(translation((0, 0, 0.4)), sequence=3)
        for item in stream:
            if isinstance(item, Frame):
                surface.apply(item)
                if surface.sequence == 3:
                    break
        lifted = surface.arrays["position"][:, 2] - rest[:, 2]
        self.assertGreater(lifted.max(), 0.3)
        self.assertLess(abs(lifted).min(), 1e-4)
        other.end_preview()
        doomed = self.cloud.open_session()
        events = doomed.stream()
        next(events)
        doomed.delete()
        last = list(events)[-1]
        self.assertEqual(last["event"], "end")

    def test_recipes_make_the_same_samples_again(self):
        session = self.painted()
        session.edit(translation((0, 0, 0.2)))
        session.edit(rotation((0.8, 0.5, 0), (0, 1, 0), 10))
        session.download(self.path / "first.ply")
        other = self.cloud.open_session(scales=[0.05])
        self.addCleanup(other.delete)
        other.apply_recipe(session.recipe())
        other.download(self.path / "second.ply")
        self.assertEqual((self.path / "first.ply").read_bytes(), (self.path / "second.ply").read_bytes())

    def test_refusals_say_what_is_wrong(self):
        with self.assertRaises(Invalid) as caught:
            self.session.paint("one", sphere((0, 0, 0), -1))
        problem = caught.exception
        self.assertEqual((problem.status, problem.slug), (422, "invalid-value"))
        self.assertEqual(problem.errors[0]["pointer"], "/shape/radius")
        self.assertTrue(problem.request_id)
        with self.assertRaises(NotFound):
            self.client.session("A" * 22)
        with self.assertRaises(Conflict):
            self.cloud.delete()
        with self.assertRaises(Invalid) as caught:
            self.session.edit(translation((0, 0, 1)))
        self.assertEqual(caught.exception.slug, "empty-region")
        with self.assertRaises((UnsupportedFormat, Invalid)):
            self.client.upload(b"no cloud at all")
        with self.assertRaises(ValueError):
            self.session.paint("one", sphere((float("nan"), 0, 0), 1))
        with self.assertRaises(Unreachable):
            Client("http://127.0.0.1:9", retries=0).info()

    def test_jobs_edit_scans_at_full_resolution(self):
        self.session.paint("zero", box((-9, -9, -9), (0.2, 9, 9)))
        self.session.paint("one", box((0.8, -9, -9), (9, 9, 9)))
        self.session.edit(translation((0, 0, 0.2)))
        estimate = self.client.validate_job(session=self.session)
        self.assertEqual((estimate["mode"], estimate["sample_count"]), ("tiles", self.cloud.sample_count))
        with self.assertRaises(TypeError):
            self.client.validate_job(sessions=self.session)
        job = self.client.submit_job(session=self.session, name="mine", priority=7).wait(timeout=60)
        result = job.results()["results"][0]
        target = self.path / "edited.ply"
        self.assertEqual(job.download(target), result["bytes"])
        self.assertEqual(target.stat().st_size, result["bytes"])
        self.assertIn("successful", job.log()[0])
        other = self.client.submit_job(recipe=self.session.recipe(), cloud=self.cloud, preview=self.cloud, format="xyz")
        self.assertEqual(other.wait(timeout=60).document["report"]["mode"], "memory")
        with self.assertRaises(ValueError):
            other.download(target, "result.ply")
        for each in (job, other):
            each.delete()
        self.assertEqual(self.client.jobs(), [])

    def test_uploads_tell_their_progress_and_their_limits(self):
        told = []
        cloud = self.client.upload(self.path / "sheet.ply", "mine", progress=told.append)
        self.assertEqual((cloud.name, told[-1], told == sorted(told)), ("mine", 1.0, True))
        self.assertEqual(cloud.sample_count, SIDE * SIDE)
        self.assertIn(cloud.id, [entry.id for entry in self.client.clouds()])
        cloud.download(self.path / "back.ply")
        self.assertEqual(support.read_ply(self.path / "back.ply"), support.read_ply(self.path / "sheet.ply"))
        cloud.delete()
        with open(self.path / "sheet.ply", "rb") as file:
            self.client.upload(file).delete()
        damaged = support.ply([(0, 0, 0), (float("nan"), 0, 0), (1, 1, 1)])
        with self.assertRaises(Invalid):
            self.client.upload(damaged, "damaged.ply")
        self.assertEqual(self.client.upload(damaged, nonfinite="drop").sample_count, 2)
        small = support.Daemon("--max-upload-bytes", "65536")
        try:
            with self.assertRaises(TooLarge) as caught:
                Client(small.url).upload(bytes(65537))
            self.assertEqual((caught.exception.limit, caught.exception.actual), (65536, 65537))
        finally:
            small.stop()

    def test_a_client_tells_its_server(self):
        self.assertTrue(self.client.ready())
        self.assertIn("max_samples", self.client.info()["limits"])
        self.assertIn(self.session.id, [entry["id"] for entry in self.client.sessions()])
        self.assertEqual(self.session.wait(timeout=10).state, "ready")
        self.assertEqual([level["level"] for level in self.session.levels], [0, 1])
        with self.assertRaises(BadFrame):
            Frame(b"")


class ReadmeExamples(unittest.TestCase):
    def test_the_examples_of_the_readme_run(self):
        text = (support.ROOT / "clients/python/README.md").read_text()
        examples = re.findall(r"^```python\n(.*?)^```$", text, re.M | re.S)
        self.assertGreaterEqual(len(examples), 5)
        daemon = support.Daemon()
        self.addCleanup(daemon.stop)
        back = os.getcwd()
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as printed:
            pathlib.Path(folder, "scan.ply").write_bytes(support.ply(support.sheet(30)))
            os.chdir(folder)
            try:
                names = {}
                for number, example in zip(itertools.count(1), examples):
                    code = compile(example.replace("http://127.0.0.1:8080", daemon.url), f"example {number}", "exec")
                    exec(code, names)  # noqa: S102
                self.assertEqual(len(support.read_ply("edited.ply")), 900)
            finally:
                os.chdir(back)
        self.assertIn("422 invalid-value", printed.getvalue())
        self.assertIn("the session is at revision", printed.getvalue())


if __name__ == "__main__":
    unittest.main()
