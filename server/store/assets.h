#pragma once
// The viewer's files: an exact table in memory, made once at start.

#include <map>
#include <string>
#include <vector>

#include "server/http/message.h"

namespace pointwright::server {

struct Asset {
  SharedBytes bytes;
  std::string content_type;
  std::string etag;
};

/// Immutable once loaded.
class AssetTable {
 public:
  AssetTable() = default;
  /// Reads all regular files below the folder; symbolic links and names that start with a dot are left out.
  /// Throws std::runtime_error with a sentence where the folder cannot be read, lacks index.html or is too
  /// large.
  static AssetTable load(const std::string& folder);

  /// By request path ("/assets/app.js"); "/" is index.html. Null where there is none.
  [[nodiscard]] const Asset* find(const std::string& path) const;
  [[nodiscard]] std::size_t size() const { return assets_.size(); }

 private:
  std::map<std::string, Asset> assets_;
};

}  // namespace pointwright::server
