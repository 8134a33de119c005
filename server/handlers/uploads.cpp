#include "server/handlers/uploads.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <ctime>

#include "engine/io/text.h"
#include "server/handlers/handlers.h"
#include "server/handlers/query.h"

namespace pointwright::server {
namespace {

constexpr std::string_view kVersion = "1.0.0";
constexpr std::string_view kExtensions = "creation,creation-with-upload,checksum,termination,expiration";
constexpr std::size_t kMostMetadata = 16 * 1024;
constexpr std::size_t kLongestName = 255;

/// A header that must be one whole number.
Outcome<std::uint64_t> required_number(const RequestHead& head, std::string_view name) {
  const auto text = head.header(name);
  std::uint64_t value = 0;
  if (text) {
    const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
    if (!text->empty() && text->size() <= 18 && error == std::errc{} && end == text->data() + text->size())
      return value;
  }
  return malformed_request(std::string(name).append(" must be a whole number"));
}

std::optional<std::string> from_base64(std::string_view text) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::string bytes;
  std::uint32_t bits = 0;
  unsigned count = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = (bits << 6U) | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<char>((bits >> count) & 0xFFU));
  }
  return bytes;
}

/// "key base64,key base64": filename and filetype are understood, the others kept.
Outcome<Done> read_metadata(const RequestHead& head, UploadRecord& record) {
  const std::string_view all = head.header("upload-metadata").value_or("");
  if (all.size() > kMostMetadata) return malformed_request("Upload-Metadata is longer than 16384 bytes");
  if (std::ranges::any_of(all, [](char c) { return c < ' ' || c > '~'; }))
    return malformed_request("Upload-Metadata has bytes that are not ASCII");
  record.metadata = all;
  std::string_view rest = all;
  while (!rest.empty()) {
    std::string_view pair = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(pair.size() + 1, rest.size()));
    while (!pair.empty() && pair.front() == ' ') pair.remove_prefix(1);
    const std::string_view key = pair.substr(0, pair.find(' '));
    pair.remove_prefix(std::min(key.size() + 1, pair.size()));
    const auto value = from_base64(pair);
    if (key.empty() || !value)
      return malformed_request("Upload-Metadata is not a list of: key, blank, base64");
    if (key == "filename") record.name = clean_text(value->substr(0, kLongestName));
    if (key == "filetype") record.media_type = clean_text(value->substr(0, kLongestName));
  }
  return Done{};
}

Outcome<std::optional<UploadChecksum>> read_checksum(const RequestHead& head) {
  const auto header = head.header("upload-checksum");
  if (!header) return std::optional<UploadChecksum>();
  const std::string_view name = header->substr(0, header->find(' '));
  const auto digest = from_base64(header->substr(std::min(name.size() + 1, header->size())));
  UploadChecksum checksum;
  if (name == "sha1") {
    checksum.algorithm = Digest::Algorithm::kSha1;
  } else if (name != "sha256") {
    return malformed_request("Upload-Checksum names another algorithm than sha1 and sha256");
  }
  const std::size_t expected = checksum.algorithm == Digest::Algorithm::kSha1 ? 20 : 32;
  if (!digest || digest->size() != expected)
    return malformed_request("Upload-Checksum is not a digest in base64");
  checksum.digest = *digest;
  return std::optional<UploadChecksum>(checksum);
}

/// RFC 9110's date.
std::string http_date(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  constexpr std::array<const char*, 7> kDays{"Sun", "Mon", "Tue", "Wed", "Thu", "Fri", "Sat"};
  constexpr std::array<const char*, 12> kMonths{"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                                "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "%s, %02d %s %04d %02d:%02d:%02d GMT",
                kDays.at(static_cast<std::size_t>(parts.tm_wday)), parts.tm_mday,
                kMonths.at(static_cast<std::size_t>(parts.tm_mon)), parts.tm_year + 1900, parts.tm_hour,
                parts.tm_min, parts.tm_sec);
  return text.data();
}

protocol::UploadDocument document_of(const UploadStatus& upload) {
  return {.id = upload.record.id,
          .name = upload.record.name,
          .media_type = upload.record.media_type,
          .length = upload.record.length,
          .offset = upload.offset,
          .created = upload.record.created,
          .expires = upload.expires};
}

Response with_offset(Response response, const UploadStatus& upload) {
  return response.with_header("Upload-Offset", std::to_string(upload.offset))
      .with_header("Upload-Expires", http_date(upload.expires));
}

Response refused(Service& service, const Problem& problem, const Request& request) {
  return with_tus_headers(service, problem_response(problem, request), false);
}

/// The body is in: what stands on the disk now.
Outcome<UploadStatus> finished(const Request& request) {
  auto* const writer = dynamic_cast<UploadStore::Writer*>(request.target.get());
  if (writer == nullptr) return Problem{.kind = ProblemKind::kInternalError, .detail = "there is no upload"};
  return writer->finish();
}

}  // namespace

bool is_upload_path(std::string_view path) {
  constexpr std::string_view kRoot = "/v1/uploads";
  return path.starts_with(kRoot) && (path.size() == kRoot.size() || path[kRoot.size()] == '/');
}

std::optional<Problem> check_tus(const RequestHead& head) {
  if (head.method == Method::kOptions || head.method == Method::kGet) return std::nullopt;
  if (head.header("tus-resumable").value_or("") == kVersion) return std::nullopt;
  return Problem{.kind = ProblemKind::kTusVersion, .detail = "send Tus-Resumable: 1.0.0"};
}

Response with_tus_headers(const Service& service, Response response, bool is_offer) {
  response.with_header("Tus-Resumable", std::string(kVersion));
  if (is_offer)
    response.with_header("Tus-Version", std::string(kVersion))
        .with_header("Tus-Extension", std::string(kExtensions))
        .with_header("Tus-Checksum-Algorithm", "sha1,sha256")
        .with_header("Tus-Max-Size", std::to_string(service.config.limits.max_upload_file_bytes));
  return response;
}

Outcome<std::shared_ptr<BodyTarget>> open_new_upload(Service& service, const Request& request) {
  const auto length = required_number(request.head, "upload-length");
  if (!length.ok()) return length.problem();
  UploadRecord record{.length = length.value()};
  if (auto read = read_metadata(request.head, record); !read.ok()) return read.problem();
  const auto checksum = read_checksum(request.head);
  if (!checksum.ok()) return checksum.problem();
  const std::uint64_t body = request.head.content_length.value_or(0);
  if (body > record.length)
    return Problem{.kind = ProblemKind::kBodyTooLarge,
                   .detail = "the body is longer than Upload-Length",
                   .limit = static_cast<double>(record.length),
                   .actual = static_cast<double>(body)};
  record.owner = request.caller.token;
  const auto made = service.uploads.create(std::move(record));
  if (!made.ok()) return made.problem();
  // The day's bytes are charged with the whole: what is sent again after a break costs nothing more.
  if (auto charged = service.access.charge_upload(request.caller, made.value().record.length);
      !charged.ok()) {
    static_cast<void>(service.uploads.remove(made.value().record.id).ok());
    return charged.problem();
  }
  auto writer = service.uploads.write(made.value().record.id, 0, body, checksum.value());
  if (!writer.ok()) {
    static_cast<void>(service.uploads.remove(made.value().record.id).ok());  // nobody was told of it
    return writer.problem();
  }
  writer.value()->begins_upload();
  return std::shared_ptr<BodyTarget>(std::move(writer.value()));
}

Outcome<std::shared_ptr<BodyTarget>> open_upload(Service& service, const Request& request) {
  if (request.head.media_type() != "application/offset+octet-stream")
    return Problem{.kind = ProblemKind::kUnsupportedMediaType,
                   .detail = "send application/offset+octet-stream"};
  const auto offset = required_number(request.head, "upload-offset");
  if (!offset.ok()) return offset.problem();
  const auto checksum = read_checksum(request.head);
  if (!checksum.ok()) return checksum.problem();
  auto writer = service.uploads.write(request.captures.at(0), offset.value(),
                                      request.head.content_length.value_or(0), checksum.value());
  if (!writer.ok()) return writer.problem();
  return std::shared_ptr<BodyTarget>(std::move(writer.value()));
}

Response list_uploads(Service& service, const Request& request) {
  std::vector<protocol::UploadDocument> documents;
  for (const UploadStatus& upload : service.uploads.list())
    if (request.caller.may_see(upload.record.owner)) documents.push_back(document_of(upload));
  return with_tus_headers(service, json_response(protocol::upload_list(documents)), false);
}

Response create_upload(Service& service, const Request& request) {
  const auto upload = finished(request);
  if (!upload.ok()) return refused(service, upload.problem(), request);
  Response response = with_offset({.status = 201}, upload.value());
  response.with_header("Location", "/v1/uploads/" + upload.value().record.id);
  return with_tus_headers(service, std::move(response), false);
}

Response get_upload(Service& service, const Request& request) {
  const auto upload = service.uploads.find(request.captures.at(0));
  if (!upload)
    return refused(service, {.kind = ProblemKind::kNotFound, .detail = "there is no such upload"}, request);
  Response response = with_offset(json_response(protocol::to_json(document_of(*upload))), *upload);
  response.with_header("Upload-Length", std::to_string(upload->record.length));
  if (!upload->record.metadata.empty()) response.with_header("Upload-Metadata", upload->record.metadata);
  return with_tus_headers(service, std::move(response), false);
}

Response patch_upload(Service& service, const Request& request) {
  const auto upload = finished(request);
  if (!upload.ok()) return refused(service, upload.problem(), request);
  return with_tus_headers(service, with_offset({.status = 204}, upload.value()), false);
}

Response delete_upload(Service& service, const Request& request) {
  if (auto removed = service.uploads.remove(request.captures.at(0)); !removed.ok())
    return refused(service, removed.problem(), request);
  return with_tus_headers(service, {.status = 204}, false);
}

}  // namespace pointwright::server
