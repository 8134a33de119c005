#include "engine/io/zip_archive.h"

#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <utility>

#include "engine/io/text.h"

namespace pointwright {
namespace {

using OwnedEntry = std::unique_ptr<archive_entry, void (*)(archive_entry*)>;

Error malformed(archive* of, const std::string& name) {
  const char* const said = archive_error_string(of);
  std::string message = "the ZIP archive cannot be read";
  if (!name.empty()) message.append(" at ").append(quoted(name));
  if (said != nullptr) message.append(": ").append(clean_text(said));
  return Error{.code = ErrorCode::kMalformedData, .message = std::move(message), .field = {}};
}

Error unwritten(archive* to) {
  const char* const said = archive_error_string(to);
  return Error{
      .code = ErrorCode::kInvalidArgument,
      .message = std::string("the ZIP archive cannot be written").append(said == nullptr ? "" : ": ") +
                 (said == nullptr ? "" : said),
      .field = "path"};
}

struct Taker {
  const ByteSink& sink;
  bool is_ended = false;  // what comes is thrown away
};

/// Never fails: libarchive loses the memory of an archive that ends with a failure.
la_ssize_t give_to_sink(archive*, void* context, const void* bytes, std::size_t count) {
  auto& taker = *static_cast<Taker*>(context);
  if (!taker.is_ended && !taker.sink({static_cast<const std::byte*>(bytes), count})) taker.is_ended = true;
  return static_cast<la_ssize_t>(count);
}

Result<void> add(archive* to, const ZipEntry& entry) {
  auto content = entry.content();
  if (!content) return content.error();
  const std::vector<std::byte>& bytes = content.value();
  if (bytes.size() != entry.bytes)
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = entry.name + " is not as long as it was said to be",
                 .field = "path"};
  const OwnedEntry head(archive_entry_new(), archive_entry_free);
  archive_entry_set_pathname(head.get(), entry.name.c_str());
  archive_entry_set_size(head.get(), static_cast<la_int64_t>(entry.bytes));
  archive_entry_set_filetype(head.get(), AE_IFREG);
  archive_entry_set_perm(head.get(), 0644);
  if (archive_write_header(to, head.get()) != ARCHIVE_OK) return unwritten(to);
  if (!bytes.empty() &&
      archive_write_data(to, bytes.data(), bytes.size()) != static_cast<la_ssize_t>(bytes.size()))
    return unwritten(to);
  return {};
}

}  // namespace

Result<void> write_zip(std::span<const ZipEntry> entries, const ByteSink& sink) {
  const std::unique_ptr<archive, int (*)(archive*)> to(archive_write_new(), archive_write_free);
  Taker taker{.sink = sink};
  if (archive_write_set_format_zip(to.get()) != ARCHIVE_OK ||
      archive_write_set_format_option(to.get(), "zip", "compression", "store") != ARCHIVE_OK ||
      archive_write_set_bytes_in_last_block(to.get(), 1) != ARCHIVE_OK ||
      archive_write_open(to.get(), &taker, nullptr, give_to_sink, nullptr) != ARCHIVE_OK)
    return unwritten(to.get());
  for (const ZipEntry& entry : entries)
    if (auto added = taker.is_ended ? Result<void>() : add(to.get(), entry); !added) {
      taker.is_ended = true;
      return added;
    }
  if (archive_write_close(to.get()) != ARCHIVE_OK) return unwritten(to.get());
  if (taker.is_ended)
    return Error{.code = ErrorCode::kInvalidArgument,
                 .message = "there is no room for the ZIP archive",
                 .field = "path"};
  return {};
}

ZipReader::ZipReader(archive* opened) : archive_(opened, archive_read_free) {}

Result<ZipReader> ZipReader::open(std::span<const std::byte> bytes) {
  ZipReader reader(archive_read_new());
  archive* const from = reader.archive_.get();
  // By its directory alone: what stands between the files is nobody's.
  if (archive_read_support_format_zip_seekable(from) != ARCHIVE_OK ||
      archive_read_open_memory(from, bytes.data(), bytes.size()) != ARCHIVE_OK)
    return malformed(from, {});
  return reader;
}

Result<std::optional<std::string>> ZipReader::next() {
  archive_entry* entry = nullptr;
  const int status = is_at_end_ ? ARCHIVE_EOF : archive_read_next_header(archive_.get(), &entry);
  is_at_end_ = status == ARCHIVE_EOF;
  if (is_at_end_) return std::optional<std::string>();
  // A warning is of a name that this locale cannot say: nobody asks for that file.
  if (status != ARCHIVE_OK && status != ARCHIVE_WARN) return malformed(archive_.get(), {});
  const char* name = archive_entry_pathname_utf8(entry);
  if (name == nullptr) name = archive_entry_pathname(entry);
  name_ = name == nullptr ? std::string() : std::string(name);
  return std::optional(name_);
}

Result<std::vector<std::byte>> ZipReader::content(std::uint64_t most_bytes) {
  std::vector<std::byte> bytes;
  while (true) {
    const void* block = nullptr;
    std::size_t count = 0;
    la_int64_t offset = 0;
    const int status = archive_read_data_block(archive_.get(), &block, &count, &offset);
    if (status == ARCHIVE_EOF) return bytes;
    if (status != ARCHIVE_OK || offset != static_cast<la_int64_t>(bytes.size()))
      return malformed(archive_.get(), name_);
    if (count > most_bytes - bytes.size())
      return Error{.code = ErrorCode::kTooLarge,
                   .message = quoted(name_) + " in the ZIP archive is longer than " +
                              std::to_string(most_bytes) + " bytes",
                   .field = {},
                   .limit = static_cast<double>(most_bytes)};
    const auto* const from = static_cast<const std::byte*>(block);
    bytes.insert(bytes.end(), from, from + count);
  }
}

}  // namespace pointwright
