"""The command line against servers whose answers are written down: breaks, resumed uploads, jobs."""

import base64
import hashlib
import json
import os
import pathlib
import re
import signal
import subprocess
import tempfile
import threading
import unittest

import support

PROGRAM = os.environ.get("POINTWRIGHT", str(support.ROOT / "build/release/server/pointwright"))


def document(value, status=200, headers=None):
    return status, {"Content-Type": "application/json", **(headers or {})}, json.dumps(value).encode()


class CommandLine(unittest.TestCase):
    def serve(self, handle):
        fake = support.Fake(handle)
        self.addCleanup(fake.close)
        return fake

    def environment(self, fake, **more):
        return {**os.environ, "POINTWRIGHT_SERVER": fake.url, "POINTWRIGHT_RETRY_SECONDS": "0.001", **more}

    def ask(self, fake, *arguments, **more):
        return subprocess.run(
            [PROGRAM, *arguments], env=self.environment(fake, **more), capture_output=True, timeout=120, check=False
        )

    def scan(self, data):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        path = pathlib.Path(folder.name, "scan.ply")
        path.write_bytes(data)
        return path


class Answers(CommandLine):
    def test_overloaded_servers_are_asked_again_with_one_key_and_the_token(self):
        busy = document({"title": "Busy", "status": 503}, 503, {"Retry-After": "0"})
        answers = [busy, None, document({"id": "s", "state": "building"}, 202)]

        def handle(request):
            if request.path == "/v1/info":
                return document({"limits": {}, "features": ["idempotency-keys"]})
            return answers.pop(0)

        fake = self.serve(handle)
        ended = self.ask(fake, "session", "create", "c", POINTWRIGHT_TOKEN="secret")
        self.assertEqual((ended.returncode, ended.stdout), (0, b"s\n"), ended.stderr)
        posts = [request for request in fake.requests if request.command == "POST"]
        self.assertEqual(len(posts), 3)
        self.assertEqual(len({post.headers["Idempotency-Key"] for post in posts}), 1)
        self.assertEqual({post.headers["Authorization"] for post in posts}, {"Bearer secret"})

    def test_what_time_does_not_lift_is_not_asked_again(self):
        full = {"type": "/problems/too-many", "title": "Full", "detail": "no more clouds", "status": 429}
        for headers, asked in (({}, 1), ({"Retry-After": "0"}, 3)):
            with self.subTest(headers):
                answers = [document(full, 429, headers)] * 2
                fake = self.serve(lambda request: answers.pop(0) if answers else document({"clouds": []}))
                ended = self.ask(fake, "cloud", "list")
                self.assertEqual(ended.returncode == 0, asked == 3, ended.stderr)
                self.assertEqual(len(fake.requests), asked)

    def test_a_lost_answer_to_a_change_is_not_risked_twice(self):
        fake = self.serve(
            lambda request: document({"limits": {}, "features": []}) if request.path == "/v1/info" else None
        )
        ended = self.ask(fake, "session", "create", "c")
        self.assertEqual(ended.returncode, 3)
        self.assertEqual(len([request for request in fake.requests if request.command == "POST"]), 1)

    def test_servers_that_stay_broken_end_with_3(self):
        fake = self.serve(lambda request: (502, {}, b"<h1>Bad gateway</h1>"))
        ended = self.ask(fake, "cloud", "list")
        self.assertEqual(ended.returncode, 3)
        self.assertIn(b"the server answered 502", ended.stderr)
        self.assertNotIn(b"\r", ended.stderr)

    def test_a_server_below_a_path_and_a_token_file(self):
        fake = self.serve(lambda request: document({"clouds": []}))
        token = self.scan(b"of-a-file\n")
        ended = self.ask(fake, "cloud", "list", "--server", fake.url + "/points/", "--token-file", str(token))
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.assertEqual(fake.requests[0].path, "/points/v1/clouds")
        self.assertEqual(fake.requests[0].headers["Authorization"], "Bearer of-a-file")


class ResumedUploads(CommandLine):
    data = os.urandom(1 << 16) * 300  # three parts of 8 MiB, the last one not full

    def test_ctrl_c_leaves_an_upload_that_goes_on(self):
        reached = threading.Event()

        def trouble(request, number):
            if number == 2 and not reached.is_set():
                reached.set()
                threading.Event().wait(0.5)  # the signal comes while this part is on its way
                return None
            return False

        tus = support.TusServer(trouble, cut=lambda number, size: size // 2)
        fake = self.serve(tus)
        path = self.scan(self.data)
        process = subprocess.Popen(
            [PROGRAM, "upload", "--resume", str(path)],
            env=self.environment(fake), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.assertTrue(reached.wait(60))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
        self.assertEqual((process.returncode, out), (130, b""), err)
        self.assertIn(b"upload --resume", err)
        self.assertTrue(pathlib.Path(f"{path}.upload").exists())
        before = tus.parts
        ended = self.ask(fake, "upload", "--resume", str(path), "--name", "whole", "--json")
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.assertEqual(json.loads(ended.stdout)["name"], "whole")
        self.assertEqual(list(tus.uploads), ["u0"])
        self.assertEqual(hashlib.sha256(tus.uploads["u0"][1]).digest(), hashlib.sha256(self.data).digest())
        self.assertLessEqual(tus.parts - before, 2)
        self.assertFalse(pathlib.Path(f"{path}.upload").exists())
        created = next(request for request in fake.requests if request.path == "/v1/uploads"
                       and request.command == "POST")  # fmt: skip
        self.assertEqual(base64.b64decode(created.headers["Upload-Metadata"].split()[1]), b"scan.ply")
        self.assertGreater(tus.checked, 0)

    def test_breaks_are_survived_within_one_command(self):
        damaged = (460, {}, b"")
        tus = support.TusServer(
            lambda request, number: {1: None, 2: damaged, 4: (503, {"Retry-After": "0"}, b"")}.get(number, False),
            cut=lambda number, size: size // 3,
        )
        fake = self.serve(tus)
        path = self.scan(self.data)
        ended = self.ask(fake, "upload", "--resume", str(path))
        self.assertEqual((ended.returncode, ended.stdout), (0, b"cloud\n"), ended.stderr)
        self.assertEqual(bytes(tus.uploads["u0"][1]), self.data)

    def test_an_upload_of_a_file_that_changed_begins_anew(self):
        tus = support.TusServer(lambda request, number: (403, {}, b"") if number == 1 else False)
        fake = self.serve(tus)
        path = self.scan(b"first")
        self.assertEqual(self.ask(fake, "upload", "--resume", str(path)).returncode, 2)
        path.write_bytes(b"second one")
        self.assertEqual(self.ask(fake, "upload", "--resume", str(path)).returncode, 0)
        self.assertEqual(bytes(tus.uploads["u1"][1]), b"second one")


class Jobs(CommandLine):
    def test_jobs_are_submitted_followed_and_cancelled(self):
        states = [("accepted", 0), ("running", 40), ("successful", 100)]

        def handle(request):
            method, path = request.command, request.path
            if (method, path) == ("POST", "/v1/jobs"):
                return document({"jobID": "j1", "status": "accepted"}, 202, {"Location": "/v1/jobs/j1"})
            if path.startswith("/v1/jobs/j1/log"):
                return 200, {}, b"tile 1 of 2\n"[int(path.split("offset=")[1]) :]
            if path == "/v1/jobs/j1/results":
                result = {"name": "result.ply", "href": "/v1/jobs/j1/results/result.ply", "bytes": 10}
                return document({"results": [result]})
            if path == "/v1/jobs/j1/results/result.ply":
                return 200, {}, b"part"
            if method == "DELETE":
                ended = states[0][0] == "successful"
                if path != f"/v1/jobs/j1?only={'forget' if ended else 'dismiss'}":
                    problem = {"type": "/problems/wrong-state", "title": "Wrong state", "detail": "the job has ended"}
                    return document(problem, 409)
                return document({"jobID": "j1", "status": "dismissed"})
            status, progress = states.pop(0) if len(states) > 1 else states[0]
            job = {"jobID": "j1", "status": status, "progress": progress}
            return document({"jobs": [job]} if path == "/v1/jobs" else job)

        fake = self.serve(handle)
        recipe = self.scan(b'{"format": "pointwright-recipe"}')
        submitted = self.ask(fake, "job", "submit", "--recipe", str(recipe), "--cloud", "c", "--priority", "7")
        self.assertEqual((submitted.returncode, submitted.stdout), (0, b"j1\n"), submitted.stderr)
        self.assertEqual(json.loads(fake.requests[0].body),
                         {"cloud": "c", "recipe": {"format": "pointwright-recipe"}, "priority": 7})  # fmt: skip
        self.assertEqual(self.ask(fake, "job", "wait", "j1", "--timeout", "0").returncode, 5)
        waited = self.ask(fake, "job", "wait", "j1")
        self.assertEqual(waited.returncode, 0, waited.stderr)
        self.assertIn(b"successful", waited.stdout)
        self.assertEqual(self.ask(fake, "job", "log", "j1", "--offset", "5").stdout, b"1 of 2\n")
        self.assertIn(b"j1", self.ask(fake, "job", "list").stdout)
        target = self.scan(b"mine")
        for name in (str(target), "-"):
            partly = self.ask(fake, "job", "download", "j1", "-o", name)
            self.assertEqual(partly.returncode, 3, partly.stderr)
            self.assertIn(b"after 4 of 10 bytes", partly.stderr)
        self.assertEqual(target.read_bytes(), b"mine", "a part takes no file's place")
        states[:] = [("running", 40)]
        self.assertEqual(self.ask(fake, "job", "cancel", "j1").returncode, 0)
        states[:] = [("successful", 100)]
        ended = self.ask(fake, "job", "cancel", "j1")  # its results stay
        self.assertEqual(ended.returncode, 4)
        self.assertIn(b"has ended", ended.stderr)
        self.assertEqual(self.ask(fake, "job", "delete", "j1").returncode, 0)
        states[:] = [("failed", 40)]
        self.assertEqual(self.ask(fake, "job", "wait", "j1").returncode, 2)


class ReadmeLines(unittest.TestCase):
    def test_the_lines_of_the_readme_run(self):
        text = (support.ROOT / "clients/README.md").read_text()
        lines = re.search(r"^```sh\n(.*?)^```$", text, re.M | re.S)
        self.assertIsNotNone(lines)
        daemon = support.Daemon()
        self.addCleanup(daemon.stop)
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "scan.ply").write_bytes(support.ply(support.sheet(30)))
            script = lines.group(1).replace("http://127.0.0.1:8080", daemon.url)
            path = f"{os.path.dirname(PROGRAM)}:{os.environ['PATH']}"
            ended = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", script],
                cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, timeout=120, check=False,
            )  # fmt: skip
            self.assertEqual(ended.returncode, 0, ended.stderr)
            self.assertEqual(len(support.read_ply(pathlib.Path(folder, "edited.ply"))), 900)
            self.assertIn(b'"edits": 1', ended.stdout)
            self.assertIn(b"(undone)", ended.stdout)


if __name__ == "__main__":
    unittest.main()
