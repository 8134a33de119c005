#pragma once
// Clouds, images and sessions as they are kept in the data folder: rows of the database, files by content.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/io/cloud_io.h"
#include "engine/multires/hierarchy.h"
#include "protocol/json/documents.h"
#include "server/sessions/keeper.h"
#include "server/store/answers.h"
#include "server/store/blob_store.h"
#include "server/store/database.h"

namespace pointwright::server {

/// How a cloud is made of its file.
struct CloudSource {
  CloudFormat format = CloudFormat::kPly;
  bool drop_non_finite = false;
};

struct KeptCloud {
  protocol::CloudDocument document;
  CloudSource source;
  std::string content;  ///< hash of what the file was decoded to
  std::string owner = {};
  std::shared_ptr<const void> quota = {};  ///< its part of the owner's; not kept
};

struct KeptImage {
  protocol::ImageDocument document;
  std::string sha256;
  std::string owner = {};
  std::shared_ptr<const void> quota = {};  ///< its part of the owner's; not kept
};

/// What is known of a session without its paintings and edits.
struct KeptSession {
  std::string id;
  std::string owner;
  std::string cloud;
  std::string name;
  HierarchyParams params;
  protocol::TimePoint created;
  protocol::TimePoint used;
  std::uint64_t revision = 0;
  std::uint64_t head = 0;
  std::uint64_t samples = 0;
  std::optional<protocol::PreviewSize> preview = std::nullopt;  ///< none: all samples of the cloud
  std::optional<std::string> damage;                            ///< why it is not served
  std::shared_ptr<const void> quota = {};                       ///< its part of the owner's; not kept
};

/// Thread-safe. Changes are on the disk when they return. Problems of all changes: out of disk, storage
/// failed.
class Archive {
 public:
  Archive(const DataFolder& folder, Database& database) : blobs_(folder), database_(database) {}

  Outcome<Done> add(const KeptCloud& cloud, const BlobContent& file, const KeptAnswer* answer);
  Outcome<Done> add(const KeptImage& image, std::span<const std::byte> file, const KeptAnswer* answer);
  Outcome<Done> add(const KeptSession& session, const KeptAnswer* answer);
  Outcome<Done> remove_cloud(const std::string& id, const std::string& sha256);
  Outcome<Done> remove_image(const std::string& id, const std::string& sha256);
  Outcome<Done> remove_session(const std::string& id);

  /// Oldest first. Rows that are damaged are left out; `damaged` counts them. Throw DatabaseError.
  [[nodiscard]] std::vector<KeptCloud> clouds(std::size_t& damaged);
  [[nodiscard]] std::vector<KeptImage> images(std::size_t& damaged);
  /// Those with damaged rows say so.
  [[nodiscard]] std::vector<KeptSession> sessions();
  /// Revision, head, paintings and edits, as far as a document has them without surfaces. Problem: damaged.
  Outcome<std::shared_ptr<const Document>> load(const std::string& session);
  /// The file of a cloud. Problems: damaged, overloaded.
  [[nodiscard]] Outcome<std::shared_ptr<const BlobStore::Open>> open_file(const std::string& sha256) {
    return blobs_.open(sha256);
  }
  /// The file of a cloud or an image, whole. Problems: the same.
  [[nodiscard]] Outcome<std::vector<std::byte>> file(const std::string& sha256) {
    return blobs_.read(sha256);
  }

  /// Whether the open file is that of a cloud or an image. Cost: looks at all of them.
  [[nodiscard]] bool has_file(int file);

  /// What a session hands its changes to. The archive must outlive it.
  [[nodiscard]] std::shared_ptr<SessionKeeper> keeper(const std::string& session);

  /// Deletes what nothing refers to. Pre: nothing is being stored.
  void sweep();
  [[nodiscard]] bool has_failed() const { return database_.has_failed() || blobs_.has_failed(); }

 private:
  class Keeper;
  [[nodiscard]] BlobStore::IsUsed is_used();

  BlobStore blobs_;
  Database& database_;
};

/// A hash of a row's columns, which is kept beside them.
std::string row_seal(std::initializer_list<std::string_view> columns);

}  // namespace pointwright::server
