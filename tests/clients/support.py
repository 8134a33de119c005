"""What the clients' tests share: a daemon of their own, small clouds, and a server whose answers are written down."""

import atexit
import http.server
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients/python"))
# As in web/demo/daemon.mjs: the environment may name another build's daemon.
DAEMON = os.environ.get("POINTWRIGHTD", str(ROOT / "build/release/server/pointwrightd"))


class Daemon:
    """A daemon on a free port of loopback, ended by its process id."""

    def __init__(self, *arguments):
        self.folder = tempfile.mkdtemp(prefix="pointwright-")
        port_file = pathlib.Path(self.folder, "port")
        self.log = open(pathlib.Path(self.folder, "log"), "wb")
        command = [DAEMON, "--port", "0", "--port-file", str(port_file), *arguments]
        self.process = subprocess.Popen(command, stdout=self.log, stderr=self.log)
        atexit.register(self.stop)
        ends = time.monotonic() + 30
        while not (port_file.exists() and port_file.read_text().endswith("\n")):
            if self.process.poll() is not None or time.monotonic() > ends:
                raise RuntimeError("the daemon does not start: " + pathlib.Path(self.folder, "log").read_text())
            time.sleep(0.01)
        scheme = "https" if "--tls-cert" in arguments else "http"
        self.url = f"{scheme}://127.0.0.1:{port_file.read_text().strip()}"

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.log.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def certificate(folder, name, names="DNS:localhost,IP:127.0.0.1"):
    """A key and a certificate signed by it, for the names: the files' paths."""
    made = pathlib.Path(folder, f"{name}.pem"), pathlib.Path(folder, f"{name}.key")
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1",
         "-subj", "/CN=localhost", "-addext", f"subjectAltName={names}",
         "-out", str(made[0]), "-keyout", str(made[1])],
        check=True, capture_output=True,
    )  # fmt: skip
    return str(made[0]), str(made[1])


def sheet(side):
    """A wavy sheet over the unit square: side * side samples, row after row, as (x, y, z)."""
    steps = [i / (side - 1) for i in range(side)]
    return [(x, y, 0.02 * math.sin(20 * x) * math.cos(17 * y)) for y in steps for x in steps]


def ply(samples):
    """Samples as a binary PLY file."""
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(samples)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    return head.encode() + b"".join(struct.pack("<fff", *sample) for sample in samples)


def read_ply(path):
    """The positions of a binary PLY file whose vertices begin with float x, y, z."""
    data = pathlib.Path(path).read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    count = int(next(line for line in lines if line.startswith("element vertex ")).split()[2])
    kinds = [line.split()[1] for line in lines if line.startswith("property ")]
    sizes = {"float": 4, "double": 8, "uchar": 1, "int": 4, "uint": 4, "short": 2, "ushort": 2, "char": 1}
    stride = sum(sizes[kind] for kind in kinds)
    assert kinds[:3] == ["float"] * 3 and len(body) == count * stride
    return [struct.unpack_from("<fff", body, i * stride) for i in range(count)]


class Fake:
    """A server that answers by a function: handle(request) -> (status, headers, body) or None, which drops the
    connection. A request has method, path, headers and body; all of them are kept."""

    def __init__(self, handle):
        fake = self
        self.requests = []

        class Handler(http.server.BaseHTTPRequestHandler):
            def answer(self):
                self.body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                fake.requests.append(self)
                answered = handle(self)
                if answered is None:
                    self.close_connection = True
                    self.connection.close()
                    return
                status, headers, body = answered
                self.send_response(status)
                for name, value in {"Content-Length": str(len(body)), **headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(body)

            method = property(lambda self: self.command)
            do_GET = do_POST = do_PUT = do_PATCH = do_DELETE = do_HEAD = do_OPTIONS = answer

            def log_message(self, *_):
                pass

            def finish(self):
                try:
                    super().finish()
                except (OSError, ValueError):
                    pass  # a connection that was dropped

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        self._thread = threading.Thread(target=self.server.serve_forever, daemon=True)
        self._thread.start()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


class TusServer:
    """Resumable uploads as a Fake answers them (tus 1.0: creation, checksum), and the import of what was uploaded.
    `trouble(request, number)` may answer a PATCH in its place; None in a list drops the connection."""

    def __init__(self, trouble=None, cut=None):
        self.uploads = {}
        self.checked = 0
        self.parts = 0
        self.trouble = trouble or (lambda request, number: False)
        self.cut = cut or (lambda number, size: size)

    def __call__(self, request):
        import base64
        import hashlib
        import json

        tus = {"Tus-Resumable": "1.0.0"}
        path, method = request.path.split("?")[0], request.command
        if method == "OPTIONS":
            return 204, {**tus, "Tus-Version": "1.0.0", "Tus-Extension": "creation,checksum,termination",
                         "Tus-Checksum-Algorithm": "sha256", "Tus-Max-Size": "100000000"}, b""
        if path == "/v1/info":
            return 200, {}, json.dumps({"limits": {}, "features": []}).encode()
        if path == "/v1/clouds":
            body = json.loads(request.body)
            data = bytes(self.uploads[body["upload"]][1])
            cloud = {"id": "cloud", "name": body.get("name", ""), "sample_count": len(data)}
            return 201, {"Content-Type": "application/json"}, json.dumps(cloud).encode()
        assert request.headers["Tus-Resumable"] == "1.0.0"
        if method == "POST":
            name = f"u{len(self.uploads)}"
            self.uploads[name] = (int(request.headers["Upload-Length"]), bytearray())
            return 201, {**tus, "Location": f"/v1/uploads/{name}"}, b""
        entry = self.uploads.get(path.rsplit("/", 1)[-1])
        if entry is None:
            return 404, {}, b""
        size, data = entry
        if method == "HEAD":
            return 200, {**tus, "Upload-Offset": str(len(data)), "Upload-Length": str(size)}, b""
        assert method == "PATCH" and request.headers["Content-Type"] == "application/offset+octet-stream"
        self.parts += 1
        answer = self.trouble(request, self.parts)
        if answer is not False:
            kept = self.cut(self.parts, len(request.body)) if answer is None else 0
            data.extend(request.body[:kept])
            return answer
        if int(request.headers["Upload-Offset"]) != len(data):
            return 409, tus, b""
        if "Upload-Checksum" in request.headers:
            kind, value = request.headers["Upload-Checksum"].split()
            assert kind == "sha256" and base64.b64decode(value) == hashlib.sha256(request.body).digest()
            self.checked += 1
        data.extend(request.body)
        return 204, {**tus, "Upload-Offset": str(len(data))}, b""
