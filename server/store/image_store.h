#pragma once
// The uploaded images, in memory, as pixels and as the files that they came from.

#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/editing/image.h"
#include "protocol/json/documents.h"
#include "server/base/budget.h"
#include "server/base/outcome.h"
#include "server/config/limits.h"
#include "server/ingest/decode_slots.h"
#include "server/ingest/png_reader.h"

namespace pointwright::server {

/// read_png(): in a confined process in the daemon, in this one in tests.
using ImageDecoder = std::function<Result<Image>(std::span<const std::byte>)>;

/// The confined decoder, within the limits; the slots are those of all decoders.
ImageDecoder confined_image_decoder(const Limits& limits, std::shared_ptr<DecodeSlots> slots);

/// One image. Immutable.
struct StoredImage {
  protocol::ImageDocument document;
  std::string sha256;  ///< of the file
  std::string file;    ///< as uploaded
  std::shared_ptr<const Image> image;
  std::shared_ptr<Budget::Hold> memory;  ///< the part of the budget that file and image take
};
using SharedImage = std::shared_ptr<const StoredImage>;

/// Thread-safe. Nothing else refers to an image of the store: paintings keep what came of it.
class ImageStore {
 public:
  explicit ImageStore(const Limits& limits);

  /// Whether one more image may come: asked before its bytes are read. Problem: too many.
  Outcome<Done> check_room() const;
  /// Problems: empty body, everything that decoding refuses, overloaded, too many images, out of space.
  Outcome<SharedImage> add(const ImageDecoder& decode, std::span<const std::byte> file);
  [[nodiscard]] SharedImage find(const std::string& id) const;
  [[nodiscard]] std::vector<SharedImage> list() const;  ///< oldest first
  /// Problem: not found.
  Outcome<Done> remove(const std::string& id);

 private:
  [[nodiscard]] Outcome<Done> check_room_locked() const;

  const std::uint64_t max_images_;
  const ImageLimits limits_;
  mutable Budget memory_;
  mutable std::mutex mutex_;  // guards images_
  std::vector<SharedImage> images_;
};

}  // namespace pointwright::server
