#include "server/store/assets.h"

#include <filesystem>
#include <stdexcept>

#include "server/base/sha256.h"
#include "server/ingest/files.h"

namespace pointwright::server {
namespace {

constexpr std::uint64_t kMaxBytes = 256ULL << 20U;
constexpr std::size_t kMaxFiles = 2000;

std::string content_type_of(const std::string& extension) {
  static const std::map<std::string, std::string> types = {
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json; charset=utf-8"},
      {".map", "application/json; charset=utf-8"},
      {".svg", "image/svg+xml; charset=utf-8"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".webp", "image/webp"},
      {".ico", "image/x-icon"},
      {".woff2", "font/woff2"},
      {".wasm", "application/wasm"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json; charset=utf-8"}};
  const auto it = types.find(extension);
  return it == types.end() ? "application/octet-stream" : it->second;
}

}  // namespace

AssetTable AssetTable::load(const std::string& folder) {
  namespace fs = std::filesystem;
  AssetTable table;
  std::uint64_t total = 0;
  std::error_code error;
  fs::recursive_directory_iterator it(folder, error);
  if (error) throw std::runtime_error("cannot read the viewer's folder " + folder + ": " + error.message());
  for (; it != fs::recursive_directory_iterator(); it.increment(error)) {
    if (error) throw std::runtime_error("cannot read the viewer's folder " + folder + ": " + error.message());
    const bool hidden = it->path().filename().string().front() == '.';
    if (hidden || it->is_symlink()) {
      it.disable_recursion_pending();
      continue;
    }
    if (!it->is_regular_file()) continue;
    auto bytes = read_file(it->path().string(), kMaxBytes - total);
    if (!bytes) throw std::runtime_error(bytes.error().message);
    total += bytes.value().size();
    const auto owner = std::make_shared<const std::vector<std::byte>>(std::move(bytes).value());
    std::string path(1, '/');
    path += fs::relative(it->path(), folder).generic_string();
    table.assets_[path] = {.bytes = {.owner = owner, .bytes = *owner},
                           .content_type = content_type_of(it->path().extension().string()),
                           .etag = std::string(1, '"').append(sha256_hex(*owner), 0, 32).append(1, '"')};
    if (table.assets_.size() > kMaxFiles)
      throw std::runtime_error("the viewer's folder holds too many files");
  }
  const auto index = table.assets_.find("/index.html");
  if (index == table.assets_.end())
    throw std::runtime_error("the viewer's folder " + folder + " has no index.html");
  table.assets_["/"] = index->second;
  return table;
}

const Asset* AssetTable::find(const std::string& path) const {
  const auto it = assets_.find(path);
  return it == assets_.end() ? nullptr : &it->second;
}

}  // namespace pointwright::server
