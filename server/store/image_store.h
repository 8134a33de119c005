#pragma once
// The uploaded images, in memory, as pixels and as the files that they came from.

#include <cstdint>
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
#include "server/store/archive.h"
#include "server/store/places.h"

namespace pointwright::server {

/// read_png(): in a confined process in the daemon, in this one in tests.
using ImageDecoder = std::function<Result<Image>(std::span<const std::byte>)>;

/// The confined decoder, within the limits; the slots are those of all decoders.
ImageDecoder confined_image_decoder(const Limits& limits, std::shared_ptr<DecodeSlots> slots);

/// What an image is made of: there from its upload on, or once somebody needs it.
struct ImageContent {
  std::string file;  ///< as uploaded
  Image image;
  std::shared_ptr<Budget::Hold> memory;  ///< the part of the budget that file and image take
};

/// One image. Immutable but for whether its content is there.
struct StoredImage {
  protocol::ImageDocument document;
  std::string owner;                  ///< the id of a token; empty: made where none were in use
  std::string sha256;                 ///< of the file
  std::shared_ptr<const void> quota;  ///< its part of the owner's

 private:
  friend class ImageStore;
  mutable std::mutex mutex_;  // guards the next one
  mutable std::shared_ptr<const ImageContent> content_;
};
using SharedImage = std::shared_ptr<const StoredImage>;

/// Thread-safe. Nothing else refers to an image of the store: paintings keep what came of it.
class ImageStore {
 public:
  /// `archive`: where images are kept; null: nowhere.
  explicit ImageStore(const Limits& limits, Archive* archive = nullptr);

  /// Takes over what the archive has, at start.
  void restore(std::vector<KeptImage> images);
  /// Whether one more image may come: asked before its bytes are read. Problem: too many.
  Outcome<Done> check_room() const;
  /// Problems: empty body, everything that decoding refuses, overloaded, too many images, out of space;
  /// those of the archive.
  Outcome<SharedImage> add(const ImageDecoder& decode, std::span<const std::byte> file,
                           std::string owner = {}, std::shared_ptr<const void> quota = {},
                           const Seal<protocol::ImageDocument>& seal = {});
  /// From the archive where it is not there. Problems: damaged, out of space, overloaded.
  [[nodiscard]] Outcome<std::shared_ptr<const ImageContent>> content_of(const ImageDecoder& decode,
                                                                        const StoredImage& image) const;
  [[nodiscard]] SharedImage find(const std::string& id) const;
  [[nodiscard]] std::vector<SharedImage> list() const;  ///< oldest first
  /// Problem: not found; those of the archive.
  Outcome<Done> remove(const std::string& id);

  /// What all of them take.
  [[nodiscard]] const Budget& memory() const { return memory_; }

 private:
  [[nodiscard]] Outcome<std::shared_ptr<const ImageContent>> decoded(const ImageDecoder& decode,
                                                                     std::span<const std::byte> file,
                                                                     const StoredImage* loading) const;
  /// A part of the budget, for which content is let go that nobody holds and the archive has. Null where
  /// there is none. `loading`: the image that it is for, locked by the caller.
  [[nodiscard]] std::shared_ptr<Budget::Hold> room_for(std::uint64_t bytes, const StoredImage* loading) const;

  const ImageLimits limits_;
  Archive* const archive_;
  mutable Budget memory_;
  mutable std::mutex mutex_;  // guards what follows
  std::vector<SharedImage> images_;
  Places places_;
};

}  // namespace pointwright::server
