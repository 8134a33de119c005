#include "server/cli/remote/upload.h"

#include <sys/stat.h>

#include <atomic>
#include <charconv>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "server/base/sha256.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

using nlohmann::json;

constexpr std::uint64_t kResumableBytes = 32ULL << 20U;
constexpr int kInterrupted = 130;

std::atomic<bool> interrupted{false};

/// Takes Ctrl-C for a wish to stop while it lives; a second one ends the program as ever.
class InterruptGuard {
 public:
  InterruptGuard() {
    interrupted = false;
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = true; };
    action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigaction(SIGINT, &action, &before_);
  }
  ~InterruptGuard() { sigaction(SIGINT, &before_, nullptr); }
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

 private:
  struct sigaction before_ {};
};

CommandFailure trouble(std::string text, ExitCode code = ExitCode::kUsage) {
  return {.code = code, .text = std::move(text)};
}

std::string base64(const std::string& bytes) {
  static constexpr char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = (bits << 8U) | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kLetters[(bits >> (18U - 6U * k)) & 63U] : '=';
  }
  return text;
}

std::string checksum_of(const std::string& part) {
  const std::string digits = sha256_hex(std::as_bytes(std::span(part.data(), part.size())));
  std::string digest;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    unsigned value = 0;
    std::from_chars(digits.data() + i, digits.data() + i + 2, value, 16);
    digest += static_cast<char>(value);
  }
  return base64(digest);
}

std::optional<std::uint64_t> number_in(const std::string& text) {
  std::uint64_t value = 0;
  const char* end = text.data() + text.size();
  if (text.empty() || std::from_chars(text.data(), end, value).ptr != end) return std::nullopt;
  return value;
}

/// A file that is read at any place.
class Source {
 public:
  explicit Source(const std::string& path) : stream_(path, std::ios::binary) {
    struct stat status {};
    if (!stream_ || ::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode))
      throw trouble(std::string(path).append(": cannot be read"));
    size = static_cast<std::uint64_t>(status.st_size);
    modified = static_cast<std::int64_t>(status.st_mtime);
  }
  std::string read(std::uint64_t offset, std::size_t wanted) {
    std::string piece(wanted, '\0');
    stream_.clear();
    stream_.seekg(static_cast<std::streamoff>(offset));
    stream_.read(piece.data(), static_cast<std::streamsize>(wanted));
    piece.resize(static_cast<std::size_t>(stream_.gcount()));
    return piece;
  }
  std::uint64_t size = 0;
  std::int64_t modified = 0;

 private:
  std::ifstream stream_;
};

/// One upload by tus 1.0.
class ResumableUpload {
 public:
  ResumableUpload(const RemoteService& service, const UploadOptions& options, Source& source,
                  bool has_checksums)
      : service_(service), options_(options), source_(source), has_checksums_(has_checksums) {}

  /// Sends what is missing; answers the upload's id.
  std::string send() {
    std::optional<std::uint64_t> offset;
    if (options_.resume) recall();
    if (!path_.empty()) offset = reached();
    if (!offset) {
      create();
      offset = 0;
    }
    int failures = 0;
    while (*offset < source_.size) {
      tell(*offset);
      const HttpAnswer answer = send_part(*offset);
      if (interrupted) throw stopped();
      const auto now = number_in(answer.header("upload-offset"));
      if (answer.status >= 200 && answer.status < 300) {
        if (!now || *now <= *offset || *now > source_.size)
          throw trouble("the server does not say how much of the upload has arrived", ExitCode::kUnreachable);
        offset = now;
        failures = 0;
        continue;
      }
      // 409: another offset than the server's; 423: the part before is still being taken; 460: the part was
      // damaged on its way.
      const bool again = (answer.status == 0 && !answer.is_untrusted) || answer.status == 409 ||
                         answer.status == 423 || answer.status == 460 || is_overloaded(answer);
      if (!again || failures >= service_.retries().count)
        throw left_behind(failure_of(answer, service_.http()));
      service_.pause(failures++, answer.header("retry-after"));
      const auto arrived = reached();
      if (!arrived) throw left_behind(failure_of(answer, service_.http()));
      if (*arrived > *offset) failures = 0;
      offset = arrived;
    }
    tell(source_.size);
    return path_.substr(path_.rfind('/') + 1);
  }

  void forget() const {
    std::error_code ignored;
    std::filesystem::remove(memory_file_of(options_.file), ignored);
  }

 private:
  static constexpr const char* kVersion = "1.0.0";

  void tell(std::uint64_t offset) const {
    if (options_.progress && source_.size > 0)
      options_.progress(static_cast<double>(offset) / static_cast<double>(source_.size));
  }

  CommandFailure left_behind(CommandFailure failure) const {
    failure.text.append("\n  go on with: pointwright upload --resume ").append(options_.file);
    return failure;
  }
  [[nodiscard]] CommandFailure stopped() const {
    return left_behind({.code = static_cast<ExitCode>(kInterrupted), .text = "interrupted"});
  }

  HttpAnswer send_part(std::uint64_t offset) {
    const std::uint64_t length = std::min(options_.part_bytes, source_.size - offset);
    const std::string part = source_.read(offset, static_cast<std::size_t>(length));
    if (part.size() != length) throw trouble(options_.file + ": became shorter during its upload");
    HttpRequest request{.method = "PATCH", .path = path_};
    request.headers = {{"Tus-Resumable", kVersion}, {"Upload-Offset", std::to_string(offset)}};
    if (has_checksums_) request.headers.emplace_back("Upload-Checksum", "sha256 " + checksum_of(part));
    request.type = "application/offset+octet-stream";
    request.length = length;
    request.read_body = [&](std::uint64_t at, std::size_t wanted, std::string& piece) {
      if (interrupted) return false;
      piece = part.substr(static_cast<std::size_t>(at), wanted);
      tell(offset + at);
      return true;
    };
    return service_.http().send(request);
  }

  void create() {
    HttpRequest request{.method = "POST", .path = "/v1/uploads"};
    request.headers = {{"Tus-Resumable", kVersion}, {"Upload-Length", std::to_string(source_.size)}};
    const std::string name = std::filesystem::path(options_.file).filename().string();
    request.headers.emplace_back("Upload-Metadata", "filename " + base64(name));
    path_ = service_.http().path_of(service_.ask(std::move(request)).header("location"));
    if (path_.empty() || path_.front() != '/')
      throw trouble("the server does not say where the upload is", ExitCode::kUnreachable);
    const json memory{{"server", service_.http().url()},
                      {"upload", path_},
                      {"bytes", source_.size},
                      {"modified", source_.modified}};
    const std::string text = memory.dump() + "\n";
    const auto written = write_file_atomically(memory_file_of(options_.file),
                                               std::as_bytes(std::span(text.data(), text.size())));
    if (!written) throw trouble(memory_file_of(options_.file) + ": " + written.error().message);
  }

  /// Takes up an upload that is remembered, where it is of the same bytes on the same server.
  void recall() {
    std::ifstream file(memory_file_of(options_.file), std::ios::binary);
    const json memory = json::parse(file, nullptr, false);
    if (!memory.is_object() || !memory.contains("upload") || !memory["upload"].is_string()) return;
    const bool same = memory.value("server", json()) == service_.http().url() &&
                      memory.value("bytes", json()) == source_.size &&
                      memory.value("modified", json()) == source_.modified;
    if (same) path_ = memory["upload"].get<std::string>();
  }

  /// How much the server has; nothing where it does not know the upload any more.
  [[nodiscard]] std::optional<std::uint64_t> reached() const {
    for (int attempt = 0;; ++attempt) {
      const HttpAnswer answer =
          service_.http().send({.method = "HEAD", .path = path_, .headers = {{"Tus-Resumable", kVersion}}});
      if (interrupted) throw stopped();
      if (answer.status == 404 || answer.status == 410) return std::nullopt;
      const auto offset = number_in(answer.header("upload-offset"));
      if (answer.status >= 200 && answer.status < 300 && offset && *offset <= source_.size) return offset;
      const bool again = (answer.status == 0 && !answer.is_untrusted) || is_overloaded(answer);
      if (!again || attempt >= service_.retries().count)
        throw left_behind(failure_of(answer, service_.http()));
      service_.pause(attempt, answer.header("retry-after"));
    }
  }

  const RemoteService& service_;
  const UploadOptions& options_;
  Source& source_;
  bool has_checksums_;
  std::string path_;
};

std::string media_type_of(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension().string();
  if (extension == ".drc") return "model/x-draco";
  if (extension == ".zip") return "application/zip";
  if (extension == ".ply") return "application/x-ply";
  if (extension == ".xyz" || extension == ".txt" || extension == ".asc") return "text/plain";
  return "application/octet-stream";
}

HttpAnswer upload_whole(const RemoteService& service, const UploadOptions& options, Source& source,
                        const std::string& name) {
  // The server refuses before it reads the body; asked first, it can say so.
  const json limits = service.get("/v1/info").value("limits", json::object());
  const auto limit = limits.value("max_upload_bytes", source.size);
  if (source.size > limit) {
    std::ostringstream text;
    text << options.file << ": " << source.size << " bytes, beyond the server's limit of " << limit;
    throw trouble(text.str(), ExitCode::kRefused);
  }
  HttpRequest request{.method = "POST", .path = "/v1/clouds", .query = {{"name", name}}};
  if (options.drop_non_finite) request.query.emplace_back("nonfinite", "drop");
  request.type = media_type_of(options.file);
  request.length = source.size;
  request.read_body = [&](std::uint64_t at, std::size_t wanted, std::string& piece) {
    if (interrupted) return false;
    piece = source.read(at, wanted);
    if (options.progress) options.progress(static_cast<double>(at) / static_cast<double>(source.size));
    return !piece.empty();
  };
  try {
    return service.ask(std::move(request));
  } catch (CommandFailure& failure) {
    if (interrupted) throw CommandFailure{.code = static_cast<ExitCode>(kInterrupted), .text = "interrupted"};
    throw;
  }
}

/// Makes a cloud of an upload that has arrived, and waits until it is one.
HttpAnswer import_upload(const RemoteService& service, const UploadOptions& options,
                         const std::string& upload, const std::string& name) {
  json body{{"upload", upload}, {"name", name}};
  if (options.drop_non_finite) body["nonfinite"] = "drop";
  HttpAnswer answer = service.ask("POST", "/v1/clouds", body);
  while (true) {
    const json document = document_of(answer);
    const std::string state = document.value("state", "");
    if (state == "failed") throw trouble("the cloud could not be read", ExitCode::kRefused);
    if (answer.status != 202 && state != "importing" && state != "building") return answer;
    service.pause(0, "");
    const std::string location = answer.header("location");
    const std::string path = location.empty() ? "/v1/clouds/" + document.value("id", "") : location;
    answer = service.ask("GET", service.http().path_of(path), nullptr);
  }
}

}  // namespace

std::string memory_file_of(const std::string& file) {
  return file + ".upload";
}

HttpAnswer upload_file(const RemoteService& service, const UploadOptions& options) {
  Source source(options.file);
  const std::string name =
      options.name.empty() ? std::filesystem::path(options.file).filename().string() : options.name;
  const InterruptGuard guard;
  if (options.resume || source.size >= kResumableBytes) {
    const HttpAnswer abilities = service.http().send({.method = "OPTIONS", .path = "/v1/uploads"});
    if (abilities.status == 0) throw failure_of(abilities, service.http());
    if (abilities.header("tus-version").find("1.0.0") != std::string::npos) {
      const bool has_checksums =
          abilities.header("tus-checksum-algorithm").find("sha256") != std::string::npos;
      ResumableUpload upload(service, options, source, has_checksums);
      const std::string id = upload.send();
      HttpAnswer answer = import_upload(service, options, id, name);
      upload.forget();
      return answer;
    }
    if (options.resume) throw trouble("this server takes no resumable uploads", ExitCode::kRefused);
  }
  return upload_whole(service, options, source, name);
}

}  // namespace pointwright::server
