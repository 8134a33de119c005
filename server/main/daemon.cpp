#include "server/main/daemon.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <exception>
#include <iostream>
#include <thread>

#include "engine/multires/hierarchy.h"
#include "server/base/sha256.h"
#include "server/handlers/service.h"
#include "server/http/http_server.h"
#include "server/http/tls.h"
#include "server/ingest/files.h"
#include "server/log/log.h"
#include "server/routes/routes.h"

namespace pointwright::server {
namespace {

HttpOptions http_options(const Config& config, std::shared_ptr<const TlsIdentity> tls) {
  const Limits& limits = config.limits;
  const auto ms = [](std::uint64_t value) { return std::chrono::milliseconds(value); };
  return {.host = config.host,
          .port = config.port,
          .allowed_hosts = config.allowed_hosts,
          .cors_origins = config.cors_origins,
          .head = {.max_bytes = static_cast<std::size_t>(limits.max_head_bytes),
                   .max_headers = static_cast<std::size_t>(limits.max_headers),
                   .max_path_bytes = static_cast<std::size_t>(limits.max_path_bytes)},
          .head_deadline = ms(limits.head_deadline_ms),
          .body_grace = ms(limits.body_grace_ms),
          .least_body_rate = limits.least_body_rate,
          .stream_write_deadline = ms(limits.stream_write_deadline_ms),
          .max_connections = static_cast<std::size_t>(limits.max_connections),
          .tls = std::move(tls)};
}

/// Connections need descriptors; the usual soft limit of 1024 is below what we are configured to serve.
void raise_descriptor_limit(const Config& config, Log& log) {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  const rlim_t wanted = config.limits.max_connections + 128;
  if (limit.rlim_cur >= wanted) return;
  limit.rlim_cur = std::min<rlim_t>(wanted, limit.rlim_max);
  ::setrlimit(RLIMIT_NOFILE, &limit);
  if (limit.rlim_cur < wanted)
    log.write(LogLevel::kWarn, "descriptor-limit",
              {{"message", "max_connections needs more descriptors than the system grants"},
               {"granted", limit.rlim_cur},
               {"wanted", wanted}});
}

/// Columns of clouds and surfaces go back to the system when they are freed, whatever was allocated since.
void return_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);  // fixed: left alone it grows with the first large piece freed
  ::mallopt(M_ARENA_MAX, 4);             // each connection has a thread, and arenas keep what they got
}

/// Loads the clouds of --sample. A sentence where one cannot be loaded.
std::optional<std::string> load_samples(Service& service, Log& log) {
  for (const SampleFile& sample : service.config.samples) {
    const auto bytes = read_file(sample.path, service.config.limits.max_upload_bytes);
    if (!bytes) return bytes.error().message;
    const SharedCloud kept = service.clouds.find(sha256_hex(bytes.value()), sample.name);
    if (kept != nullptr && kept->owner == kEveryone) continue;  // from before
    const auto cloud = import_cloud(
        service.clouds, service.decode, service.background, service.config.limits, bytes.value(),
        {.name = sample.name, .media_type = "", .drop_non_finite = false, .owner = std::string(kEveryone)});
    if (!cloud.ok()) return sample.path + ": " + cloud.problem().detail;
    log.write(LogLevel::kInfo, "sample-loaded",
              {{"cloud", cloud.value()->document.id},
               {"name", sample.name},
               {"samples", cloud.value()->document.report.sample_count}});
  }
  return std::nullopt;
}

std::optional<std::string> write_port_file(const std::string& path, std::uint16_t port) {
  if (path.empty()) return std::nullopt;
  const std::string text = std::to_string(port) + "\n";
  const auto written = write_file_atomically(path, std::as_bytes(std::span(text.data(), text.size())));
  return written ? std::nullopt : std::optional<std::string>(written.error().message);
}

void log_certificate(const TlsIdentity& tls, const char* event, const Config& config, Log& log) {
  log.write(LogLevel::kInfo, event, {{"file", config.tls_cert}, {"valid_until", tls.valid_until()}});
  if (tls.has_expired())
    log.write(LogLevel::kWarn, "certificate-expired",
              {{"message", "clients refuse a certificate that has expired"},
               {"file", config.tls_cert},
               {"valid_until", tls.valid_until()}});
}

/// The certificate of the settings; null where they name none. Throws std::runtime_error.
std::shared_ptr<TlsIdentity> tls_identity(const Config& config, Log& log) {
  if (config.tls_cert.empty()) return nullptr;
  auto tls = std::make_shared<TlsIdentity>(config.tls_cert, config.tls_key);
  if (auto problem = tls->reload()) throw std::runtime_error(*problem);
  log_certificate(*tls, "certificate", config, log);
  return tls;
}

/// Reads tokens and certificate again and opens the log again, as often as that is asked for (SIGHUP;
/// SIGUSR1: the log alone), until the daemon is to end. Returns the signal that said so.
int wait_for_end(const sigset_t& signals, Service& service, TlsIdentity* tls, Log& log) {
  while (true) {
    int signal = 0;
    if (::sigwait(&signals, &signal) != 0) continue;
    if (signal != SIGHUP && signal != SIGUSR1) return signal;
    if (auto problem = log.reopen()) log.write(LogLevel::kError, "reopen-failed", {{"message", *problem}});
    if (signal == SIGUSR1) continue;
    if (auto problem = service.access.tokens.reload()) {
      log.write(LogLevel::kError, "reload-failed", {{"message", *problem}});
    } else {
      log.write(LogLevel::kInfo, "reloaded", {{"tokens", service.access.tokens.list().size()}});
    }
    if (tls == nullptr) continue;
    if (auto problem = tls->reload())
      log.write(LogLevel::kError, "reload-failed", {{"message", *problem + "; the old certificate stays"}});
    else
      log_certificate(*tls, "reloaded", service.config, log);
  }
}

/// The decoder, with a line in the log for each child that ran.
template <typename Decode>
auto logged(Decode decode, Log& log, const char* what) {
  return [decode = std::move(decode), &log, what](std::span<const std::byte> bytes, auto&&... rest) {
    const auto begin = std::chrono::steady_clock::now();
    auto decoded = decode(bytes, rest...);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    protocol::JsonDocument members{{"what", what}, {"bytes", bytes.size()}, {"duration_ms", took.count()}};
    if (!decoded) members["refused"] = decoded.error().message;
    log.write(LogLevel::kInfo, "decoded", std::move(members));
    return decoded;
  };
}

/// Brings back what is kept, loads the samples, and tells the port. A sentence where that fails.
std::optional<std::string> make_ready(Service& service, const Config& config, std::uint16_t port, Log& log) {
  try {
    for (const std::string& note : service.recover())
      log.write(LogLevel::kError, "damaged", {{"message", note}});
    if (auto problem = load_samples(service, log)) return problem;
  } catch (const std::exception& error) {
    return error.what();
  }
  return write_port_file(config.port_file, port);
}

}  // namespace

int run_daemon(const Config& config) {
  return_freed_memory();
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is a full disk
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGUSR2}) sigaddset(&signals, signal);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // before any thread is made: all inherit it

  const auto fail = [](const std::string& message) {
    std::cerr << "pointwrightd: " << message << "\n";
    return 1;
  };
  try {
    Log log(config.log_level, config.log_file);
    for (const std::string& name : config.unknown_variables)
      log.write(LogLevel::kWarn, "unknown-variable", {{"name", name}});
    raise_descriptor_limit(config, log);
    const std::shared_ptr<TlsIdentity> tls = tls_identity(config, log);
    const auto decoders = std::make_shared<DecodeSlots>(static_cast<int>(config.limits.max_decoders));
    Service service(config,
                    {.decode = logged(confined_decoder(decoders), log, "cloud"),
                     .decode_image = logged(confined_image_decoder(config.limits, decoders), log, "image"),
                     .build = build_hierarchy,
                     .resample = apply_resampled_edit,
                     .assets = config.web_root.empty() ? AssetTable() : AssetTable::load(config.web_root),
                     .report_failure =
                         [&log](const std::string& text) {
                           log.write(LogLevel::kError, "task-failed", {{"failure", text}});
                         },
                     .decode_file = confined_file_decoder(decoders),
                     .routes = route_names()});
    HttpServer server(
        http_options(config, tls),
        [&service](const RequestHead& head, const std::string& id) { return resolve(service, head, id); },
        [&log, &service](const RequestLog& request) {
          service.metrics.count_request(request);
          log.request(request);
        });
    service.connections = [&server] { return server.active_connections(); };
    if (auto problem = server.start()) return fail(*problem);
    std::atomic<bool> ended_by_itself{false};
    std::thread listener([&] {
      if (server.run()) return;
      ended_by_itself = true;
      ::kill(::getpid(), SIGUSR2);  // wakes the wait below
    });
    // From here on it says that it is alive; ready it is once it knows what it holds.
    if (auto problem = make_ready(service, config, server.port(), log)) {
      (void)server.stop(std::chrono::milliseconds(config.limits.shutdown_deadline_ms));
      listener.join();
      return fail(*problem);
    }
    log.write(LogLevel::kInfo, "started",
              {{"version", POINTWRIGHT_VERSION},
               {"host", config.host},
               {"port", server.port()},
               {"pid", ::getpid()}});
    const bool is_ipv6 = config.host.find(':') != std::string::npos;
    std::cout << "pointwrightd listens on " << (tls == nullptr ? "http" : "https") << "://"
              << (is_ipv6 ? "[" + config.host + "]" : config.host) << ":" << server.port() << "/"
              << std::endl;

    const int signal = wait_for_end(signals, service, tls.get(), log);
    // From here on a further signal ends the process as it always would.
    for (const int each : {SIGTERM, SIGINT}) std::signal(each, SIG_DFL);
    sigset_t ending;
    sigemptyset(&ending);
    for (const int each : {SIGTERM, SIGINT}) sigaddset(&ending, each);
    ::pthread_sigmask(SIG_UNBLOCK, &ending, nullptr);
    log.write(LogLevel::kInfo, "stopping", {{"signal", signal}, {"requests", server.active_connections()}});
    service.stopping = true;
    const bool drained = server.stop(std::chrono::milliseconds(config.limits.shutdown_deadline_ms));
    service.sessions.close_all("the server is stopping");
    service.imports.cancel_all();
    service.jobs.stop();
    if (!drained) {
      log.write(LogLevel::kWarn, "stopped", {{"message", "some requests did not end in time"}});
    } else {
      log.write(LogLevel::kInfo, "stopped", {{"message", "all requests ended"}});
    }
    if (!drained) {
      // A connection thread that does not return cannot be joined; nothing of it is worth waiting for any
      // longer.
      log.flush();
      std::_Exit(ended_by_itself ? 1 : 0);
    }
    listener.join();
    if (ended_by_itself) return fail("listening ended by itself");
    return 0;
  } catch (const std::exception& error) {
    return fail(error.what());
  }
}

}  // namespace pointwright::server
