// Hostile bytes against the port of a daemon that has a certificate: what is no TLS, handshakes that are cut or spoiled,
// rubbish within a connection that was made properly.
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { request } from "node:https";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { connect as connectTls } from "node:tls";
import { root } from "../support/process.mjs";
import {
  comesTrue,
  descriptorsOf,
  mutant,
  Report,
  randomFrom,
  rawConnection,
  residentBytes,
  sleep,
  wavySheet,
} from "./support.mjs";

const binary = process.env.POINTWRIGHTD ?? resolve(root, "build/release/server/pointwrightd");
const mebi = 1024 * 1024;
const plainRequest = "GET /v1/info HTTP/1.1\r\nHost: localhost\r\n\r\n";

/** A certificate for localhost of the battery's own: the files, and the certificate's text. */
function certify(work) {
  const [key, cert] = [join(work, "key.pem"), join(work, "cert.pem")];
  const made = spawnSync("openssl", [
    ...["req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "1"],
    ...["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost", "-keyout", key, "-out", cert],
  ]);
  if (made.status !== 0) throw new Error(`openssl makes no certificate: ${made.error ?? made.stderr}`);
  return { key, cert, ca: readFileSync(cert) };
}

/** A daemon with the certificate, once it listens: {port, child, ended}. */
async function start(work, { cert, key }) {
  const portFile = join(work, "port");
  const child = spawn(
    binary,
    ["--port", "0", "--port-file", portFile, "--tls-cert", cert, "--tls-key", key, "--log-level", "off"],
    { stdio: "ignore" },
  );
  const ended = new Promise((done) => child.once("exit", (code, signal) => done(code ?? signal)));
  let port = "";
  const isListening = () => {
    try {
      port = readFileSync(portFile, "utf8");
    } catch {}
    return port.endsWith("\n") || child.exitCode !== null;
  };
  await comesTrue(isListening, 30_000);
  if (!port.endsWith("\n")) throw new Error("the daemon does not start");
  return { port: Number(port), child, ended };
}

/** One request of an honest client, which verifies the certificate: {status, body, ms}. Never throws. */
function askTls(port, ca, method, path, { body, headers = {} } = {}) {
  const begin = performance.now();
  return new Promise((done) => {
    const finish = (answer) => done({ body: "", ms: performance.now() - begin, ...answer });
    const length = body === undefined ? {} : { "Content-Length": Buffer.byteLength(body) };
    const sent = request(
      {
        ...{ host: "127.0.0.1", servername: "localhost", port, ca, method, path, agent: false },
        ...{ headers: { Host: `localhost:${port}`, ...length, ...headers }, timeout: 30_000 },
      },
      (answer) => {
        const chunks = [];
        answer.on("data", (chunk) => chunks.push(chunk));
        answer.on("end", () => finish({ status: answer.statusCode, body: Buffer.concat(chunks).toString() }));
        answer.on("error", () => finish({ status: 0 }));
      },
    );
    sent.on("timeout", () => sent.destroy());
    sent.on("error", () => finish({ status: 0 }));
    sent.end(body);
  });
}

/** The first bytes of a client that speaks TLS, as this machine's own does. */
function clientHello() {
  return new Promise((done) => {
    const server = createServer((socket) => {
      socket.on("error", () => {});
      socket.once("data", (bytes) => {
        socket.destroy();
        server.close();
        done(bytes);
      });
    });
    server.listen(0, "127.0.0.1", () => {
      connectTls({ host: "127.0.0.1", port: server.address().port, servername: "localhost" }).on(
        "error",
        () => {},
      );
    });
  });
}

const randomBytes = (random, most) =>
  Buffer.from(Array.from({ length: 1 + Math.floor(random() * most) }, () => Math.floor(random() * 256)));

/** Bytes of each kind in turn. */
function hostileBytes(kind, hello, random) {
  const cut = hello.subarray(0, 1 + Math.floor(random() * (hello.length - 1)));
  switch (kind) {
    case 0:
      return randomBytes(random, 4000);
    case 1:
      return Buffer.from(plainRequest);
    case 2:
      return cut;
    case 3:
      return mutant(hello, random);
    case 4:
      return Buffer.concat([hello, randomBytes(random, 4000)]);
    case 5: // a record of another kind, or longer than any may be
      return Buffer.concat([
        Buffer.from([20 + (hello.length % 5), 3, 3, 0xff, 0xff]),
        randomBytes(random, 70_000),
      ]);
    default:
      return hello;
  }
}
const kinds = 7;

/** Sends the bytes and goes, in order or with a reset; answers what came back. */
async function throwAt(port, bytes, isReset) {
  const thrown = rawConnection(`http://127.0.0.1:${port}`);
  await new Promise((done) => thrown.socket.write(bytes, done));
  if (isReset) thrown.socket.resetAndDestroy();
  else thrown.socket.end();
  await comesTrue(() => thrown.isClosed, 2000);
  thrown.socket.destroy();
  return thrown.read;
}

/** A proper handshake, half a request, and rubbish where a record should be. */
async function spoilWithin(port, ca, random) {
  const raw = rawConnection(`http://127.0.0.1:${port}`);
  const secure = connectTls({ socket: raw.socket, servername: "localhost", ca });
  secure.on("error", () => {});
  const isSecure = await new Promise((done) => {
    secure.once("secureConnect", () => done(true));
    secure.once("close", () => done(false));
  });
  if (isSecure) {
    secure.write(plainRequest.slice(0, Math.floor(random() * (plainRequest.length - 4))));
    await sleep(2);
    raw.socket.write(randomBytes(random, 4000));
    await comesTrue(() => raw.isClosed, 2000);
  }
  raw.socket.destroy();
  return isSecure;
}

export async function tls({ scale, seed }) {
  const report = new Report("hostile bytes against TLS");
  const random = randomFrom(seed + 4);
  const work = mkdtempSync(join(tmpdir(), "pointwright-battery-"));
  let daemon = null;
  try {
    const files = certify(work);
    daemon = await start(work, files);
    const { port, child } = daemon;
    const ask = (...rest) => askTls(port, files.ca, ...rest);
    const hello = await clientHello();
    await ask("GET", "/healthz");
    const [descriptors, memory] = [descriptorsOf(child.pid), residentBytes(child.pid)];
    const count = Math.max(70, Math.ceil(5000 * scale));
    const health = [];
    const answered = [];
    let spoiled = 0;
    for (let i = 0; i < count; i += 14) {
      const all = Array.from({ length: 14 }, (_, k) =>
        throwAt(port, hostileBytes((i + k) % kinds, hello, random), random() < 0.3),
      );
      const [isSpoiled, alive, ...replies] = await Promise.all([
        spoilWithin(port, files.ca, random),
        ask("GET", "/healthz"),
        ...all,
      ]);
      spoiled += isSpoiled ? 1 : 0;
      health.push(alive);
      answered.push(...replies.filter((text) => /HTTP\/1\.1 2|"limits"/.test(text)));
    }
    report.check(
      `an honest client is served throughout, beside ${count} hostile ones`,
      health.every(({ status }) => status === 200),
      `${health.filter(({ status }) => status !== 200).length} of ${health.length} not`,
    );
    const slowest = Math.max(...health.map(({ ms }) => ms));
    report.check("health checks stay below 2 s", slowest < 2000, `${slowest.toFixed(0)} ms`);
    report.check("nothing is served without TLS", answered.length === 0, (answered[0] ?? "").slice(0, 60));
    report.check("connections that turn to rubbish were made properly before", spoiled > 0, `${spoiled}`);
    const back = await comesTrue(() => descriptorsOf(child.pid) <= descriptors + 8, 30_000);
    report.check("descriptors come back", back, `${descriptors} before, ${descriptorsOf(child.pid)} after`);
    const grown = (residentBytes(child.pid) - memory) / mebi;
    report.check("memory stays", grown < 64, `${grown.toFixed(1)} MiB more`);
    const cloud = await ask("POST", "/v1/clouds?name=sheet", {
      body: wavySheet(30),
      headers: { "Content-Type": "application/x-ply" },
    });
    report.check("a cloud is taken afterwards", cloud.status === 201, `${cloud.status}`);
    child.kill("SIGTERM");
    const status = await daemon.ended;
    report.check("it stops in order", status === 0, `${status}`);
  } finally {
    daemon?.child.kill("SIGKILL");
    rmSync(work, { recursive: true, force: true });
  }
  return report;
}
