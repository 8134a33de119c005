"""The Python client over TLS: whom it trusts, and whom it does not."""

import os
import pathlib
import tempfile
import unittest
import unittest.mock

import support
from pointwright import Client, Unreachable


class OverTls(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.ca, key = support.certificate(folder.name, "own")
        self.other, _ = support.certificate(folder.name, "other")
        self.daemon = support.Daemon("--tls-cert", self.ca, "--tls-key", key)
        self.addCleanup(self.daemon.stop)

    def test_a_whole_edit_by_a_file_of_authorities(self):
        path = pathlib.Path(self.folder, "sheet.ply")
        path.write_bytes(support.ply(support.sheet(20)))
        # A variable that others read does not take its place.
        with unittest.mock.patch.dict(os.environ, {"REQUESTS_CA_BUNDLE": self.other}):
            with Client(self.daemon.url, ca=self.ca) as client:
                session = client.upload(path).open_session(scales=[0.05])
                session.download(path)
        self.assertEqual(len(support.read_ply(path)), 400)
        with unittest.mock.patch.dict(os.environ, {"POINTWRIGHT_CA": self.ca}):
            Client(self.daemon.url).info()

    def test_strangers_and_other_names_are_refused_at_once(self):
        named, key = support.certificate(self.folder, "named", "DNS:elsewhere.test")
        elsewhere = support.Daemon("--tls-cert", named, "--tls-key", key)
        self.addCleanup(elsewhere.stop)
        for url, ca in ((self.daemon.url, None), (self.daemon.url, self.other), (elsewhere.url, named)):
            with self.assertRaisesRegex(Unreachable, "(?i)certificate"):
                Client(url, ca=ca, backoff=60).info()
            with self.assertRaisesRegex(Unreachable, "(?i)certificate"):
                Client(url, ca=ca, backoff=60).upload(support.ply(support.sheet(20)))
        with self.assertRaises(ValueError):
            Client(self.daemon.url, ca="/nonexistent")

    def test_a_certificate_that_changes_during_an_upload_ends_it_at_once(self):
        data = support.ply(support.sheet(20))
        with Client(self.daemon.url, ca=self.ca, backoff=60) as client:
            parts = []

            def distrust(done):
                parts.append(done)
                client._verify = self.other
                client._http.close()  # connections that were verified before

            with self.assertRaisesRegex(Unreachable, "(?i)certificate"):
                client.upload(data, resumable=True, part_bytes=4096, progress=distrust)
            self.assertEqual(len(parts), 1)


if __name__ == "__main__":
    unittest.main()
