#include "server/store/upload_file.h"

#include <span>

#include "protocol/json/requests.h"
#include "server/ingest/files.h"
#include "server/store/row_time.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kMostRecordBytes = 64 * 1024;

std::string path_of(const std::string& folder, const std::string& id, const char* ending) {
  std::string path = folder;
  return path.append("/").append(id).append(ending);
}

}  // namespace

std::string upload_bytes_path(const std::string& folder, const std::string& id) {
  return path_of(folder, id, ".bytes");
}
std::string upload_record_path(const std::string& folder, const std::string& id) {
  return path_of(folder, id, ".json");
}
std::string upload_mark_path(const std::string& folder, const std::string& id) {
  return path_of(folder, id, ".mark");
}

Result<void> write_upload_record(const std::string& folder, const UploadRecord& record) {
  const protocol::JsonDocument document{
      {"length", record.length},     {"name", record.name},   {"media_type", record.media_type},
      {"metadata", record.metadata}, {"owner", record.owner}, {"created_ms", to_ms(record.created)}};
  const std::string text = document.dump();
  return write_file_atomically(upload_record_path(folder, record.id),
                               std::as_bytes(std::span(text.data(), text.size())));
}

std::optional<UploadRecord> read_upload_record(const std::string& folder, const std::string& id) {
  const auto bytes = read_file(upload_record_path(folder, id), kMostRecordBytes);
  if (!bytes) return std::nullopt;
  const auto* const text = reinterpret_cast<const char*>(bytes.value().data());
  const auto document = protocol::Json::parse(text, text + bytes.value().size(), nullptr, false);
  const auto is_text = [&](const char* name) {
    return document.contains(name) && document[name].is_string();
  };
  const bool whole = document.is_object() && is_text("name") && is_text("media_type") &&
                     is_text("metadata") && is_text("owner") && document.contains("length") &&
                     document["length"].is_number_unsigned() && document.contains("created_ms") &&
                     document["created_ms"].is_number_integer();
  if (!whole) return std::nullopt;
  return UploadRecord{.id = id,
                      .length = document["length"].get<std::uint64_t>(),
                      .name = document["name"].get<std::string>(),
                      .media_type = document["media_type"].get<std::string>(),
                      .metadata = document["metadata"].get<std::string>(),
                      .owner = document["owner"].get<std::string>(),
                      .created = from_ms(document["created_ms"].get<std::int64_t>())};
}

}  // namespace pointwright::server
