"""What the Python client does when servers and networks fail, and the parts of the interface that not every server has."""

import json
import os
import pathlib
import tempfile
import time
import unittest

import support
from pointwright import (
    Client, JobFailed, NotFound, NotSupported, Overloaded, QuotaReached, ServerError, TooLarge, Unreachable, WaitedTooLong,
)  # fmt: skip

BUSY = {"type": "/problems/overloaded", "title": "Busy", "status": 503, "limit": 4, "actual": 5}


def document(value, status=200, headers=None):
    return status, {"Content-Type": "application/json", **(headers or {})}, json.dumps(value).encode()


class Served(unittest.TestCase):
    def serve(self, handle):
        fake = support.Fake(handle)
        self.addCleanup(fake.close)
        client = Client(fake.url, "secret", backoff=0.001, retries=3)
        self.addCleanup(client.close)
        return fake, client


class Retries(Served):
    def test_an_overloaded_server_is_asked_again_after_the_pause_that_it_names(self):
        answers = [document(BUSY, 503, {"Retry-After": "0"}), document(BUSY, 429), document({"id": "c", "state": 1})]
        fake, client = self.serve(lambda request: answers.pop(0))
        client.request("POST", "/v1/sessions", json={"cloud": "c"})
        keys = [request.headers["Idempotency-Key"] for request in fake.requests]
        self.assertEqual(len(keys), 3)
        self.assertEqual(len(set(keys)), 1)
        self.assertEqual(fake.requests[0].headers["Authorization"], "Bearer secret")
        self.assertEqual({request.body for request in fake.requests}, {b'{"cloud": "c"}'})

    def test_in_the_end_it_is_overloaded(self):
        fake, client = self.serve(lambda request: document(BUSY, 503))
        with self.assertRaises(Overloaded) as caught:
            client.info()
        self.assertEqual((caught.exception.limit, caught.exception.actual), (4, 5))
        self.assertEqual(len(fake.requests), 4)

    def test_what_time_does_not_lift_is_not_asked_again(self):
        full = {"type": "/problems/too-many", "title": "A quota is used up", "status": 429, "limit": 1, "actual": 2}
        fake, client = self.serve(lambda request: document(full, 429))
        with self.assertRaises(QuotaReached) as caught:
            client.info()
        self.assertEqual((caught.exception.limit, caught.exception.actual), (1, 2))
        self.assertEqual(len(fake.requests), 1)
        passing, client = self.serve(lambda request: document(full, 429, {"Retry-After": "0"}))
        self.assertRaises(Overloaded, client.info)
        self.assertEqual(len(passing.requests), 4)

    def test_a_broken_connection_is_tried_again_where_that_does_no_harm(self):
        answers = [None, None, document({"sessions": []})]
        fake, client = self.serve(lambda request: answers.pop(0))
        self.assertEqual(client.sessions(), [])
        self.assertEqual(len(fake.requests), 3)

    def test_a_lost_answer_to_a_change_is_asked_for_again_only_with_keys(self):
        for features, changes in (([], 1), (["idempotency-keys"], 2)):
            with self.subTest(features):
                posts = []

                def handle(request):
                    if request.path == "/v1/info":
                        return document({"limits": {}, "features": features})
                    posts.append(request)
                    return None if len(posts) == 1 else document({"done": True})

                _, client = self.serve(handle)
                if features:
                    client.request("POST", "/v1/sessions", json={})
                else:
                    with self.assertRaises(Unreachable):
                        client.request("POST", "/v1/sessions", json={})
                self.assertEqual(len(posts), changes)
                self.assertEqual(len({post.headers["Idempotency-Key"] for post in posts}), 1)

    def test_taking_an_edit_out_is_repeated_with_its_key_or_not_at_all(self):
        for features, changes in (([], 1), (["idempotency-keys"], 2)):
            with self.subTest(features):
                asked = []

                def handle(request):
                    if request.path == "/v1/info":
                        return document({"limits": {}, "features": features})
                    asked.append(request)
                    return None if len(asked) == 1 else document({"done": True})

                _, client = self.serve(handle)
                if features:
                    client.request("DELETE", "/v1/sessions/s/edits/1", headers={"If-Match": "*"})
                else:
                    with self.assertRaises(Unreachable):
                        client.request("DELETE", "/v1/sessions/s/edits/1", headers={"If-Match": "*"})
                self.assertEqual(len(asked), changes)
                self.assertEqual(len({request.headers["Idempotency-Key"] for request in asked}), 1)

    def test_other_refusals_are_not_repeated_and_pages_of_proxies_are_problems_too(self):
        fake, client = self.serve(lambda request: (502, {}, b"<h1>Bad gateway</h1>"))
        with self.assertRaises(ServerError) as caught:
            client.info()
        self.assertEqual((caught.exception.status, caught.exception.errors), (502, []))
        self.assertEqual(len(fake.requests), 1)

    def test_a_body_is_sent_whole_on_each_attempt(self):
        answers = [document(BUSY, 503), document({"id": "c", "name": "n", "sample_count": 3}, 201)]

        def handle(request):
            if request.path == "/v1/info":
                return document({"limits": {}, "features": []})
            return answers.pop(0)

        fake, client = self.serve(handle)
        client.upload(b"x" * 100_000, "n")
        self.assertEqual([len(request.body) for request in fake.requests[1:]], [100_000, 100_000])

    def test_a_stream_is_opened_again_and_a_cut_one_is_known(self):
        import struct

        def record(event):
            payload = json.dumps(event).encode()
            return struct.pack("<II", 2, len(payload)) + payload

        body = json.dumps({"event": "heartbeat"}).encode()
        unknown = struct.pack("<II", 9, 3) + b"new"
        cut = struct.pack("<II", 2, 100) + body
        answers = [record({"event": "heartbeat"}) + cut, unknown + record({"event": "end", "reason": "over"})]
        session = {"id": "s", "revision": 1, "state": "ready", "levels": []}

        def handle(request):
            return (200, {}, answers.pop(0)) if "/stream" in request.path else document(session)

        fake, client = self.serve(handle)
        events = [event["event"] for event in client.session("s").stream()]
        self.assertEqual(events, ["heartbeat", "end"])
        self.assertEqual(len(fake.requests), 3)

    def test_waiting_ends(self):
        session = {"id": "s", "revision": 0, "state": "building", "progress": {"phase": "normals", "fraction": 0.5}}
        _, client = self.serve(lambda request: document(session))
        seen = []
        with self.assertRaises(WaitedTooLong):
            client.session("s").wait(timeout=0, progress=lambda *now: seen.append(now))
        self.assertEqual(seen, [("normals", 0.5)])


class ResumableUploads(Served):
    data = bytes(range(256)) * 40

    def test_parts_arrive_whole_with_their_checksums(self):
        tus = support.TusServer()
        _, client = self.serve(tus)
        told = []
        cloud = client.upload(self.data, "scan", resumable=True, part_bytes=4096, progress=told.append)
        self.assertEqual((cloud.name, cloud.sample_count), ("scan", len(self.data)))
        self.assertEqual(bytes(tus.uploads["u0"][1]), self.data)
        self.assertEqual((tus.parts, tus.checked, told[-1]), (3, 3, 1.0))

    def test_drops_halves_and_refusals_are_survived(self):
        tus = support.TusServer(
            trouble=lambda request, number: {1: None, 3: document(BUSY, 503), 5: (460, {}, b"")}.get(number, False),
            cut=lambda number, size: size // 2,
        )
        _, client = self.serve(tus)
        client.upload(self.data, resumable=True, part_bytes=4096)
        self.assertEqual(bytes(tus.uploads["u0"][1]), self.data)

    def test_another_process_goes_on_where_one_was_ended(self):
        tus = support.TusServer(trouble=lambda request, number: (500, {}, b"") if number == 2 else False)
        _, client = self.serve(tus)
        with tempfile.TemporaryDirectory() as folder:
            path, state = pathlib.Path(folder, "scan.ply"), os.path.join(folder, "state")
            path.write_bytes(self.data)
            with self.assertRaises(ServerError):
                client.upload(path, resume_file=state, part_bytes=4096)
            self.assertTrue(os.path.exists(state))
            again = Client(client.url)
            self.addCleanup(again.close)
            again.upload(path, resume_file=state, part_bytes=4096)
            self.assertFalse(os.path.exists(state))
            self.assertEqual(list(tus.uploads), ["u0"])
            self.assertEqual(bytes(tus.uploads["u0"][1]), self.data)
            # A file that changed meanwhile, or an upload that is gone, begins anew.
            tus.trouble = lambda request, number: (500, {}, b"") if number == tus.parts and number == 5 else False
            with self.assertRaises(ServerError):
                again.upload(path, resume_file=state, part_bytes=8192)
            path.write_bytes(self.data + b"!")
            again.upload(path, resume_file=state, part_bytes=8192)
            self.assertEqual(bytes(tus.uploads["u2"][1]), self.data + b"!")

    def test_limits_and_servers_without_it_are_told(self):
        _, client = self.serve(support.TusServer())
        with self.assertRaises(TooLarge):
            client.upload(bytes(100_000_001), resumable=True)
        _, without = self.serve(lambda request: document({"title": "no", "status": 404}, 404))
        with self.assertRaises(NotSupported):
            without.upload(b"abc", resumable=True)


class Jobs(Served):
    """Against answers in the words of OGC API – Processes; a server with jobs answers the same."""

    def job_server(self, ending):
        self.deletions = []
        states = [("accepted", 0), ("running", 40), (ending, 100)]

        def handle(request):
            method, path = request.command, request.path
            if (method, path) == ("POST", "/v1/jobs"):
                self.submitted = json.loads(request.body)
                return document({"jobID": "j1", "status": "accepted", "progress": 0}, 202, {"Location": "/v1/jobs/j1"})
            if path.startswith("/v1/jobs/j1/log"):
                return 200, {}, b"tile 1 of 2\ntile 2 of 2\n"[int(path.split("offset=")[1]) :]
            if path == "/v1/jobs/j1/results":
                result = {"name": "result.ply", "href": "/v1/jobs/j1/results/result.ply", "bytes": 10}
                return document({"results": [result], "report": {"mode": "tiles"}})
            if path == "/v1/jobs/j1/results/result.ply":
                return 200, {}, b"part"
            if path == "/v1/jobs/j1/restart":
                return document({"jobID": "j1", "status": "accepted"}, 202)
            if method == "DELETE":
                self.deletions.append(path)
                return document({"jobID": "j1", "status": "dismissed"})
            status, progress = states[0] if len(states) == 1 else states.pop(0)
            job = {"jobID": "j1", "status": status, "progress": progress, "message": "no room" if ending == "failed" else ""}
            return document({"jobs": [job]} if path == "/v1/jobs" else job)

        return self.serve(handle)[1]

    def test_a_job_is_followed_to_its_end(self):
        client = self.job_server("successful")
        job = client.submit_job(cloud="c", recipe={"format": "pointwright-recipe"}, preview=500)
        self.assertEqual(self.submitted, {"cloud": "c", "recipe": {"format": "pointwright-recipe"}, "preview": {"count": 500}})
        told = []
        start = time.monotonic()
        self.assertEqual(job.wait(timeout=60, progress=told.append).status, "successful")
        self.assertLess(time.monotonic() - start, 60)
        self.assertEqual(told, [0.0, 0.4, 1.0])
        text, offset = job.log()
        self.assertEqual(text.count("\n"), 2)
        self.assertEqual(job.log(offset), ("", offset))
        self.assertEqual(job.results()["report"]["mode"], "tiles")
        with self.assertRaises(ValueError):
            job.download(os.devnull, "absent.ply")
        with tempfile.TemporaryDirectory() as folder:
            target = os.path.join(folder, "result.ply")
            with open(target, "wb") as file:
                file.write(b"mine")
            with self.assertRaisesRegex(Unreachable, "after 4 of 10 bytes"):
                job.download(target)
            with open(target, "rb") as file:
                self.assertEqual(file.read(), b"mine", "a part takes no file's place")
            self.assertEqual(os.listdir(folder), ["result.ply"])
        self.assertEqual([entry.id for entry in client.jobs()], ["j1"])
        self.assertEqual(job.restart().status, "accepted")
        self.assertEqual(job.cancel().status, "dismissed")
        job.delete()
        self.assertEqual(self.deletions, ["/v1/jobs/j1?only=dismiss", "/v1/jobs/j1?only=forget"])

    def test_failures_say_why(self):
        job = self.job_server("failed").job("j1")
        with self.assertRaises(JobFailed) as caught:
            job.wait()
        self.assertEqual(str(caught.exception), "no room")

    def test_servers_without_jobs_say_so(self):
        def handle(request):
            if request.path == "/v1/info":
                return document({"limits": {}, "features": []})
            return document({"type": "/problems/not-found", "title": "There is no such thing", "status": 404}, 404)

        _, client = self.serve(handle)
        with self.assertRaisesRegex(NotSupported, "no jobs"):
            client.jobs()
        with self.assertRaises(NotFound):
            client.job("j1")
        with self.assertRaises(ValueError):
            client.submit_job(cloud="c")


if __name__ == "__main__":
    unittest.main()
